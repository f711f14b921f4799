"""Dry friction of the loader: Coulomb, Stribeck with breakaway, and presliding friction.

Running friction opposes the motion; from rest the control sticks until the net force exceeds the
breakaway. Between the two, friction falls with speed as F_c + (F_s − F_c)·exp(−(v/v_s)²)
(Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30, 1994, their Stribeck term with
exponent 2). It is set-valued at rest: a control inside the friction band does not move.

A contact with a stiffness has presliding: its bristles deflect by z. In the direction of motion
they deflect with the displacement, up to a share of z_c = F/stiffness, and from there towards z_c
by dz/dx = (z_c − z)/(z_c − share·z_c). On reversal they return with the displacement (elastoplastic
model: Dupont, Hayward, Armstrong and Altpeter, IEEE TAC 47, 2002, with their α linear). Below the
share the contact is a spring without creep. The force is stiffness·z, plus a damping that fades
with speed and brings a stuck control to rest.

z depends on the displacement alone and is solved exactly along it, so no event is located. A step
uses the mean force over its displacement (an averaged vector field method of second order). A
reversal inside a step costs the difference between two displacements of order h², which keeps the
order.

Friction may depend on the direction of motion and on the load (gears, worn guides): `pull` or
`push`, `by_load`·|F| and `by_regressor`·(r − r₀), r a channel of a record, are added to the levels
above; their sum is not below zero. Rigid friction that depends on direction
only is plain friction of the mean level and a constant force of half the difference.

Curves add to it (`curves`): one by the load, and one by the rate, whose value at rest adds to
`pull` and `push` and whose rise from there is a damping g(v), piecewise linear. The friction as a
whole is not below zero. g is taken at the speed u of the step's middle. It is linear on a segment,
g_i(v) + g_i'·(u − v), which is a force and a damping; u rises with the force, so the right segment
is found by going from one to the next.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import TINY, layout, seldom, stage
from coupled.rig.declaration import Declaration, Given
from coupled.rig.piecewise import (
    SHAPE,
    along,
    count_of,
    damping_table,
    segment,
    solve_along,
    table_of,
)


class FrictionParameters(Protocol):
    """The levels of friction, and the speed over which the breakaway fades."""

    running: float  # F_c, N
    breakaway: float  # F_s ≥ F_c, N
    stribeck_rate: float  # v_s, d/s
    stiffness: float  # of the contact, N/d; 0 for a rigid one
    compliance: float  # its inverse, d/N; 0 for a rigid one
    contact_damping: float  # N·s/d at rest
    pull: float  # addition for motion aft, N
    push: float  # addition for motion forward, N
    by_load: float  # addition for each N of load
    by_regressor: float  # addition for each unit of the regressor, N
    regressed: float  # the current addition by the regressor, N (`loader.set_regressor`)
    elastic_share: float  # of the bristles' largest deflection, below which nothing slips
    dry: int  # whether there is any
    rigid: int  # and its contact is rigid
    varies: int  # with the direction or the load
    load_nodes: int  # of the curve over the load; 0 without one
    load_curve: NDArray[np.float64]  # N over N
    rate_nodes: int  # of the damping's curve; 0 without one
    rate_curve: NDArray[np.float64]  # g, N over d/s


CONTACT_DAMPING = 0.3  # of √(stiffness·mass)
NEWTON_STEPS = 20
LEAST_N = 1e-9  # least friction of bristles at any load
FADED = 6.0  # times v_s, above which contacts do not damp
SLIPS_ALL = 1e-9  # of friction, within which all bristles slip
SOLVED = 1e-7  # relative change of the speeds at convergence


def _stiffness(given: Given) -> float:
    """Return the stiffness of a contact with friction, N/d."""
    return given.control.loader.friction_stiffness if _dry(given) else 0.0


def _dry(given: Given) -> bool:
    loader = given.control.loader
    return max(loader.friction, loader.breakaway) > 0.0 or _varies(given)


def _varies(given: Given) -> bool:
    loader = given.control.loader
    ahead, back = _at_rest(given)
    added = (loader.friction_pull + ahead, loader.friction_push + back)
    others = (loader.friction_by_load, loader.regressor_friction, loader.load_curve.nodes)
    return any((*added, *others))


def _at_rest(given: Given) -> tuple[float, float]:
    """Return the dry friction of the curve over the rate, of a motion aft and forward, N."""
    curve = given.control.loader.friction_curve
    if not curve.nodes:
        return 0.0, 0.0
    return curve.force[0], curve.forward[0]


FRICTION = Declaration(
    layout(FrictionParameters, load_curve=SHAPE, rate_curve=SHAPE),
    section="control.loader",
    derived={
        "running": lambda g: g.control.loader.friction,
        "breakaway": lambda g: max(g.control.loader.friction, g.control.loader.breakaway),
        "stiffness": _stiffness,
        "compliance": lambda g: 1.0 / _stiffness(g) if _stiffness(g) > 0.0 else 0.0,
        "contact_damping": lambda g: (
            CONTACT_DAMPING * math.sqrt(_stiffness(g) * g.control.loader.mass)
        ),
        "pull": lambda g: g.control.loader.friction_pull + _at_rest(g)[0],
        "push": lambda g: g.control.loader.friction_push + _at_rest(g)[1],
        "by_load": lambda g: g.control.loader.friction_by_load,
        "by_regressor": lambda g: g.control.loader.regressor_friction,
        "regressed": lambda g: 0.0,
        "elastic_share": lambda g: g.control.loader.friction_elastic_share,
        "dry": _dry,
        "rigid": lambda g: _dry(g) and g.control.loader.friction_stiffness == 0.0,
        "varies": _varies,
        "load_nodes": lambda g: count_of(g.control.loader.load_curve),
        "load_curve": lambda g: table_of(g.control.loader.load_curve),
        "rate_nodes": lambda g: (
            2 * count_of(g.control.loader.friction_curve) - 1
            if g.control.loader.friction_curve.nodes
            else 0
        ),
        "rate_curve": lambda g: damping_table(g.control.loader.friction_curve),
    },
)


@stage
def stribeck_factor(p: FrictionParameters, rate: float) -> float:
    """Return the factor at `rate` in d/s of parts that fade with speed."""
    ratio = rate / p.stribeck_rate
    return math.exp(-ratio * ratio) if abs(ratio) < FADED else 0.0


@stage
def running_friction(p: FrictionParameters, rate: float) -> float:
    """Return the friction's size in N when sliding at `rate` in d/s."""
    if p.breakaway <= p.running:
        return p.running
    return p.running + (p.breakaway - p.running) * stribeck_factor(p, rate)


@stage
def added_friction(p: FrictionParameters, load: float, direction: float) -> float:
    """Return the additions to friction by direction of motion and by load (N), N."""
    if p.varies == 0:
        return 0.0
    added = (p.pull if direction > 0.0 else p.push) + p.regressed + p.by_load * load
    if p.load_nodes > 0:
        added += along(p.load_curve, p.load_nodes, load)
    return max(added, -p.running)


@stage
def carried(p: FrictionParameters, force: float, rubs: float) -> tuple[float, float]:
    """Return the force of a slow motion with friction by load, N, and its slope over it, inverse.

    `force` is that without load, its friction `rubs` included, N.
    """
    if p.load_nodes == 0:
        share = 1.0 - p.by_load
        return force / share, share
    return _carried_along(p, force, rubs)


@seldom
def _carried_along(p: FrictionParameters, force: float, rubs: float) -> tuple[float, float]:
    table, count = p.load_curve, p.load_nodes
    wanted = force - along(table, count, 0.0)
    by_load = solve_along(table, count, 1.0 - p.by_load, -1.0, wanted, -math.inf)
    return by_load if by_load[0] > force - rubs else (force - rubs, 1.0)


@stage
def damping_along(p: FrictionParameters, rate: float) -> float:
    """Return the part of the curve over the rate that vanishes at rest, N, signed as the rate."""
    return along(p.rate_curve, p.rate_nodes, rate) if p.rate_nodes > 0 else 0.0


@stage
def _slipping(p: FrictionParameters, load: float, rate: float, kept: float) -> float:
    """Return the friction at which bristles slip, N; `kept` is `stribeck_factor` at the rate."""
    level = p.running + (p.breakaway - p.running) * kept + added_friction(p, load, rate)
    return max(level, LEAST_N)  # breakaway alone fades to nothing with speed


@stage
def reached(x: float) -> float:
    """Return 1 − e^(−x) to 14 digits, for x ≥ 0, in half the time of `math.expm1`."""
    if x > 0.1:
        return 1.0 - math.exp(-x)
    near, far = 1.0 - x * (1 / 2 - x / 6), 1 / 24 - x * (1 / 120 - x / 720)
    return x * (near - x * x * x * (far - x * x * x * (1 / 5040 - x / 40320)))


@stage
def _along(
    level: float, share: float, compliance: float, per_soft: float, bent: float, way: float
) -> tuple[float, float, float]:
    """Return the bristles' deflection after a displacement, its mean, both in d, and 1/`way`.

    `per_soft` is the inverse of the displacement over which they slip partly, 1/d. Divisions are
    avoided, since each takes as long as everything else here.
    """
    side, per_way = 1.0 if way > 0.0 else -1.0, 1.0 / way
    most = level * compliance
    slips, soft = share * most, (1.0 - share) * most
    z, left, area = side * bent, abs(way), 0.0
    if z < slips:
        straight = min(left, slips - z)
        area = straight * (z + 0.5 * straight)
        z += straight
        left -= straight
    if left > 0.0:
        nearer = reached(left * per_soft) * (most - z)
        area += most * left - soft * nearer
        z += nearer
    return side * z, area * per_way, per_way


@stage
def yielded(p: FrictionParameters, level: float, bent: float, way: float) -> tuple[float, float]:
    """Return the bristles' deflection after a displacement, and its mean, both in d.

    `level` is the friction at which they slip, N.
    """
    if abs(way) <= TINY:
        return bent, bent
    per_soft = p.stiffness / ((1.0 - p.elastic_share) * level)
    after, mean, _ = _along(level, p.elastic_share, p.compliance, per_soft, bent, way)
    return after, mean


@stage
def _bending(level: float, compliance: float, per_soft: float, bent: float, way: float) -> float:
    """Return the bristles' deflection for each d of displacement, 1 where nothing slips."""
    left = level * compliance - (bent if way > 0.0 else -bent)
    return min(max(left * per_soft, 0.0), 1.0)


@stage
def deflect_bristles(
    p: FrictionParameters, bent: float, rate: float, way: float, load: float
) -> float:
    """Return the bristles' deflection after a displacement at a rate, d; 0 for a rigid contact."""
    if p.stiffness == 0.0:
        return 0.0
    return yielded(p, _slipping(p, load, rate, stribeck_factor(p, rate)), bent, way)[0]


@seldom
def presliding_speed(
    p: FrictionParameters,
    bent: float,
    v: float,
    push: float,
    inertia: float,
    span: float,
    load: float,
) -> tuple[float, float]:
    """Return the speed u at the middle of a step of `span` seconds, in d/s, with presliding.

    And the deflection of its bristles at the end, d.

    It solves inertia·(u − v) + force over the displacement u·span = push, with `v` the speed at the
    start. The force grows with the displacement, with falling slope. So Newton's method, started
    from the solution with the initial slope, converges to u from one side.
    """
    stiffness, compliance, share = p.stiffness, p.compliance, p.elastic_share
    free = inertia * v + push - stiffness * bent
    side = 1.0 if free > 0.0 else -1.0
    level = _slipping(p, load, side, stribeck_factor(p, v) if p.breakaway > p.running else 0.0)
    faded = FADED * p.stribeck_rate
    if level - side * stiffness * bent <= SLIPS_ALL * level and (
        p.breakaway <= p.running or abs(v) > faded
    ):
        u = v + (push - side * level) / inertia
        if u * side > (0.0 if p.breakaway <= p.running else faded):
            return u, side * level * compliance
    bends = _bending(level, compliance, stiffness / ((1.0 - share) * level), bent, free)
    spring = stiffness * (0.5 * span)
    u, last, after = free / (inertia + bends * (spring + p.contact_damping)), 0.0, bent
    per_span = 1.0 / span
    for _ in range(NEWTON_STEPS):
        kept = stribeck_factor(p, u)
        level, damping = _slipping(p, load, u, kept), p.contact_damping * kept
        per_soft = stiffness / ((1.0 - share) * level)
        way = u * span
        after, mean, slope = bent, bent, inertia
        if abs(way) > TINY:
            after, mean, per_way = _along(level, share, compliance, per_soft, bent, way)
            slope += max(stiffness * (after - mean) * per_way * span, 0.0)
        force = stiffness * mean + damping * (after - bent) * per_span
        bends = _bending(level, compliance, per_soft, after, way)
        slope += damping * bends
        change = (push - force - inertia * (u - v)) / slope
        u += change
        after += bends * (change * span)
        near, step = SOLVED * (abs(u) + abs(v)), abs(change)
        # Converged now, or in the next step, by the ratio of steps or by the curvature.
        if step <= near or step * step <= near * last:
            break
        if min(abs(u), abs(v)) > faded:  # else the slope lacks the fading of damping and level
            # Half of the largest curvature over speed, N·s²/d²: of the force at the end, and of
            # its mean over the displacement a third of that.
            bowed = 0.5 * stiffness * span * span * per_soft
            square = step * step * bowed
            if square <= 3.0 * near * slope and square <= SOLVED * level:
                break
        last = step
    return u, after


@stage
def sliding_speed(
    p: FrictionParameters,
    bent: float,
    v: float,
    push: float,
    direction: float,
    inertia: float,
    span: float,
    load: float,
) -> tuple[float, float]:
    """Return the speed amid a step of `span` seconds, d/s, and the bristles' deflection then, d.

    This function is for friction without a curve over the rate.

    `push` is the force without friction, N, `inertia` the inertia to be moved, N·s/d, `direction`
    the direction in which a rigid contact slides, `load` the load, N.
    """
    if p.dry == 0:
        return v + push / inertia, 0.0
    if p.stiffness > 0.0:
        return presliding_speed(p, bent, v, push, inertia, span, load)
    push -= added_friction(p, load, direction) * direction
    halfway = v + (push - running_friction(p, v) * direction) / inertia
    if p.breakaway > p.running:  # Stribeck: a second iteration with the speed just found
        halfway = v + (push - running_friction(p, halfway) * direction) / inertia
    return halfway, 0.0


@seldom
def sliding_speed_along(
    p: FrictionParameters,
    bent: float,
    v: float,
    push: float,
    direction: float,
    inertia: float,
    span: float,
    load: float,
) -> tuple[float, float]:
    """Return the same as `sliding_speed` with a curve over the rate: from segment to segment."""
    table, last = p.rate_curve, p.rate_nodes - 2
    i = segment(table, p.rate_nodes, v)
    u, after = v, bent
    for _ in range(p.rate_nodes):
        slope = table[2, i]
        level = table[1, i] + slope * (v - table[0, i])
        u, after = sliding_speed(p, bent, v, push - level, direction, inertia + slope, span, load)
        if u < table[0, i] and i > 0:
            i -= 1
        elif u > table[0, i + 1] and i < last:
            i += 1
        else:
            break
    return u, after
