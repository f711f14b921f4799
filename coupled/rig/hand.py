"""The hand on the grip: a given force, and possibly an impedance.

    F = F_script(t) + u_lag + k_h·(δ_set − δ) + c_h·(δ_set' − δ') + k_I·∫(δ_set − δ) dt

With all gains zero the hand is the scripted force. With gains it holds the grip at δ_set with
whatever force that takes (a clamp). u is the command of a pilot in the loop, held over a frame,
through the muscle's lag.

The force bends the structure, so δ on the right depends on F on the left. The bend's local slope K
is taken implicitly, which keeps a stiff hand stable at any K. The motion of the loader enters with
its value at the node (an exchange once a substep, of first order).

A hand at its strength limit has no impedance. Its full strength lasts for an endurance; after that
it has its lasting strength only, until it has rested:

    effort' = (|F| − F_lasting)/(F_strongest − F_lasting), within 0 and the endurance

The arm has a mass m_h, in kg at the grip, whose inertia reduces the force on the grip:

    F = F_hand − m_h·δ''

taken implicitly over a substep, to first order. `reach` limits the hand's deflection.
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, first_order_gain
from coupled.rig.linkage import LinkageParameters, LinkageState, bend_slope, deflection


class HandParameters(Protocol):
    """Gains of the hand; d is m, or rad for a wheel."""

    stiffness: float  # k_h, N/d
    damping: float  # c_h, N·s/d
    integral: float  # k_I, N/(d·s)
    lag_gain: float  # 1 − exp(−h/τ) of the muscle's lag over a substep
    strongest: float  # N, for a short time; 0 for a hand without limit
    lasting: float  # N, for any time
    endurance: float  # s at full strength
    mass: float  # m_h, kg (N per d/s²)


class HandState(Protocol):
    """The current action of the hand."""

    force: float  # N, pull positive
    commanded: float  # N, before the stop at the reach takes its part
    command: float  # u, N, held over the frame
    muscle: float  # u behind the muscle's lag, N
    integral: float  # the integral term, N
    effort: float  # time spent at full strength, s
    at: float  # δ at the last node, d
    moving: float  # δ' there, d/s


HAND = Declaration(
    layout(HandParameters),
    section="hand",
    derived={
        "lag_gain": lambda g: first_order_gain(g.hand.lag_s, g.substep_s),
        "endurance": lambda g: g.hand.endurance_s,
    },
    state=layout(HandState),
    fixed=("effort",),
)


@stage
def has_impedance(p: HandParameters) -> bool:
    """Tell whether a hand's force depends on the grip's motion."""
    return p.stiffness != 0.0 or p.damping != 0.0 or p.integral != 0.0 or p.mass != 0.0


@stage
def is_scripted(p: HandParameters) -> bool:
    """Tell whether a hand applies its script unchanged: no impedance, no limit."""
    return not has_impedance(p) and p.strongest == 0.0


@stage
def limit_to_strength(p: HandParameters, s: HandState, force: float) -> float:
    """Return a force limited to the hand's strength, N."""
    if p.strongest == 0.0:
        return force
    limit = p.strongest if s.effort < p.endurance else p.lasting
    return min(max(force, -limit), limit)


@stage
def command_force(
    p: HandParameters,
    s: HandState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    script: float,
    held: float,
    held_rate: float,
    h: float,
) -> float:
    """Set the hand's force at a node, N; return the increment of its integral, N.

    `script` is F_script in N, `held` and `held_rate` are δ_set and its rate.
    """
    wanted = script + s.muscle
    if not has_impedance(p):
        s.commanded = limit_to_strength(p, s, wanted)
        return 0.0
    slope, at = bend_slope(linkage_p, s.force), deflection(linkage_p, linkage, s.force)
    error = held - at
    rate_error = held_rate - linkage.rate
    commanded = wanted + p.stiffness * error + p.damping * rate_error + s.integral
    implicit = p.stiffness + p.damping / h
    if p.mass > 0.0:
        commanded -= p.mass * ((at - s.at) / h - s.moving) / h
        implicit += p.mass / (h * h)
    change = (commanded - s.force) / (1.0 + slope * implicit)
    striving = p.integral * h * (error - slope * change)
    s.commanded = limit_to_strength(p, s, s.force + change)
    return striving


@stage
def hold(
    p: HandParameters,
    s: HandState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    force: float,
    striving: float,
    h: float,
) -> None:
    """Apply a force for a substep, N; update fatigue and the integral."""
    s.force = force
    s.integral += striving
    if p.strongest > 0.0:
        held = min(abs(force), p.strongest)
        effort = s.effort + h * (held - p.lasting) / (p.strongest - p.lasting)
        s.effort = min(max(effort, 0.0), p.endurance)
    if p.mass > 0.0:
        at = deflection(linkage_p, linkage, force)
        s.moving = (at - s.at) / h
        s.at = at


@stage
def move_muscle(p: HandParameters, s: HandState) -> None:
    """Advance the pilot's command by a substep through the muscle's lag."""
    s.muscle += p.lag_gain * (s.command - s.muscle)
    if abs(s.muscle) < TINY:
        s.muscle = 0.0
