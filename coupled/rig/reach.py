"""The reach of a hand: a stop at the grip, where the arm is straight or the column meets the cab.

The grip at δ = ±r stops the whole chain behind it, inelastically. Loader and servo stop at the
position x at which the grip, under the force of a slow motion, is at the reach:

    x + yields(F_x) + others = r,      F_x = F_BO + (G_B + ΔG)·x + k₃·x³ + friction − F_external

`yields` is the displacement between servo and grip: the bend, with its hysteresis at the frame, and
a soft backlash; `others` is the bend by forces on other controls. Loader and servo are stopped
there as at the loader's own stops. Their masses are stopped by an impulse, which is not part of the
force at a node.

The stop takes the part of the hand's force beyond the force at which the grip is at the reach,

    at + yields(F) + others ≤ r,     at = the servo's side

and in a rigid linkage, the part beyond F_x once δc is at x. Parts that do not follow the force at
once (a structure with mass, a soft backlash with its damper) are stopped at δ = r: they go no
further, and a structure with mass keeps no outward speed.

If x moves inward, as the gradient rises with q̄, the stop takes more by the same rule, and the
loader follows by its own motion. δ then exceeds r by rounding only: over random structures, forces
and gradients a test bounds the excess by 1e-9 m. On a loader with a transport delay or a servo the
stop acts at once.
"""

from __future__ import annotations

import math
from typing import Protocol

from coupled.rig.compiled import layout, seldom, stage
from coupled.rig.declaration import Declaration
from coupled.rig.friction import FrictionParameters, added_friction, carried
from coupled.rig.hand import HandState
from coupled.rig.linkage import (
    LinkageParameters,
    LinkageState,
    bend,
    contact_displacement,
    deflection,
    static_slope,
    still,
)
from coupled.rig.loader import LoaderParameters, LoaderState
from coupled.rig.modification import ModificationState, slope, smooth_force
from coupled.rig.piecewise import solve_along
from coupled.rig.springs import limited, spring, spring_slope, weight, weight_slope

_ITERATIONS = 40
_HALVINGS = 64  # to the last digit of a double
_SEAT = 1e-12  # of a deflection: rounding
_NO_FORCE = 1e30  # N: the grip cannot get to its reach


class ReachParameters(Protocol):
    """The limit of a hand's deflection."""

    reach: float  # r on both sides, d; 0 for the control's travel


class ReachState(Protocol):
    """The stop positions at the reach on either side, over a frame."""

    top: float  # x on the positive side, d, before the bend
    bottom: float  # on the negative side
    top_force: float  # F_x, N
    bottom_force: float


REACH = Declaration(
    layout(ReachParameters),
    section="hand",
    state=layout(ReachState),
    fixed=("top", "bottom", "top_force", "bottom_force"),
)


@stage
def force_for_bend(p: LinkageParameters, by: float) -> float:
    """Return the force in N for a bend of the structure, d: `bend` solved for F."""
    if p.curve_nodes > 0:
        return _force_along(p, by)
    compliance = p.bend if by >= 0.0 else p.push
    if compliance == 0.0:
        return _NO_FORCE if by > 0.0 else -_NO_FORCE
    if p.bend_limit > 0.0:
        share = by / p.bend_limit
        if abs(share) >= 1.0:
            return _NO_FORCE if by > 0.0 else -_NO_FORCE
        return p.bend_limit / compliance * math.atanh(share)
    return by / compliance


@seldom
def _force_along(p: LinkageParameters, by: float) -> float:
    """Return the force for a bend of a structure with a curve, N."""
    side = 1.0 if by >= 0.0 else -1.0
    if p.bend_limit == 0.0:
        compliance, begin = (p.bend, 0.0) if by >= 0.0 else (p.push, -math.inf)
        force, _ = solve_along(p.curve, p.curve_nodes, compliance, 1.0, by, begin)
        return side * min(abs(force), _NO_FORCE)
    outer = side
    while side * (bend(p, outer) - by) < 0.0:
        outer *= 2.0
        if abs(outer) > _NO_FORCE:
            return side * _NO_FORCE
    inner = 0.0
    for _ in range(_HALVINGS):
        force = 0.5 * (inner + outer)
        if side * (bend(p, force) - by) > 0.0:
            outer = force
        else:
            inner = force
    return inner


@stage
def _is_rigid(p: LinkageParameters, compliance: float) -> bool:
    """Tell whether the structure does not bend on a side with this K, d/N."""
    return compliance == 0.0 and p.curve_nodes == 0


@seldom
def _place(
    r: float,
    side: float,
    p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    s: LoaderState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
) -> tuple[float, float]:
    """Return x and F_x on a side, both as sizes, by bracketed Newton's method."""
    low, high = 0.0, p.aft if side > 0.0 else p.forward
    x = min(r, high)
    rubs = friction.running + added_friction(friction, 0.0, side)
    level = p.breakout + m.breakout + rubs - side * s.external
    force = level
    for _ in range(_ITERATIONS):
        at = x - side * s.neutral
        force = level + side * (spring(p, side * at) + weight(p, side * x))
        force += side * limited(p, smooth_force(m, side * at))
        force, share = carried(friction, force, rubs)
        ahead = still(linkage_p, linkage, side * force) + contact_displacement(
            linkage_p, side * force
        )
        over = x + side * (ahead + linkage.others) - r
        if over > 0.0:
            high = x
        else:
            low = x
        stiffness = spring_slope(p, side * at) + weight_slope(p, side * x)
        stiffness = (stiffness + slope(m, side * at)) / share
        slope_of_yield = static_slope(linkage_p, side * force)
        if linkage_p.contact > 0.0:
            slope_of_yield += 1.0 / linkage_p.contact
        rise = 1.0 + slope_of_yield * stiffness
        after = x - over / rise if rise > 0.0 else 0.5 * (low + high)
        if not low <= after <= high:
            after = 0.5 * (low + high)
        if abs(after - x) <= 1e-14 * r:
            break
        x = after
    return x, force


@stage
def free(stop: ReachState) -> None:
    """Set no limit by the reach, before the first frame."""
    stop.top_force, stop.bottom_force = _NO_FORCE, -_NO_FORCE


@seldom
def set_reach(
    p: ReachParameters,
    stop: ReachState,
    loader_p: LoaderParameters,
    friction: FrictionParameters,
    m: ModificationState,
    loader: LoaderState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
) -> None:
    """Find the stop positions at the reach for a frame's gradients and external force."""
    r = p.reach
    stop.top, stop.top_force = _place(r, 1.0, loader_p, friction, m, loader, linkage_p, linkage)
    size, force = _place(r, -1.0, loader_p, friction, m, loader, linkage_p, linkage)
    stop.bottom, stop.bottom_force = -size, -force


@stage
def _servo_lead(p: LinkageParameters) -> float:
    """Return the servo's lead over the grip, d: half of a rigid backlash."""
    return 0.0 if p.contact > 0.0 else 0.5 * p.play


@stage
def bounds(
    p: ReachParameters,
    stop: ReachState,
    loader_p: LoaderParameters,
    linkage_p: LinkageParameters,
    computed: float,
) -> tuple[float, float]:
    """Return the range of δc in a substep, d, by the travel or the reach.

    From beyond the reach, if it has moved inward, only back.
    """
    if p.reach == 0.0:
        return -loader_p.forward, loader_p.aft
    half = _servo_lead(linkage_p)
    low = max(-loader_p.forward, min(stop.bottom - half, computed))
    return low, min(loader_p.aft, max(stop.top + half, computed))


@seldom
def stop_linkage(
    stop: ReachState, p: LinkageParameters, s: LinkageState, position: float, grip: float
) -> None:
    """Stop servo and grip at the reach; `position` and `grip` are those before."""
    half = _servo_lead(p)
    top, bottom = max(stop.top + half, position), min(stop.bottom - half, position)
    if s.position > top:
        s.position, s.rate = top, min(s.rate, 0.0)
    elif s.position < bottom:
        s.position, s.rate = bottom, max(s.rate, 0.0)
    if p.contact > 0.0:
        s.grip = s.position + s.touch
    else:
        s.grip = min(max(s.grip, min(stop.bottom, grip)), max(stop.top, grip))


@stage
def side_at_stop(stop: ReachState, p: LinkageParameters, computed: float) -> int:
    """Return the side on which δc is at its stop by the reach, or 0."""
    half = _servo_lead(p)
    if abs(computed - (stop.top + half)) <= _SEAT * abs(computed):
        return 1
    return -1 if abs(computed - (stop.bottom - half)) <= _SEAT * abs(computed) else 0


@seldom
def _force_for_displacement(p: LinkageParameters, s: LinkageState, by: float, side: float) -> float:
    """Return the largest force to a side, N, that displaces the grip by at most `by`, d.

    By bisection: bend, with its current hysteresis, and a soft backlash at rest grow with force.
    """
    if p.contact > 0.0:
        widest = p.contact * (abs(by) + 0.5 * p.play)
        inner, outer = -side * widest, side * widest
    else:
        middle, half = force_for_bend(p, by), 0.5 * p.width
        if abs(middle) >= _NO_FORCE:
            return middle
        inner, outer = middle - side * half, middle + side * half
    for _ in range(_HALVINGS):
        force = 0.5 * (inner + outer)
        if side * (still(p, s, force) + contact_displacement(p, force) - by) > 0.0:
            outer = force
        else:
            inner = force
    return inner


@seldom
def _most(
    p: ReachParameters,
    stop: ReachState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    computed: float,
    side: float,
) -> float:
    """Return the force to a side, N, beyond which the stop takes the rest."""
    outward, inward = linkage_p.bend, linkage_p.push
    if side < 0.0:
        outward, inward = inward, outward
    if _is_rigid(linkage_p, outward) and linkage_p.contact == 0.0:
        at, force = stop.top, stop.top_force
        if side < 0.0:
            at, force = stop.bottom, stop.bottom_force
        if side * side_at_stop(stop, linkage_p, computed) <= 0.0 or side * at < p.reach:
            return side * _NO_FORCE
        return force
    servo = linkage.position if linkage_p.contact > 0.0 else linkage.grip
    by = side * p.reach - (servo + linkage.others)
    if side * by < 0.0 and _is_rigid(linkage_p, inward) and linkage_p.contact == 0.0:
        return 0.0  # it is beyond the reach, and no force bends it back
    if linkage_p.share > 0.0 or linkage_p.contact > 0.0:
        return _force_for_displacement(linkage_p, linkage, by, side)
    return force_for_bend(linkage_p, by)


@stage
def within_reach(
    p: ReachParameters,
    stop: ReachState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    computed: float,
    asked: float,
) -> float:
    """Return the part of a force, N, that the stop leaves on the grip."""
    top = _most(p, stop, linkage_p, linkage, computed, 1.0)
    return max(min(asked, top), _most(p, stop, linkage_p, linkage, computed, -1.0))


@seldom
def stop_grip(p: ReachParameters, linkage_p: LinkageParameters, s: LinkageState, f: float) -> None:
    """Stop parts at the reach that did not follow the force at once; F at the node in N."""
    if not (linkage_p.modal or linkage_p.contact > 0.0):
        return
    at = deflection(linkage_p, s, f)
    over = at - min(max(at, -p.reach), p.reach)
    if over == 0.0:
        return
    if linkage_p.modal:
        s.bent -= over
        s.bent_rate = min(s.bent_rate, 0.0) if over > 0.0 else max(s.bent_rate, 0.0)
    else:
        s.touch -= over
        s.grip = s.position + s.touch


@seldom
def stop_again(
    p: ReachParameters,
    stop: ReachState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    hand: HandState,
    computed: float,
) -> None:
    """Stop a grip at its reach that the other controls' forces have moved since its node."""
    hand.force = within_reach(p, stop, linkage_p, linkage, computed, hand.force)
    stop_grip(p, linkage_p, linkage, hand.force)
