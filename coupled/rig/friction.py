"""Dry friction of the loader: Coulomb, Stribeck with its breakaway, and contacts that yield.

Running friction opposes the motion; from rest the control holds until the net
force exceeds the breakaway. Between the two, friction falls with speed as
F_c + (F_s − F_c)·exp(−(v/v_s)²) (Armstrong-Hélouvry, Dupont and Canudas de Wit,
Automatica 30, 1994, their Stribeck term with exponent 2). It is set-valued at rest:
a control left inside the band stays exactly where it is.

A contact with a stiffness yields before it slips. Its bristles bend by z: in the direction of
motion as the way, up to a share of z_c = F/stiffness, and from there towards z_c by
dz/dx = (z_c − z)/(z_c − share·z_c); turned back, they give back all that they have bent
(elastoplastic: Dupont, Hayward, Armstrong and Altpeter, IEEE TAC 47, 2002, their α a straight
line). Below its share the contact is a spring: nothing creeps, whatever the force does. The force
is stiffness·z, and a damping that fades with speed, which lets a stuck control come to rest.

z depends on the way alone, and is solved exactly along it; so no event is located. A step takes
the mean force over its way, an averaged vector field of second order; a turn inside a step costs
the difference between two ways of length h², which keeps the order.

Friction may differ with the direction of motion and grow with the force carried (gears, worn
guides): to the levels above comes `pull` or `push`, and `by_load`·|F|. By direction alone, of a
rigid contact, it is plain friction of the mean and a constant force of half the difference.
"""

from __future__ import annotations

import math
from typing import Protocol

from coupled.rig.compiled import layout, seldom, stage
from coupled.rig.declaration import Declaration, Given


class FrictionParameters(Protocol):
    """Friction's levels, and the speed over which breakaway fades."""

    running: float  # F_c, N
    breakaway: float  # F_s ≥ F_c, N
    stribeck_rate: float  # v_s, d/s
    stiffness: float  # of the contact, N/d; 0 for a rigid one
    contact_damping: float  # N·s/d at rest
    pull: float  # more where the control moves aft, N
    push: float  # and where it moves forward, N
    by_load: float  # and for each N that the loader carries
    elastic_share: float  # of the bristles' length, bent before any of it slips
    dry: int  # whether there is any
    rigid: int  # and its contact is rigid
    varies: int  # with the direction or the load


CONTACT_DAMPING = 0.3  # of √(stiffness·mass)
NEWTON_STEPS = 20
LEAST_N = 1e-9  # friction of bristles that carry none at this load
FADED = 6.0  # times the speed over which it fades, from which contacts do not damp
SLIPS_ALL = 1e-9  # of friction, that bristles may lack where all of them slip
SOLVED = 1e-7  # of the speeds at hand: what a step may still change


def _stiffness(given: Given) -> float:
    """Return the stiffness of a contact that carries friction, N/d."""
    return given.control.loader.friction_stiffness if _dry(given) else 0.0


def _dry(given: Given) -> bool:
    loader = given.control.loader
    return max(loader.friction, loader.breakaway) > 0.0 or _varies(given)


def _varies(given: Given) -> bool:
    loader = given.control.loader
    return max(loader.friction_pull, loader.friction_push, loader.friction_by_load) > 0.0


FRICTION = Declaration(
    layout(FrictionParameters),
    section="control.loader",
    derived={
        "running": lambda g: g.control.loader.friction,
        "breakaway": lambda g: max(g.control.loader.friction, g.control.loader.breakaway),
        "stiffness": _stiffness,
        "contact_damping": lambda g: (
            CONTACT_DAMPING * math.sqrt(_stiffness(g) * g.control.loader.mass)
        ),
        "pull": lambda g: g.control.loader.friction_pull,
        "push": lambda g: g.control.loader.friction_push,
        "by_load": lambda g: g.control.loader.friction_by_load,
        "elastic_share": lambda g: g.control.loader.friction_elastic_share,
        "dry": _dry,
        "rigid": lambda g: _dry(g) and g.control.loader.friction_stiffness == 0.0,
        "varies": _varies,
    },
)


@stage
def running_friction(p: FrictionParameters, rate: float) -> float:
    """Return the friction's size in N when sliding at `rate` in d/s."""
    if p.breakaway <= p.running:
        return p.running
    ratio = rate / p.stribeck_rate
    return p.running + (p.breakaway - p.running) * math.exp(-ratio * ratio)


@stage
def more_friction(p: FrictionParameters, load: float, direction: float) -> float:
    """Return what the direction of motion and the force carried, N, add to friction, N."""
    if p.varies == 0:
        return 0.0
    return (p.pull if direction > 0.0 else p.push) + p.by_load * load


@stage
def _slipping(p: FrictionParameters, load: float, rate: float) -> float:
    """Return the friction at which bristles slip at a rate, N."""
    level = running_friction(p, rate) + more_friction(p, load, rate)
    return max(level, LEAST_N)  # of breakaway alone nothing is left at speed


@stage
def yielded(p: FrictionParameters, level: float, bent: float, way: float) -> tuple[float, float]:
    """Return how far bristles are bent after a way, and on the mean over it, both in d.

    `level` is the friction at which they slip, N.
    """
    if way == 0.0:
        return bent, bent
    side = 1.0 if way > 0.0 else -1.0
    most = level / p.stiffness
    slips, soft = p.elastic_share * most, (1.0 - p.elastic_share) * most
    z, left, area = side * bent, abs(way), 0.0
    if z < slips:
        straight = min(left, slips - z)
        area = straight * (z + 0.5 * straight)
        z += straight
        left -= straight
    if left > 0.0:
        nearer = -math.expm1(-left / soft) * (most - z)
        area += most * left - soft * nearer
        z += nearer
    return side * z, side * area / abs(way)


@stage
def _bending(p: FrictionParameters, level: float, bent: float, way: float) -> float:
    """Return by how much bristles bend on for each d of the way, 1 where none of it slips."""
    most = level / p.stiffness
    left = most - (bent if way > 0.0 else -bent)
    return min(max(left / ((1.0 - p.elastic_share) * most), 0.0), 1.0)


@stage
def bent_after(p: FrictionParameters, bent: float, rate: float, way: float, load: float) -> float:
    """Return how far bristles are bent after a way at a rate, d; 0 of a rigid contact."""
    if p.stiffness == 0.0:
        return 0.0
    return yielded(p, _slipping(p, load, rate), bent, way)[0]


@stage
def _curvatures(p: FrictionParameters, level: float, span: float) -> tuple[float, float]:
    """Return half of the most that a yielding contact curves with speed, N·s²/d², beyond fading.

    Of its mean force over the way, and of what it carries at the end.
    """
    most = level / p.stiffness
    bowed = 0.5 * p.stiffness * span * span / ((1.0 - p.elastic_share) * most)
    return bowed / 3.0, bowed


@seldom
def yielding_speed(
    p: FrictionParameters,
    bent: float,
    v: float,
    push: float,
    inertia: float,
    span: float,
    load: float,
) -> tuple[float, float]:
    """Return the speed u at the middle of a step of `span` seconds, in d/s, of a yielding contact.

    And how far its bristles are bent at the end, d.

    inertia·(u − v) + force over the way u·span = push, with `v` the speed at its start. The force
    rises with the way, ever less: from the speed that its slope at the start would let, Newton's
    steps run up to u from one side, each a smaller part of the last.
    """
    level = _slipping(p, load, v)
    free = inertia * v + push - p.stiffness * bent
    side = 1.0 if free > 0.0 else -1.0
    if level - side * p.stiffness * bent <= SLIPS_ALL * level and (
        p.breakaway <= p.running or abs(v) > FADED * p.stribeck_rate
    ):
        u = v + (push - side * level) / inertia
        if u * side > (0.0 if p.breakaway <= p.running else FADED * p.stribeck_rate):
            return u, side * level / p.stiffness
    spring = p.stiffness * (0.5 * span)
    bends = _bending(p, level, bent, free)
    u, last, after = free / (inertia + bends * (spring + p.contact_damping)), 0.0, bent
    curved, bowed = _curvatures(p, level, span)
    faded = FADED * p.stribeck_rate
    for _ in range(NEWTON_STEPS):
        level, fading = _slipping(p, load, u), u / p.stribeck_rate
        damping = 0.0
        if abs(fading) < FADED:
            damping = p.contact_damping * math.exp(-fading * fading)
        way = u * span
        after, mean = yielded(p, level, bent, way)
        force = p.stiffness * mean + damping * (after - bent) / span
        bends = _bending(p, level, after, way)
        slope = inertia + damping * bends
        if way != 0.0:
            slope += max(p.stiffness * (after - mean) / way * span, 0.0)
        change = (push - force - inertia * (u - v)) / slope
        u += change
        after += bends * (change * span)
        near, step = SOLVED * (abs(u) + abs(v)), abs(change)
        # This one, or the next by their ratio, or by how much force and bend may curve.
        if step <= near or step * step <= near * last:
            break
        if min(abs(u), abs(v)) > faded:  # else the slope lacks how damping and level fade
            square = step * step
            if square * curved <= near * slope and square * bowed <= SOLVED * level:
                break
        last = step
    return u, after


@stage
def rubbing_speed(
    p: FrictionParameters,
    bent: float,
    v: float,
    push: float,
    direction: float,
    inertia: float,
    span: float,
    load: float,
) -> tuple[float, float]:
    """Return the speed at the middle of a step of `span` seconds, of any friction, in d/s.

    And how far bristles are bent after it, d.

    `push` is the force but for friction, N, `inertia` what it has to move, N·s/d, `direction` the
    side to which a rigid contact slides, `load` the force carried, N.
    """
    if p.dry == 0:
        return v + push / inertia, 0.0
    if p.stiffness > 0.0:
        return yielding_speed(p, bent, v, push, inertia, span, load)
    push -= more_friction(p, load, direction) * direction
    halfway = v + (push - running_friction(p, v) * direction) / inertia
    if p.breakaway > p.running:  # Stribeck: once more with the speed just found
        halfway = v + (push - running_friction(p, halfway) * direction) / inertia
    return halfway, 0.0
