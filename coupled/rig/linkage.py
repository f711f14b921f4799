"""Linkage: from δc to the grip, through the servo, its backlash, and the structure's bend.

    servo      (without one: x = u, |x'| ≤ rate limit)
               x'' = ω²·(u − x) + 2ζω·(p·u' − x'),   |x'| ≤ rate limit, |x''| ≤ acceleration
               limit, of a motor's torque or a profile;  u is δc by `command`, delayed or in set
               points. p = 0: a position servo of second order, and with ζ far above 1 a
               proportional one of first order; p = 1: a PI controller of the error e,
               x' = 2ζω·e + ω²·∫e
    backlash   the grip's side follows x once the play is taken up; with a contact stiffness the
               force moves it against spring and damper of the contact, which acts beyond the
               play only: k·τ·z' + k·(|z| − play/2)·sgn(z) = F, δ = x + z
    bend       δ = x + K·F                     eq. (1); stiffening: limit·tanh(K·F/limit);
               a curve f(F), piecewise linear, adds to it (`curves`)
    direction  K for a pull, another for a push; both meet at F = 0
    hysteresis δ = x + (1 − s)·bend(F) + s·bend(P), P behind a play of full width w in the force:
               a cycle between ±A (A > w/2, one K) dissipates s·K·w·(2A − w)
    mode       the structure has mass: y'' = ω²·(bend − y) − 2ζω·y', δ = x + y
    structure  + Σ K_ij·F_j of the other controls  (`structure`)
    arc        the transducer reads L·sin(δ/L)  eqs. (15) to (17)

The servo is stepped exactly for a δc linear over the substep, so it is stable at any frequency and
of second order in δc.
"""

from __future__ import annotations

import cmath
import math
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.command import CommandParameters, CommandState, commanded
from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, Given
from coupled.rig.parameters import DELAY_SLOTS, Loader
from coupled.rig.piecewise import SHAPE, along, count_of, slope_along, table_of

CONTACT_s = 2e-3  # chosen: damping of a backlash's contact over its stiffness
SMALL = 1e-6  # angle over a substep, rad, below which the servo counts as critically damped


class LinkageParameters(CommandParameters, Protocol):
    """Servo, backlash, structure and grip."""

    position: NDArray[np.float64]  # weights of (x, x', δc before, δc after) in the next x
    speed: NDArray[np.float64]  # and in the next x'
    rate_limit: float  # d/s; 0 for none
    acceleration_limit: float  # d/s²; 0 for none
    play: float  # full width of the backlash, d
    bend: float  # K of the structure, d/N, for a pull
    push: float  # and for a push
    bend_limit: float  # at which the bend saturates, d; 0 for none
    curve_nodes: int  # of the bend's curve; 0 without one
    curve: NDArray[np.float64]  # d over N
    share: float  # of the bend that follows the force through a play
    width: float  # full width of that play, N
    modal: int  # the structure has mass
    mode_position: NDArray[np.float64]  # weights of (y, y', bend before, bend after) in the next y
    mode_speed: NDArray[np.float64]  # and in the next y'
    contact: float  # stiffness of the backlash's contact, N/d; 0 for a rigid one
    carries: int  # whether any part has a memory of the force
    arc_length: float  # L of the grip's arc, d; 0 if the transducer reads δ itself


class LinkageState(CommandState, Protocol):
    """The servo, and the grip's side of the backlash."""

    position: float  # x, d
    rate: float  # x', d/s
    grip: float  # behind the backlash, before the bend, d
    carried: float  # P, the force behind the bend's play, N
    touch: float  # z, the grip relative to the servo with a soft contact, d
    bent: float  # y, d
    bent_rate: float  # y', d/s
    mode_input: float  # the input of the mode, the static bend at the last node, d
    others: float  # bend by the other controls' forces, d


def servo_weights(
    omega_rad_per_s: float, damping_ratio: float, h: float, rate_share: float = 0.0
) -> NDArray[np.float64]:
    """Return the servo's exact one-substep map, shape (2, 4).

    Rows give (x, x') after h seconds from (x, x', δc before, δc after), with δc linear in between.
    Behind a ramp u₀ + s·t the servo settles at x = u₀ + s·t − 2ζ(1 − p)s/ω, x' = s, where p is the
    share of the command's rate in its input; an initial deviation decays like the free servo.
    """
    w, z = omega_rad_per_s, damping_ratio
    turn = cmath.sqrt(complex(1.0 - z * z)) * w  # imaginary if the servo is overdamped
    ahead, behind = (cmath.exp((-z * w + side * turn) * h) for side in (1j, -1j))
    wave = 0.5 * (ahead + behind).real
    swing = math.exp(-z * w * h) * h  # the limit at critical damping
    if abs(turn) * h > SMALL:
        swing = ((ahead - behind) / (2j * turn)).real
    free = np.array([[wave + z * w * swing, swing], [-w * w * swing, wave - z * w * swing]])
    lag = 2.0 * z * (1.0 - rate_share) / w
    # Columns: effect of u₀ and of s on (x, x').
    level = np.array([1.0, 0.0]) - free[:, 0]
    ramp = np.array([h - lag, 1.0]) - free @ np.array([-lag, 1.0])
    return np.column_stack((free, level - ramp / h, ramp / h))


def weights_of_servo(loader: Loader, h: float) -> NDArray[np.float64]:
    """Return the map of a loader's servo over h seconds, as `servo_weights`.

    Without a servo the position is δc itself, and the rate its mean over the substep.
    """
    if loader.servo_frequency == 0.0:
        return np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, -1.0 / h, 1.0 / h]])
    omega = 2.0 * math.pi * loader.servo_frequency
    return _weights(omega, loader.servo_damping_ratio, h, loader.servo_rate_share)


def _servo(g: Given) -> NDArray[np.float64]:
    return weights_of_servo(g.control.loader, g.substep_s)


def _push(g: Given) -> float:
    loader = g.control.loader
    return loader.bend if loader.bend_push is None else loader.bend_push


def _mode(g: Given) -> NDArray[np.float64]:
    loader = g.control.loader
    if loader.bend_frequency == 0.0:
        return np.zeros((2, 4))
    omega = 2.0 * math.pi * loader.bend_frequency
    return _weights(omega, loader.bend_damping_ratio, g.substep_s)


_weights = lru_cache(maxsize=64)(servo_weights)


LINKAGE = Declaration(
    layout(
        LinkageParameters,
        **dict.fromkeys(("position", "speed", "mode_position", "mode_speed"), (4,)),
        curve=SHAPE,
    ),
    section="control.loader",
    derived={
        "held": lambda g: g.control.drive == "setpoint",
        "delay_substeps": lambda g: g.control.loader.servo_delay / g.substep_s,
        "position": lambda g: _servo(g)[0],
        "speed": lambda g: _servo(g)[1],
        "rate_limit": lambda g: g.control.loader.servo_rate_limit,
        "acceleration_limit": lambda g: g.control.loader.servo_acceleration_limit,
        "push": _push,
        "curve_nodes": lambda g: count_of(g.control.loader.bend_curve),
        "curve": lambda g: table_of(g.control.loader.bend_curve),
        "share": lambda g: g.control.loader.bend_hysteresis_share,
        "width": lambda g: g.control.loader.bend_hysteresis_width,
        "modal": lambda g: g.control.loader.bend_frequency > 0.0,
        "mode_position": lambda g: _mode(g)[0],
        "mode_speed": lambda g: _mode(g)[1],
        "contact": lambda g: g.control.loader.play_stiffness,
        "carries": lambda g: any(
            (
                g.control.loader.bend_hysteresis_share,
                g.control.loader.bend_frequency,
                g.control.loader.play_stiffness,
            )
        ),
        "arc_length": lambda g: g.control.length if g.control.loader.arc_geometry else 0.0,
    },
    state=layout(LinkageState, history=(DELAY_SLOTS,)),
)


@stage
def move_linkage(
    p: LinkageParameters, s: LinkageState, computed_before: float, computed: float, h: float
) -> None:
    """Advance servo and backlash over a substep of h seconds for a given motion of δc, d."""
    before, after = commanded(p, s, computed_before, computed)
    a, b = p.position, p.speed
    x, v = s.position, s.rate
    s.position = a[0] * x + a[1] * v + a[2] * before + a[3] * after
    s.rate = b[0] * x + b[1] * v + b[2] * before + b[3] * after
    if p.acceleration_limit > 0.0 and abs(s.rate - v) > p.acceleration_limit * h:
        s.rate = v + math.copysign(p.acceleration_limit * h, s.rate - v)
        s.position = x + 0.5 * (v + s.rate) * h
    if p.rate_limit > 0.0:
        s.rate = min(max(s.rate, -p.rate_limit), p.rate_limit)
        step = p.rate_limit * h
        s.position = min(max(s.position, x - step), x + step)
    if abs(s.position) < TINY and abs(s.rate) < TINY:
        s.position = s.rate = 0.0
    if p.contact > 0.0:
        s.grip = s.position + s.touch
        return
    half = 0.5 * p.play
    s.grip = min(max(s.grip, s.position - half), s.position + half)


@stage
def bend(p: LinkageParameters, force: float) -> float:
    """Return the structure's bend in d under a force in N: K·F of eq. (1), with its saturation."""
    if p.curve_nodes > 0:
        return _plain_bend(p, force) + along(p.curve, p.curve_nodes, force)
    return _plain_bend(p, force)


@stage
def _plain_bend(p: LinkageParameters, force: float) -> float:
    """Return the bend without its curve, d."""
    compliance = p.bend if force >= 0.0 else p.push
    if p.bend_limit > 0.0:
        return p.bend_limit * math.tanh(compliance * force / p.bend_limit)
    return compliance * force


@stage
def bend_slope(p: LinkageParameters, force: float) -> float:
    """Return the bend's derivative by force, d/N.

    With hysteresis it is that of the whole bend, the largest slope, so that a hand that takes it
    implicitly does not overshoot. A structure with mass does not bend at once.
    """
    return 0.0 if p.modal else static_slope(p, force)


@stage
def static_slope(p: LinkageParameters, force: float) -> float:
    """Return the derivative of `bend` by the force, d/N, of a structure at rest."""
    compliance = p.bend if force >= 0.0 else p.push
    if p.bend_limit > 0.0:
        compliance /= math.cosh(compliance * force / p.bend_limit) ** 2
    if p.curve_nodes > 0:
        compliance += slope_along(p.curve, p.curve_nodes, force)
    return compliance


@stage
def contact_displacement(p: LinkageParameters, force: float) -> float:
    """Return the displacement of the grip from the servo by a force in N in a soft backlash, d.

    At rest: half of the play, and the deflection of its contact, sgn(F)·play/2 + F/k; 0 for a rigid
    contact, behind which the servo moves the grip.
    """
    if p.contact == 0.0 or force == 0.0:
        return 0.0
    return math.copysign(0.5 * p.play, force) + force / p.contact


@stage
def start_bend(p: LinkageParameters, s: LinkageState, force: float) -> None:
    """Start at rest under the force at the first node, N."""
    half = 0.5 * p.width
    s.carried = min(max(s.carried, force - half), force + half)
    s.mode_input = s.bent = still(p, s, force)


@stage
def advance_memory(p: LinkageParameters, s: LinkageState, force: float, h: float) -> None:
    """Advance the parts with a memory of the force to a node, h seconds after the last; N."""
    if p.contact > 0.0:
        _move_in_backlash(p, s, force, h)
    half = 0.5 * p.width
    s.carried = min(max(s.carried, force - half), force + half)
    if p.modal:
        a, b, y, v = p.mode_position, p.mode_speed, s.bent, s.bent_rate
        before, s.mode_input = s.mode_input, still(p, s, force)
        s.bent = a[0] * y + a[1] * v + a[2] * before + a[3] * s.mode_input
        s.bent_rate = b[0] * y + b[1] * v + b[2] * before + b[3] * s.mode_input
        if abs(s.bent) < TINY and abs(s.bent_rate) < TINY:
            s.bent = s.bent_rate = 0.0


@stage
def _move_in_backlash(p: LinkageParameters, s: LinkageState, force: float, h: float) -> None:
    """Move the grip in its backlash by the force, N, until the contact holds it."""
    half, z = 0.5 * p.play, s.touch
    yields = force / p.contact
    if abs(z) < half:  # only the damper acts
        s.touch = z + yields * h / CONTACT_s
    else:
        rests = (half if z > 0.0 else -half) + yields
        s.touch = rests + (z - rests) * math.exp(-h / CONTACT_s)
    s.grip = s.position + s.touch


@stage
def still(p: LinkageParameters, s: LinkageState, force: float) -> float:
    """Return the static bend under a force in N, d."""
    bent = bend(p, force)
    if p.share > 0.0:
        half = 0.5 * p.width
        carried = min(max(s.carried, force - half), force + half)
        bent += p.share * (bend(p, carried) - bent)
    return bent


@stage
def deflection(p: LinkageParameters, s: LinkageState, force: float) -> float:
    """Return the true deflection δ at the grip in d under a force in N."""
    return s.grip + (s.bent if p.modal else still(p, s, force)) + s.others


@stage
def transducer(p: LinkageParameters, true: float) -> float:
    """Return the transducer's reading of a true deflection, d: eqs. (15), (16)."""
    if p.arc_length > 0.0:
        return p.arc_length * math.sin(true / p.arc_length)
    return true
