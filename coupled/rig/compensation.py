"""Compensation: the host's estimate of the true deflection, for the surface.

δ̂ = δc + K̂·F      eq. (1) solved for δ, with the host's own K̂

A host may miss frames at random. In a missed frame it reads nothing and sets nothing: G_T, and so
ΔG, a digital product, and δ̂ keep their last values.
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig import equations
from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration

true_deflection = stage(equations.true_deflection)


class CompensationParameters(Protocol):
    """The host's assumptions on the bend."""

    bend: float  # K̂, d/N; 0 if the deflection correction is off
    missed_share: float  # of the host's frames


class CompensationState(Protocol):
    """The host's inputs and outputs of the last frame that it did not miss."""

    first: float  # G_T, N/d, and that beyond the break
    second: float
    computed: float  # δc as read, d
    estimated: float  # δ̂, d
    drawn: int  # the last random number; 0 before the first frame


COMPENSATION = Declaration(
    layout(CompensationParameters),
    section="control.compensation",
    derived={"bend": lambda g: g.control.compensation.bend * g.control.compensation.deflection},
    state=layout(CompensationState),
    fixed=("first", "second"),
)
LEHMER, MODULUS = 48271, 2**31 - 1  # Park and Miller's generator, its later multiplier
SEED = 20011


@stage
def misses(p: CompensationParameters, s: CompensationState) -> bool:
    """Tell whether the host misses the next frame, by the next number of its generator.

    The sequence is the same in each flight; the first frame is never missed.
    """
    if p.missed_share == 0.0:
        return False
    first = s.drawn == 0
    s.drawn = LEHMER * (SEED if first else s.drawn) % MODULUS
    return not first and s.drawn < p.missed_share * MODULUS


@stage
def estimate(p: CompensationParameters, computed: float, force: float) -> float:
    """Return δ̂ in d from δc in d and F in N as read: eq. (1) solved for δ, with K̂."""
    return true_deflection(computed, force, p.bend)
