"""Loader: the electronics' mass-spring-damper, from the pilot's force to δc.

    m·δc'' + c·δc' + friction·sgn(δc') + breakout·sgn(δc) + G_B·δc + k₃·δc³ + F_mod
        = F(t − delay) + F_offset − b·(n_z − 1),      |δc| ≤ travel, inelastic stops

Friction, breakout and the stops are set-valued: each holds the control still with
whatever force that takes, up to its limit. They are integrated as what they are, not
smoothed: between two events (the control comes to rest, passes neutral, meets a
stop) the equation is smooth and is stepped by the implicit midpoint rule, A-stable
and of second order; an event inside a substep is located, and the rest of the substep
goes on from there. So the order is kept through stick, slip and impact, and a
control inside its friction band does not creep.

The hardening spring enters by its slope at the midpoint (one Newton step), which
keeps the order.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout, stage
from coupled.rig.friction import FrictionParameters, running_friction
from coupled.rig.modification import ModificationState, slope, smooth_force

DELAY_SLOTS = 1024  # force history, in substeps; a power of two
MAX_EVENTS = 16  # events in one substep before the control is taken to be at rest


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


class LoaderState(Protocol):
    """Where the computed control is."""

    computed: float  # δc, d
    rate: float  # δc', d/s
    external: float  # F_offset − b·(n_z − 1), N, held over the frame
    delayed: float  # the pilot's force as the loader has it, N
    node: int  # substeps since the start
    stop: int  # the stop met during this frame: −1, 0 or +1
    history: NDArray[np.float64]  # the pilot's force at past nodes, N


LOADER_PARAMETERS = layout(LoaderParameters)
LOADER_STATE = layout(LoaderState, history=(DELAY_SLOTS,))


@stage
def set_external(p: LoaderParameters, s: LoaderState, load_factor: float) -> None:
    """Set the forces that hold over a frame; load factor is +1 in level flight."""
    s.external = p.offset - p.bob_weight * (load_factor - 1.0)


@stage
def start_delay(p: LoaderParameters, s: LoaderState, force: float) -> None:
    """Begin with the pilot's force at the first node, N, and none before it."""
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
def _elastic(p: LoaderParameters, m: ModificationState, x: float) -> float:
    """Return the smooth part of the force that opposes δc = x, N."""
    force = (p.basic_gradient + p.cubic * x * x) * x
    return force + (m.held if p.digital else smooth_force(m, x))


@stage
def _stiffness(p: LoaderParameters, m: ModificationState, x: float) -> float:
    """Return the slope of `_elastic`, N/d."""
    stiffness = p.basic_gradient + 3.0 * p.cubic * x * x
    return stiffness if p.digital else stiffness + slope(m, x)


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
def move_loader(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    force: float,
    h: float,
) -> None:
    """Advance δc over a substep of h seconds to a node where the pilot's force is `force` N."""
    before = s.delayed
    after = _delay(p, s, force)
    s.delayed = after
    breakout = p.breakout + (0.0 if p.digital else m.breakout)
    dry = friction.breakaway > 0.0
    done = 0.0
    for _ in range(MAX_EVENTS):
        left = h - done
        x, v = s.computed, s.rate
        pull = before + (after - before) * (done + 0.5 * left) / h + s.external

        side = _sign(x)
        if v == 0.0:
            # At rest: friction, breakout (at neutral) and a stop hold what they can.
            net = pull - _elastic(p, m, x) - breakout * side
            hold = friction.breakaway + (breakout if side == 0.0 else 0.0)
            if abs(net) <= hold or (abs(x) >= p.travel and net * x > 0.0):
                s.stop = int(side) if abs(x) >= p.travel and net * x > 0.0 else s.stop
                return
            sliding = _sign(net)
        else:
            sliding = _sign(v)
        if side == 0.0:
            side = sliding

        # One midpoint step over what is left, as if nothing happened on the way.
        rest = pull - p.damping * v - breakout * side
        middle = x + 0.5 * left * v
        stiffness = _stiffness(p, m, middle)
        inertia = 2.0 * p.mass / left + p.damping + 0.5 * left * stiffness
        rest -= _elastic(p, m, middle)
        change = rest / inertia
        if dry:
            drag = running_friction(friction, v + change)
            change = (rest - drag * sliding) / inertia
            if friction.breakaway > friction.running:
                drag = running_friction(friction, v + change)
                change = (rest - drag * sliding) / inertia
        v1 = v + 2.0 * change
        x1 = x + left * (v + change)
        acceleration = 2.0 * change / left

        # The first event on the way, if any.
        span, event = left, 0
        if dry and v != 0.0 and v1 * sliding < 0.0:
            span, event = left * v / (v - v1), 1
        end = x1 if event == 0 else x + 0.5 * span * v
        if abs(end) > p.travel:
            limit = p.travel if end > 0.0 else -p.travel
            span, event = _crossing(x, v, acceleration, limit, span), 2
            end = limit
        if breakout > 0.0 and x * end < 0.0:
            span, event = _crossing(x, v, acceleration, 0.0, span), 3

        if event == 0:
            s.computed, s.rate = x1, v1
            return
        done += span
        if event == 1:
            s.computed, s.rate = x + 0.5 * span * v, 0.0
        elif event == 2:
            s.computed, s.rate = limit, 0.0
            s.stop = 1 if limit > 0.0 else -1
        else:
            # At neutral: the preload stops a control too slow to leave it within the substep.
            s.computed, s.rate = 0.0, v + acceleration * span
            spare = friction.running + breakout - abs(pull - _elastic(p, m, 0.0))
            if p.mass * abs(s.rate) <= (h - done) * spare:
                s.rate = 0.0
        if h - done <= 1e-12 * h:
            return
    s.rate = 0.0
