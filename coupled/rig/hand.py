"""What holds the grip: a force on it, and perhaps an impedance.

    F = F_script(t) + u_lag + k_h·(δ_set − δ) + c_h·(δ_set' − δ') + k_I·∫(δ_set − δ) dt

With every gain zero the hand is the scripted force. With gains it holds the grip
at δ_set with whatever force that takes (a clamp). u is the command of a pilot in the
loop, held over a frame; it reaches the grip through the muscle's lag.

The force bends the structure, so δ on the right depends on F on the left. The
bend's local slope K is taken implicitly, which keeps a stiff hand stable at any
K; the motion of the loader enters as it stood at the node (an exchange once a
substep, first order in it).

Beyond its strength a hand gives way, and no impedance acts. Its full strength lasts for an
endurance; after that it has its lasting strength only, until it has rested:

    effort' = (|F| − F_lasting)/(F_strongest − F_lasting), within 0 and the endurance

A hand goes no further than its reach r, on either side: there the limb is straight, or the
control at its stop in the cab. Its force is then at most

    F = c·w·(r − δ) − m·w·δ' + I,      I' = G·w·(r − δ)

which takes the grip to r as a clamp does, with the loader's own m and c, the specified
gradient G and a bandwidth w. Until that is the limit I is the force that holds the grip where
it is, so that the grip comes to r as exp(−w·t), and not past it.
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, first_order_gain
from coupled.rig.linkage import LinkageParameters, LinkageState, bend, bend_slope


class HandParameters(Protocol):
    """Gains of the hand; d is m, or rad for a wheel."""

    stiffness: float  # k_h, N/d
    damping: float  # c_h, N·s/d
    integral: float  # k_I, N/(d·s)
    lag_gain: float  # 1 − exp(−h/τ) of the muscle's lag over a substep
    strongest: float  # N, for a short time; 0 for a hand without limit
    lasting: float  # N, for any time
    endurance: float  # s at full strength
    reach: float  # d, on both sides; 0 for a hand that goes as far as the control
    reach_stiffness: float  # c·w, N/d
    reach_damping: float  # m·w, N·s/d
    reach_gradient: float  # G, N/d
    reach_bandwidth: float  # w, 1/s


class HandState(Protocol):
    """What the hand does now."""

    force: float  # N, pull positive
    command: float  # u, N, held over the frame
    muscle: float  # u behind the muscle's lag, N
    integral: float  # the integral term, N
    effort: float  # s at full strength that the hand has behind it
    holding: float  # I, N, to the force's side
    straight: float  # the side on which the reach is the limit, or 0


REACH_BANDWIDTH = 6.0  # rad/s, with which a hand comes to the end of its reach, as a clamp's

HAND = Declaration(
    layout(HandParameters),
    section="hand",
    derived={
        "lag_gain": lambda g: first_order_gain(g.hand.lag_s, g.substep_s),
        "endurance": lambda g: g.hand.endurance_s,
        "reach_stiffness": lambda g: REACH_BANDWIDTH * g.control.loader.damping,
        "reach_damping": lambda g: REACH_BANDWIDTH * g.control.loader.mass,
        "reach_gradient": lambda g: g.hand.gradient,
        "reach_bandwidth": lambda g: REACH_BANDWIDTH,
    },
    state=layout(HandState),
    fixed=("effort", "straight"),
)


@stage
def only_scripted(p: HandParameters) -> bool:
    """Tell whether a hand holds what is asked of it as it is: no impedance, no limit."""
    impedance = p.stiffness != 0.0 or p.damping != 0.0 or p.integral != 0.0
    return not impedance and p.strongest == 0.0 and p.reach == 0.0


@stage
def within_strength(p: HandParameters, s: HandState, force: float, h: float) -> float:
    """Return the force that a hand can hold of one asked for, N, and tire it for h seconds."""
    if p.strongest == 0.0:
        return force
    limit = p.strongest if s.effort < p.endurance else p.lasting
    held = min(max(force, -limit), limit)
    effort = s.effort + h * (abs(held) - p.lasting) / (p.strongest - p.lasting)
    s.effort = min(max(effort, 0.0), p.endurance)
    return held


@stage
def within_reach(
    p: HandParameters,
    s: HandState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    asked: float,
    before: float,
    h: float,
) -> float:
    """Return the force of one asked for, N, that leaves the grip within reach.

    `before` is the force at the last node, N. The bend is taken implicitly, as with an
    impedance.
    """
    side = 1.0 if asked > 0.0 else -1.0
    slope = bend_slope(linkage_p, before)
    at = side * (linkage.grip + bend(linkage_p, before))
    left = p.reach - at
    if s.straight != side:
        s.holding = min(side * before, p.reach_gradient * at)
    most = p.reach_stiffness * left - p.reach_damping * side * linkage.rate + s.holding
    change = (most - side * before) / (1.0 + slope * (p.reach_stiffness + p.reach_damping / h))
    most = side * before + change
    if side * asked <= most and left > 0.0:
        s.straight = 0.0
        return asked
    s.straight = side
    s.holding += p.reach_gradient * p.reach_bandwidth * h * (left - slope * change)
    return side * min(most, side * asked)


@stage
def grip_force(
    p: HandParameters,
    s: HandState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    script: float,
    held: float,
    held_rate: float,
    h: float,
) -> float:
    """Return the force at a node, N, and remember it.

    `script` is F_script in N, `held` and `held_rate` are δ_set and its rate.
    """
    before, target = s.force, script + s.muscle
    if p.stiffness == 0.0 and p.damping == 0.0 and p.integral == 0.0:
        if p.reach > 0.0:
            target = within_reach(p, s, linkage_p, linkage, target, before, h)
        s.force = within_strength(p, s, target, h)
        return s.force
    slope = bend_slope(linkage_p, s.force)
    error = held - (linkage.grip + bend(linkage_p, s.force))
    rate_error = held_rate - linkage.rate
    asked = target + p.stiffness * error + p.damping * rate_error + s.integral
    change = (asked - s.force) / (1.0 + slope * (p.stiffness + p.damping / h))
    s.force += change
    s.integral += p.integral * h * (error - slope * change)
    if p.reach > 0.0:
        s.force = within_reach(p, s, linkage_p, linkage, s.force, before, h)
    s.force = within_strength(p, s, s.force, h)
    return s.force


@stage
def move_muscle(p: HandParameters, s: HandState) -> None:
    """Let the pilot's command act for a substep through the muscle's lag."""
    s.muscle += p.lag_gain * (s.command - s.muscle)
    if abs(s.muscle) < TINY:
        s.muscle = 0.0
