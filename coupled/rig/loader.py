"""Loader: the electronics' mass-spring-damper, from the pilot's force to δc.

    m·δc'' + c·δc' + friction·sgn(δc') + breakout·sgn(δc) + G_B·δc + k₃·δc³ + F_mod
        = F(t − delay) + F_offset − b·(n_z − 1),      |δc| ≤ travel, inelastic stops

Friction, breakout and the stops are set-valued: each holds the control still with
whatever force that takes, up to its limit. They are integrated as what they are, not
smoothed: between two events (the control comes to rest, passes neutral, meets a
stop) the equation is smooth and is stepped by the implicit midpoint rule, A-stable
and of second order; an event inside a substep is located, and the rest of the substep
goes on from there. So the order is kept through stick, slip and impact, and a
control inside its friction band does not creep. A friction whose contact yields is no
event, but a force that depends on the way (`friction`).

The hardening spring enters by its slope at the midpoint (one Newton step), which
keeps the order. An F_mod that lags, τ·y' = F_mod − y, is advanced by half a substep before the
motion and half a substep after it (Strang's splitting), each exactly: of second order, too.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, Ends, Given, first_order_gain
from coupled.rig.friction import FrictionParameters, bent_after, rubbing_speed
from coupled.rig.modification import ModificationState, modifying_force, slope, smooth_force
from coupled.rig.parameters import DELAY_SLOTS

MAX_EVENTS = 16  # events in one substep before the control is taken to be at rest
NOTHING, REST, STOP, NEUTRAL = 0, 1, 2, 3  # what may end a smooth stretch


class LoaderParameters(Protocol):
    """The electronics' settings; d is m, or rad for a wheel."""

    mass: float  # m, kg (N per d/s²)
    damping: float  # c, N·s/d
    basic_gradient: float  # G_B, N/d
    cubic: float  # k₃, N/d³
    breakout: float  # F_BO, N
    bob_weight: float  # b, N per g
    offset: float  # F_offset, N, with the pilot's force
    delay_substeps: float  # transport delay over the substep
    travel: float  # stops at ±travel, d
    digital: int  # F_mod is held over the frame
    lag_gain: float  # share that F_mod's lag goes in half a substep; 0 without lag
    held: int  # F_mod does not follow δc within a substep: it is digital, or lags


class LoaderState(Protocol):
    """Where the computed control is."""

    computed: float  # δc, d
    rate: float  # δc', d/s
    mass: float  # m as it now is, kg: the file's, or by the gradient (`inertia`)
    damping: float  # c as it now is, N·s/d
    bent: float  # by how much a friction's contact has yielded, d
    external: float  # F_offset − b·(n_z − 1), N, held over the frame
    delayed: float  # the pilot's force as the loader has it, N
    felt: float  # F_mod as the loader feels it where it is held, N
    node: int  # substeps since the start
    stop: int  # the stop met during this frame: −1, 0 or +1
    history: NDArray[np.float64]  # the pilot's force at past nodes, N


def _half_step_gain(given: Given) -> float:
    """Return the share that F_mod's lag goes in half a substep, 0 where it has none."""
    lag_s = given.control.loader.modifying_lag
    return first_order_gain(lag_s, 0.5 * given.substep_s) if lag_s > 0.0 else 0.0


LOADER = Declaration(
    layout(LoaderParameters),
    section="control.loader",
    derived={
        "delay_substeps": lambda g: g.control.loader.delay / g.substep_s,
        "travel": lambda g: g.control.travel,
        "digital": lambda g: g.control.loader.multiplier == "digital",
        "lag_gain": _half_step_gain,
        "held": lambda g: g.control.loader.multiplier == "digital" or _half_step_gain(g) > 0.0,
    },
    state=layout(LoaderState, history=(DELAY_SLOTS,)),
    fixed=("external", "mass", "damping"),
)


@stage
def set_external(p: LoaderParameters, s: LoaderState, load_factor: float) -> None:
    """Set the forces that hold over a frame; load factor is +1 in level flight."""
    s.external = p.offset - p.bob_weight * (load_factor - 1.0)


@stage
def start_delay(p: LoaderParameters, s: LoaderState, force: float) -> None:
    """Begin at rest with the pilot's force at the first node, N, and none before it."""
    s.mass, s.damping = p.mass, p.damping
    s.history[0] = force
    s.delayed = force if p.delay_substeps == 0.0 else 0.0


@stage
def _delay(p: LoaderParameters, s: LoaderState, force: float) -> float:
    """Return the force at the next node, N, as the loader gets it."""
    s.node += 1
    if p.delay_substeps == 0.0:
        return force
    s.history[s.node & (DELAY_SLOTS - 1)] = force
    whole = int(p.delay_substeps)
    share = p.delay_substeps - whole
    late = s.history[(s.node - whole) & (DELAY_SLOTS - 1)] if s.node >= whole else 0.0
    later = s.history[(s.node - whole - 1) & (DELAY_SLOTS - 1)] if s.node > whole else 0.0
    return (1.0 - share) * late + share * later


@stage
def _elastic(p: LoaderParameters, m: ModificationState, s: LoaderState, x: float) -> float:
    """Return the smooth part of the force that opposes δc = x, N: F_L of eq. (8), and F_mod."""
    force = (p.basic_gradient + p.cubic * x * x) * x
    return force + (s.felt if p.held else smooth_force(m, x))


@stage
def _stiffness(p: LoaderParameters, m: ModificationState, x: float) -> float:
    """Return the slope of `_elastic`, N/d."""
    stiffness = p.basic_gradient + 3.0 * p.cubic * x * x
    return stiffness if p.held else stiffness + slope(m, x)


@stage
def _sign(x: float) -> float:
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@stage
def _crossing(x0: float, v0: float, acceleration: float, target: float, span: float) -> float:
    """Return the first time in (0, span] at which x0 + v0·t + a·t²/2 meets `target`."""
    gap = target - x0
    root = v0 * v0 + 2.0 * acceleration * gap
    speed = math.sqrt(root) if root > 0.0 else 0.0
    denominator = v0 + (speed if gap > 0.0 else -speed)
    time = 2.0 * gap / denominator if denominator != 0.0 else span
    return min(max(time, 0.0), span)


@stage
def _release(
    p: LoaderParameters, s: LoaderState, hold: float, start: float, end: float, ends: Ends
) -> tuple[float, float]:
    """Return when a control at rest begins to slide, as a share of the way, and to which side.

    `start` and `end` are the net force on it at either end, N, which runs straight between;
    `hold` is what friction, and at neutral the breakout, can hold. Side 0: it stays.
    """
    if s.computed >= ends[1] and start >= 0.0 and end >= 0.0:
        s.stop = 1 if end > hold and s.computed >= p.travel else s.stop
        return 0.0, 0.0
    if s.computed <= ends[0] and start <= 0.0 and end <= 0.0:
        s.stop = -1 if end < -hold and s.computed <= -p.travel else s.stop
        return 0.0, 0.0
    if abs(start) > hold:
        return 0.0, _sign(start)
    if abs(end) <= hold:
        return 0.0, 0.0
    side = _sign(end)
    return (side * hold - start) / (end - start), side


@stage
def _midpoint(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    push: float,
    direction: float,
    span: float,
) -> float:
    """Return δc' at the middle of a step of `span` seconds in which nothing happens, d/s.

    `push` is the force that does not depend on the motion, N.
    """
    v = s.rate
    middle = s.computed + 0.5 * span * v
    inertia = 2.0 * s.mass / span + s.damping + 0.5 * span * _stiffness(p, m, middle)
    push -= _elastic(p, m, s, middle) + s.damping * v
    return rubbing_speed(friction, s.bent, v, push, direction, inertia, span)


@stage
def _first_event(
    s: LoaderState, dry: bool, breakout: float, halfway: float, span: float, ends: Ends
) -> tuple[float, int]:
    """Return when a step of `span` seconds first meets an event, and which."""
    x, v = s.computed, s.rate
    acceleration = 2.0 * (halfway - v) / span
    end, event = x + span * halfway, NOTHING
    if dry and v != 0.0 and v * (v + span * acceleration) < 0.0:
        span, event = -v / acceleration, REST
        end = x + 0.5 * span * v
    if end > ends[1] or end < ends[0]:
        end = ends[1] if end > ends[1] else ends[0]
        span, event = _crossing(x, v, acceleration, end, span), STOP
    if breakout > 0.0 and x * end < 0.0:
        span, event = _crossing(x, v, acceleration, 0.0, span), NEUTRAL
    return span, event


@stage
def _feel(p: LoaderParameters, m: ModificationState, s: LoaderState) -> None:
    """Let a held F_mod reach the loader: at once, or half a substep on through its lag."""
    wanted = m.held if p.digital else modifying_force(m, s.computed)
    if p.lag_gain > 0.0:
        wanted = s.felt + p.lag_gain * (wanted - s.felt)
    s.felt = wanted


@stage
def _move(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    force: float,
    ends: Ends,
    h: float,
) -> None:
    """Advance δc over a substep of h seconds with a held F_mod as it is felt."""
    before = s.delayed
    after = _delay(p, s, force)
    s.delayed = after
    breakout = p.breakout + (0.0 if p.held else m.breakout)
    dry = friction.breakaway > 0.0 and friction.stiffness == 0.0
    done = 0.0
    for _ in range(MAX_EVENTS):
        x, v = s.computed, s.rate
        direction = _sign(v)
        if v == 0.0:
            hold = (friction.breakaway if dry else 0.0) + (breakout if x == 0.0 else 0.0)
            balance = s.external - breakout * _sign(x) - _elastic(p, m, s, x)
            balance -= friction.stiffness * s.bent
            start = before + (after - before) * done / h + balance
            share, direction = _release(p, s, hold, start, after + balance, ends)
            if direction == 0.0:
                return
            done += share * (h - done)
        left = h - done
        if left <= 1e-12 * h:
            return
        pull = before + (after - before) * (done + 0.5 * left) / h + s.external
        net = pull - breakout * _sign(x)
        if x == 0.0:
            net -= breakout * direction
        halfway = _midpoint(p, friction, m, s, net, direction, left)
        span, event = _first_event(s, dry, breakout, halfway, left, ends)
        acceleration = 2.0 * (halfway - v) / left
        s.computed = x + span * (v + 0.5 * acceleration * span)
        s.rate = v + acceleration * span
        s.bent = bent_after(friction, s.bent, halfway, s.computed - x)
        if event == NOTHING:
            if abs(s.computed) < TINY and abs(s.rate) < TINY:
                s.computed = s.rate = 0.0
            return
        done += span
        if event == REST:
            s.rate = 0.0
        elif event == STOP:
            above = s.computed - ends[0] > ends[1] - s.computed
            s.computed, s.rate = ends[1] if above else ends[0], 0.0
            if abs(s.computed) == p.travel:
                s.stop = 1 if above else -1
        else:  # the preload stops a control too slow to leave neutral within the substep
            s.computed = 0.0
            hold = (friction.running if dry else 0.0) + breakout
            surplus = hold - abs(pull - friction.stiffness * s.bent - _elastic(p, m, s, 0.0))
            if s.mass * abs(s.rate) <= (h - done) * surplus:
                s.rate = 0.0
    s.rate = 0.0


@stage
def move_loader(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    force: float,
    ends: Ends,
    h: float,
) -> None:
    """Advance δc, between its `ends`, over h seconds to where the pilot's force is `force` N."""
    if p.held:
        _feel(p, m, s)
    _move(p, friction, m, s, force, ends, h)
    if p.lag_gain > 0.0:
        _feel(p, m, s)
