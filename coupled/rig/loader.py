"""Loader: the electronics' mass-spring-damper, from the pilot's force to δc.

    m·δc'' + c·δc' + friction·sgn(δc') + breakout·sgn(δc) + springs(δc) + F_mod
        = F(t − delay) + F_offset + a·(r − r₀) − b·(n_z − 1)

within inelastic stops, −forward ≤ δc ≤ aft. r is a channel of a record, such as a temperature; in a
flight it is r₀.

F is the pilot's force, plus a share of that on another control by crosstalk (`crossing`).

The springs, G_B·δc + k₃·δc³ and others, are in `springs`, the laws of friction in `friction`. A
trim moves the neutral about which springs, breakout and F_mod act (`services`).

Friction, breakout and the stops are set-valued: each holds the control still with any force up to
its limit. They are integrated without smoothing. Between two events (the control comes to rest,
passes neutral, meets a stop) the equation is smooth and is stepped by the implicit midpoint rule,
A-stable and of second order. An event inside a substep is located, and the rest of the substep
continues from there. So the order is kept through stick, slip and impact, and a control inside its
friction band does not creep. Presliding friction is not an event but a force that depends on the
displacement.

The springs enter by their slope at the midpoint (one Newton step), which keeps the order. A lag of
F_mod, τ·y' = F_mod − y, is advanced exactly by half a substep before the motion and half a substep
after it (Strang splitting), also of second order.
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, Ends
from coupled.rig.delay import DelayParameters, DelayState, delayed, start_delay
from coupled.rig.events import NOTHING, REST, STOP, first_event, sign
from coupled.rig.friction import (
    FrictionParameters,
    added_friction,
    deflect_bristles,
    sliding_speed,
    sliding_speed_along,
)
from coupled.rig.modification import ModificationState
from coupled.rig.parameters import DELAY_SLOTS
from coupled.rig.piecewise import SHAPE
from coupled.rig.springs import (
    DERIVED,
    SpringParameters,
    SpringState,
    apply_modification,
    elastic,
    relax,
    relaxed_after,
    relaxing_mean,
    stiffness,
)

MAX_EVENTS = 16  # events in one substep after which the control is taken to be at rest


class LoaderParameters(SpringParameters, DelayParameters, Protocol):
    """Parameters of the electronics beside the springs; d is m, or rad for a wheel."""

    mass: float  # m, kg (N per d/s²)
    damping: float  # c, N·s/d
    breakout: float  # F_BO, N
    bob_weight: float  # b, N per g
    offset: float  # F_offset, N, in the direction of the pilot's force
    by_regressor: float  # a, N for each unit of the regressor
    travel: float  # of the control to either side, d
    aft: float  # stop of δc on the positive side, d: the travel, or a stop within it
    forward: float  # and on the negative side, as a size


class LoaderState(SpringState, DelayState, Protocol):
    """The state of the computed control."""

    computed: float  # δc, d
    rate: float  # δc', d/s
    mass: float  # current m, kg: the file's, or by the gradient (`inertia`)
    damping: float  # current c, N·s/d
    load: float  # force on the loader, N, for friction that grows with it
    bent: float  # deflection of a friction's contact, d
    leaked: float  # crosstalk of another control's force, N, at the next node
    external: float  # F_offset + a·(r − r₀) − b·(n_z − 1), N, held over the frame
    loose: int  # the springs follow the control, without breakout
    stop: int  # the stop reached during this frame: −1, 0 or +1


LOADER = Declaration(
    layout(LoaderParameters, curve=SHAPE),
    section="control.loader",
    derived=DERIVED
    | {
        "delay_substeps": lambda g: g.control.loader.delay / g.substep_s,
        "by_regressor": lambda g: g.control.loader.regressor_force,
        "travel": lambda g: g.control.travel,
        "aft": lambda g: g.control.stop_to(1.0),
        "forward": lambda g: g.control.stop_to(-1.0),
    },
    state=layout(LoaderState, history=(DELAY_SLOTS,)),
    fixed=("external", "mass", "damping", "neutral"),
)


@stage
def set_external(p: LoaderParameters, s: LoaderState, load_factor: float) -> None:
    """Set the forces that are constant over a frame; load factor is +1 in level flight."""
    s.external = p.offset - p.bob_weight * (load_factor - 1.0)


@stage
def set_regressor(
    p: LoaderParameters, friction: FrictionParameters, s: LoaderState, away: float
) -> None:
    """Add the force of the regressor, and set its friction; `away` is r − r₀, in its unit."""
    s.external += p.by_regressor * away
    friction.regressed = friction.by_regressor * away


@stage
def start_loader(p: LoaderParameters, s: LoaderState, force: float) -> None:
    """Start at rest with the pilot's force at the first node, N, and none before it."""
    s.mass, s.damping = p.mass, p.damping
    start_delay(p, s, force + s.leaked, 0.0)


@stage
def _release(
    p: LoaderParameters, s: LoaderState, holds: Ends, start: float, end: float, ends: Ends
) -> tuple[float, float]:
    """Return when a control at rest begins to slide, as a share of the step, and its direction.

    `start` and `end` are the net force at either end, N, linear in between; `holds` is what
    friction, and at neutral the breakout, can hold to either side. Direction 0: it stays.
    """
    down, up = holds
    if s.computed >= ends[1] and start >= 0.0 and end >= 0.0:
        s.stop = 1 if end > up and s.computed >= p.aft else s.stop
        return 0.0, 0.0
    if s.computed <= ends[0] and start <= 0.0 and end <= 0.0:
        s.stop = -1 if end < down and s.computed <= -p.forward else s.stop
        return 0.0, 0.0
    if not down <= start <= up:
        return 0.0, sign(start)
    if down <= end <= up:
        return 0.0, 0.0
    side = 1.0 if end > up else -1.0
    return ((up if end > up else down) - start) / (end - start), side


@stage
def _holds(friction: FrictionParameters, s: LoaderState, breakout: float) -> Ends:
    """Return the least and the largest net force that a control at rest withstands, N."""
    preload = breakout if s.computed == s.neutral else 0.0
    if friction.rigid == 0:
        return -preload, preload
    down = friction.breakaway + added_friction(friction, s.load, -1.0) + preload
    return -down, friction.breakaway + added_friction(friction, s.load, 1.0) + preload


@stage
def _midpoint(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    push: float,
    direction: float,
    span: float,
) -> tuple[float, float]:
    """Return δc' at the middle of a step of `span` seconds without events, d/s.

    And the deflection of a friction's contact after it, d. `push` is the force that does not depend
    on the motion, N.
    """
    v = s.rate
    middle = s.computed + 0.5 * span * v - s.neutral
    inertia = 2.0 * s.mass / span + s.damping + 0.5 * span * stiffness(p, m, s, middle)
    push -= elastic(p, m, s, middle) + s.damping * v
    if p.relaxing > 0.0:
        kept, damping = relaxing_mean(p, s, span)
        inertia += damping
        push -= kept + damping * v
    if friction.rate_nodes > 0:
        return sliding_speed_along(friction, s.bent, v, push, direction, inertia, span, s.load)
    return sliding_speed(friction, s.bent, v, push, direction, inertia, span, s.load)


@stage
def _rest(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    breakout: float,
    pulls: Ends,
    left: float,
    ends: Ends,
) -> tuple[float, float]:
    """Return how long a control at rest stays so, s, and in which direction it then slides, or 0.

    `pulls` are the pilot's force at the beginning and the end of the `left` seconds, N.
    """
    at = s.computed - s.neutral
    balance = s.external - breakout * sign(at) - elastic(p, m, s, at)
    balance -= friction.stiffness * s.bent
    start, end = pulls[0] + balance, pulls[1] + balance
    if p.relaxing > 0.0:
        start, end = start - s.relaxed, end - relaxed_after(p, s, left)
    holds = _holds(friction, s, breakout)
    share, direction = _release(p, s, holds, start, end, ends)
    still = (share if direction != 0.0 else 1.0) * left
    if p.relaxing > 0.0:
        s.relaxed = relaxed_after(p, s, still)
    return still, direction


@stage
def _pass_neutral(
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    breakout: float,
    pull: float,
    left: float,
) -> None:
    """Stop a control at neutral if it is too slow to leave the breakout in `left` seconds."""
    s.computed = s.neutral
    hold = breakout
    if friction.rigid:
        hold += friction.running + added_friction(friction, s.load, s.rate)
    pull -= friction.stiffness * s.bent + s.relaxed
    surplus = hold - abs(pull - elastic(p, m, s, 0.0))
    if s.mass * abs(s.rate) <= left * surplus:
        s.rate = 0.0


@stage
def _strike(p: LoaderParameters, s: LoaderState, ends: Ends) -> None:
    """Stop at the end of travel that the control has reached."""
    above = s.computed - ends[0] > ends[1] - s.computed
    s.computed, s.rate = ends[1] if above else ends[0], 0.0
    if s.computed in (p.aft, -p.forward):
        s.stop = 1 if above else -1


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
    """Advance δc over a substep of h seconds with a constant F_mod."""
    before = s.delayed
    after = delayed(p, s, force)
    s.delayed = after
    breakout = 0.0 if s.loose else p.breakout + (0.0 if p.held else m.breakout)
    neutral = s.neutral
    if friction.varies:
        s.load = abs(0.5 * (before + after) + s.external)
    done = 0.0
    for _ in range(MAX_EVENTS):
        x, v = s.computed, s.rate
        direction = sign(v)
        if v == 0.0:
            pulls = (before + (after - before) * done / h, after)
            still, direction = _rest(p, friction, m, s, breakout, pulls, h - done, ends)
            if direction == 0.0:
                return
            done += still
        left = h - done
        if left <= 1e-12 * h:
            return
        pull = before + (after - before) * (done + 0.5 * left) / h + s.external
        net = pull - breakout * sign(x - neutral)
        if x == neutral:
            net -= breakout * direction
        halfway, bent = _midpoint(p, friction, m, s, net, direction, left)
        about = (ends[0] - neutral, ends[1] - neutral)
        dry = friction.rigid != 0
        span, event = first_event(x - neutral, v, dry, breakout, halfway, left, about)
        acceleration = 2.0 * (halfway - v) / left
        s.computed = x + span * (v + 0.5 * acceleration * span)
        s.rate = v + acceleration * span
        way = s.computed - x
        s.bent = (
            bent if event == NOTHING else deflect_bristles(friction, s.bent, halfway, way, s.load)
        )
        if p.relaxing > 0.0:
            relax(p, s, s.computed - x, span)
        if event == NOTHING:
            if abs(s.computed) < TINY and abs(s.rate) < TINY:
                s.computed = s.rate = 0.0
            return
        done += span
        if event == REST:
            s.rate = 0.0
        elif event == STOP:
            _strike(p, s, ends)
        else:
            _pass_neutral(p, friction, m, s, breakout, pull, h - done)
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
    """Advance δc within `ends` over h seconds, at whose end the pilot's force is `force` N."""
    if p.held:
        apply_modification(p, m, s, s.computed - s.neutral)
    _move(p, friction, m, s, force + s.leaked, ends, h)
    if p.lag_gain > 0.0:
        apply_modification(p, m, s, s.computed - s.neutral)
