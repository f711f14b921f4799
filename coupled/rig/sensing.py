"""Sensing: what the host and the recorder read of force and deflection (figure 3).

Volts stand for metres and newtons: v₁ = S₁·δc, v₂ = S₂·ΔF, v₃ = S₃·F, eq. (2). A
converter of a given word length rounds them to its step and holds them at its full
scale. A scale S₁ or S₃ that is off makes the δc or F read that factor too large.
"""

from __future__ import annotations

import math
from typing import Protocol

from coupled.rig.compiled import layout, stage


class SensingParameters(Protocol):
    """Scales and converter steps, already divided into the quantity's own unit."""

    deflection_scale: float  # S₁ real over believed
    force_scale: float  # S₃ real over believed
    computed_step: float  # converter step of δc, d; 0 for none
    computed_range: float  # converter range of δc, d
    force_step: float  # of F, N
    force_range: float
    product_step: float  # of ΔF (digital), N
    product_range: float
    gradient_step: float  # of ΔG (hybrid), N/d
    gradient_range: float


SENSING_PARAMETERS = layout(SensingParameters)


@stage
def converted(value: float, step: float, full_scale: float) -> float:
    """Return a value as a converter of this step and range passes it; step 0 passes all."""
    if step == 0.0:
        return value
    rounded = step * math.floor(value / step + 0.5)
    return min(max(rounded, -full_scale), full_scale - step)


@stage
def read_computed(p: SensingParameters, computed: float, noise: float) -> float:
    """Return δc as the host reads it, d."""
    return converted(p.deflection_scale * computed + noise, p.computed_step, p.computed_range)


@stage
def read_force(p: SensingParameters, force: float, noise: float) -> float:
    """Return F as the host reads it, N."""
    return converted(p.force_scale * force + noise, p.force_step, p.force_range)
