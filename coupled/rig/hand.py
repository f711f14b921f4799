"""What holds the grip: a force on it, and perhaps an impedance.

    F = F_script(t) + u_lag + k_h·(δ_set − δ) + c_h·(δ_set' − δ') + k_I·∫(δ_set − δ) dt

With every gain zero the hand is the scripted force. With gains it holds the grip
where δ_set says, and the force is what that takes (a clamp). u is what a pilot
who looks at the aircraft asks for, once a frame; it reaches the grip through the
muscle's lag.

The force bends the structure, so δ on the right depends on F on the left. The
bend's local slope K is taken implicitly, which keeps a stiff hand stable at any
K; the motion of the loader enters as it stood at the node (an exchange once a
substep, first order in it).

A hand is no stronger than it is: beyond its strength it gives way, and no impedance acts.
Its full strength lasts for an endurance, after which it has its lasting strength only,
until it has rested:

    effort' = (|F| − F_lasting)/(F_strongest − F_lasting), within 0 and the endurance
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig.compiled import TINY, layout, stage
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


class HandState(Protocol):
    """What the hand does now."""

    force: float  # N, pull positive
    command: float  # u, N, held over the frame
    muscle: float  # u behind the muscle's lag, N
    integral: float  # the integral term, N
    effort: float  # s at full strength that the hand has behind it


HAND_PARAMETERS = layout(HandParameters)
HAND_STATE = layout(HandState)


@stage
def only_scripted(p: HandParameters) -> bool:
    """Tell whether a hand holds what is asked of it as it is: no impedance, no limit."""
    impedance = p.stiffness != 0.0 or p.damping != 0.0 or p.integral != 0.0
    return not impedance and p.strongest == 0.0


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
    target = script + s.muscle
    if p.stiffness == 0.0 and p.damping == 0.0 and p.integral == 0.0:
        s.force = within_strength(p, s, target, h)
        return s.force
    slope = bend_slope(linkage_p, s.force)
    error = held - (linkage.grip + bend(linkage_p, s.force))
    rate_error = held_rate - linkage.rate
    asked = target + p.stiffness * error + p.damping * rate_error + s.integral
    change = (asked - s.force) / (1.0 + slope * (p.stiffness + p.damping / h))
    s.force += change
    s.integral += p.integral * h * (error - slope * change)
    s.force = within_strength(p, s, s.force, h)
    return s.force


@stage
def move_muscle(p: HandParameters, s: HandState) -> None:
    """Let the pilot's command act for a substep through the muscle's lag."""
    s.muscle += p.lag_gain * (s.command - s.muscle)
    if abs(s.muscle) < TINY:
        s.muscle = 0.0
