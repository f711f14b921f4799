"""Services: functions of a control loader beside gradient and breakout, and their failures.

    trim         springs and F_mod act about x₀, set by force trim; a trim release sets x₀ = δc,
                 and keeps −k_r·(δc − x_r) − c_r·δc', x_r being x₀ as the release begins
    autopilot    F_a = k·(x_a − δc) − c·δc', within ±override: the backdrive of a hand's override
    other side   m₂·y'' + c₂·y' + G₂·(y − x₀) = F₂ + F_l,    F_l = k_l·(δc − y) + c_l·(δc' − y'),
                 until it is disconnected; it moves a share of the surface by y
    jam          δc is fixed, and so is its part of the surface
    shaker       A·sin(2π·f·t)
    pusher       −P, fading in and out over its rise
    hinge        −q̄·(h_α·(α − α₀) + h_δ·surface)
    soft stop    −k·(|δc| − s) beyond s, and a damping on the way out
    envelope     −e·(n_z − n) above n, and e'·(n' − n_z) below n'
    failed feel  G_T·(1 − lost), eqs. (6) to (12) with the rest

Forces act on the loader in addition to the pilot's, positive in the direction of a pull. Those of
the host (pusher, hinge, envelope) are held over a frame, the others follow the motion at each node.
Shaker and pusher act on command, or from an angle of attack on. The commands of a flight are in the
state, 0 at its start; `serving` sets them, for a run's events and for a page. A rig without
services skips the stage.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout, seldom, stage
from coupled.rig.declaration import Declaration, Ends
from coupled.rig.loader import LoaderParameters, LoaderState
from coupled.rig.modification import ModificationState
from coupled.rig.parameters import Services
from coupled.rig.springs import elastic

# The recorded channels of each control with services, in this order; d is its unit.
SERVICE_CHANNELS = (
    "trim_{d}",
    "service_force_N",
    "autopilot",
    "disconnected",
    "jammed",
    "shaker",
    "pusher",
    "feel_lost",
    "other_{d}",
    "link_force_N",
    "asked_{d}",
)


class ServicesParameters(Protocol):
    """The services' parameters; d is m, or rad for a wheel. 0 leaves one out."""

    present: int  # the rig file has some
    frame: float  # s
    pull: float  # travel to the positive side, d
    push: float  # and to the negative, as a size
    trim_release_gradient: float  # k_r, N/d
    trim_release_damping: float  # c_r, N·s/d
    autopilot_stiffness: float  # N/d
    autopilot_damping: float  # N·s/d
    override: float  # largest force of the backdrive, N
    override_time: float  # duration of an override that disconnects it, s; 0 for never
    other_mass: float  # of the other side's control, kg (N per d/s²)
    other_damping: float  # N·s/d
    other_gradient: float  # N/d
    other_share: float  # of the surface moved by it
    link_stiffness: float  # N/d
    link_damping: float  # N·s/d
    disconnect: float  # force that opens the link, N; 0 for never
    jam_breaks: float  # force that breaks a jam, N; 0 for never
    shaker: float  # A, N
    shaker_frequency: float  # Hz
    shaker_alpha: float  # rad; 0 for none
    pusher: float  # P, N
    pusher_rise: float  # s
    pusher_alpha: float  # rad; 0 for none
    hinge_alpha: float  # N/(Pa·rad)
    hinge_surface: float  # N/Pa at the whole surface
    soft_stop: float  # d
    soft_stop_stiffness: float  # N/d
    soft_stop_damping: float  # N·s/d
    envelope_above: float  # n, g
    envelope: float  # e, N/g
    envelope_below: float  # n', g
    envelope_push: float  # e', N/g


class ServicesState(Protocol):
    """The commands, 0 or 1 unless a unit is given, and the resulting state."""

    on: int  # a rig file or an event requires the stage
    trim_release: float
    autopilot: float
    autopilot_at: float  # x_a, d
    disconnected: float
    jammed: float
    other_jammed: float
    shaker: float
    pusher: float
    feel_lost: float  # share of G_T
    other_force: float  # F₂, N
    released: int  # the trim has been released
    released_at: float  # x_r, d
    started: int
    alpha: float  # α₀, rad
    base: float  # the loader's own external force, N
    slow: float  # forces held over the frame, N
    force: float  # total force of the services at the last node, N
    shaking: int
    time: float  # duration of the shaking, s
    pushing: float  # share of the pusher's force
    over: float  # duration of a hand force above the override, s
    stuck: int  # the jam is active
    stuck_at: float  # δc there, d
    held: float  # δ̂ there, d
    other: float  # y, d
    other_rate: float  # d/s
    link: float  # F_l, N
    asked: float  # command of the surface, d
    row: NDArray[np.float64]  # the recorded values


SERVICES = Declaration(
    layout(ServicesParameters),
    section="control.services",
    derived={
        "present": lambda g: g.control.services != Services(),
        "frame": lambda g: g.frame_s,
        "pull": lambda g: g.control.pull,
        "push": lambda g: g.control.push,
    },
    state=layout(ServicesState, row=(len(SERVICE_CHANNELS),)),
    fixed=(
        *(
            "trim_release",
            "autopilot",
            "disconnected",
            "jammed",
            "other_jammed",
            "shaker",
            "pusher",
        ),
        *("feel_lost", "alpha", "time", "pushing", "over", "row"),
    ),
)


@seldom
def begin_services(
    p: ServicesParameters,
    s: ServicesState,
    pressure: float,
    load_factor: float,
    alpha: float,
) -> None:
    """Set the host's forces for a frame: q̄ in Pa, n_z in g and α in rad are those at t_k."""
    if s.started == 0:
        s.alpha, s.started = alpha, 1
    pushed = s.pusher > 0.5 or (p.pusher_alpha > 0.0 and alpha >= p.pusher_alpha)
    step = p.frame / p.pusher_rise if p.pusher_rise > p.frame else 1.0
    s.pushing = min(s.pushing + step, 1.0) if pushed else max(s.pushing - step, 0.0)
    s.shaking = s.shaker > 0.5 or (p.shaker_alpha > 0.0 and alpha >= p.shaker_alpha)
    if s.shaking == 0:
        s.time = 0.0
    surface = s.asked / (p.pull if s.asked > 0.0 else p.push)
    s.slow = -p.pusher * s.pushing
    s.slow -= pressure * (p.hinge_alpha * (alpha - s.alpha) + p.hinge_surface * surface)
    if p.envelope > 0.0:
        s.slow -= p.envelope * max(load_factor - p.envelope_above, 0.0)
    if p.envelope_push > 0.0:
        s.slow += p.envelope_push * max(p.envelope_below - load_factor, 0.0)


@stage
def set_base(s: ServicesState, loader: LoaderState) -> None:
    """Store the loader's own external force of a frame, and add the host's to it."""
    s.base = loader.external
    loader.external = s.base + s.slow


@stage
def _release(p: ServicesParameters, s: ServicesState, loader: LoaderState) -> float:
    """Let the neutral follow the control while the trim is released; return what is kept, N."""
    x, loader.loose = loader.computed, s.trim_release > 0.5
    if not loader.loose:
        s.released = 0
        return 0.0
    if s.released == 0:
        s.released, s.released_at = 1, loader.neutral
    loader.neutral = x
    kept = p.trim_release_gradient * (x - s.released_at)
    return -kept - p.trim_release_damping * loader.rate


@stage
def _backdrive(
    p: ServicesParameters, s: ServicesState, x: float, v: float, hand: float, h: float
) -> float:
    """Return the autopilot's force, N; a long enough override by the hand disconnects it."""
    if s.autopilot <= 0.5 or p.override == 0.0:
        s.over = 0.0
        return 0.0
    s.over = s.over + h if abs(hand) > p.override else 0.0
    if 0.0 < p.override_time <= s.over:
        s.autopilot = 0.0
    wanted = p.autopilot_stiffness * (s.autopilot_at - x) - p.autopilot_damping * v
    return min(max(wanted, -p.override), p.override)


@stage
def soft_stop_force(p: ServicesParameters, x: float, v: float) -> float:
    """Return the soft stop's force, N."""
    beyond = abs(x) - p.soft_stop
    if p.soft_stop == 0.0 or beyond <= 0.0:
        return 0.0
    side = 1.0 if x > 0.0 else -1.0
    return -side * (p.soft_stop_stiffness * beyond + p.soft_stop_damping * max(side * v, 0.0))


@stage
def _move_other(p: ServicesParameters, s: ServicesState, loader: LoaderState, h: float) -> None:
    """Advance the other side over a substep, and set the link's force."""
    s.link = p.link_stiffness * (loader.computed - s.other)
    s.link += p.link_damping * (loader.rate - s.other_rate)
    if 0.0 < p.disconnect < abs(s.link):
        s.disconnected = 1.0
    if s.disconnected > 0.5:
        s.link = 0.0
    if s.other_jammed > 0.5:
        s.other_rate = 0.0
        return
    force = s.other_force + s.link - p.other_damping * s.other_rate
    force -= p.other_gradient * (s.other - loader.neutral)
    s.other_rate += h * force / p.other_mass
    s.other += h * s.other_rate
    if s.other > p.pull or s.other < -p.push:
        s.other = min(max(s.other, -p.push), p.pull)
        s.other_rate = 0.0


@stage
def _jam(
    p: ServicesParameters,
    s: ServicesState,
    loader_p: LoaderParameters,
    loader: LoaderState,
    m: ModificationState,
    hand: float,
) -> bool:
    """Tell whether a jam holds the control in this substep."""
    if s.jammed <= 0.5:
        s.stuck = 0
        return False
    if s.stuck == 0:
        s.stuck, s.stuck_at, s.held = 1, loader.computed, s.asked
    if p.jam_breaks > 0.0:
        at = loader.computed - loader.neutral
        if abs(hand + loader.external - elastic(loader_p, m, loader, at)) > p.jam_breaks:
            s.jammed, s.stuck = 0.0, 0
            return False
    return True


@seldom
def serve(
    p: ServicesParameters,
    s: ServicesState,
    loader_p: LoaderParameters,
    loader: LoaderState,
    m: ModificationState,
    hand: float,
    ends: Ends,
    h: float,
) -> Ends:
    """Set the services' force for a substep of h seconds; return the range of δc, d.

    `hand` is the pilot's force at the substep's end, N, `ends` the range without services.
    """
    x, v = loader.computed, loader.rate
    s.force = _release(p, s, loader)
    s.force += s.slow + _backdrive(p, s, x, v, hand, h) + soft_stop_force(p, x, v)
    if s.shaking:
        s.force += p.shaker * math.sin(2.0 * math.pi * p.shaker_frequency * s.time)
        s.time += h
    if p.other_mass > 0.0:
        _move_other(p, s, loader, h)
        s.force -= s.link
    loader.external = s.base + s.force
    if _jam(p, s, loader_p, loader, m, hand):
        return s.stuck_at, s.stuck_at
    return ends


@stage
def commanded_deflection(p: ServicesParameters, s: ServicesState, estimated: float) -> float:
    """Return the command of the surface, d, for the host's estimate δ̂."""
    own = s.held if s.stuck else estimated
    s.asked = own
    if p.other_share > 0.0:
        s.asked = (1.0 - p.other_share) * own + p.other_share * s.other
    return s.asked


@seldom
def note_services(s: ServicesState, loader: LoaderState) -> None:
    """Write the recorded values at t_k, in the order of `SERVICE_CHANNELS`."""
    row = s.row
    row[0], row[1], row[2], row[3] = loader.neutral, s.force, s.autopilot, s.disconnected
    row[4], row[5], row[6], row[7] = s.jammed, float(s.shaking), s.pushing, s.feel_lost
    row[8], row[9], row[10] = s.other, s.link, s.asked
