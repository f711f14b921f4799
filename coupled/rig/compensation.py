"""Compensation: the host's estimate of the true deflection, for the surface.

δ̂ = δc + K̂·F      eq. (1) solved for δ, with the host's own K̂
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig import equations
from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration

true_deflection = stage(equations.true_deflection)


class CompensationParameters(Protocol):
    """What the host assumes of the bend."""

    bend: float  # K̂, d/N; 0 where the deflection correction is off


COMPENSATION = Declaration(
    layout(CompensationParameters),
    derived={"bend": lambda g: g.control.compensation.bend * g.control.compensation.deflection},
)


@stage
def estimate(p: CompensationParameters, computed: float, force: float) -> float:
    """Return δ̂ in d from δc in d and F in N as read: eq. (1) solved for δ, with K̂."""
    return true_deflection(computed, force, p.bend)
