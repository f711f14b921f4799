"""S₃ by eq. (13), and S₂ by two methods: the internal gains, and the null of eq. (14)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate, mean_of, product
from coupled.rig.parameters import Gains

Floats = NDArray[np.float64]
BY_S1 = "S1 and the gain S1/S2"


def s3_by_ratios(force: Floats, v3: Floats) -> Estimate:
    """Return S₃ in V/N as the mean of v₃/F, eq. (13)."""
    return mean_of(v3 / force)


def s2_from_gains(s1: Estimate, s3: Estimate | None, gains: Gains) -> dict[str, Estimate]:
    """Return S₂ in V/N from each known internal gain: S₁/(S₁/S₂) and S₃/(S₃/S₂)."""
    found = {}
    if gains.s1_over_s2 > 0.0:
        found[BY_S1] = s1.scaled(1.0 / gains.s1_over_s2)
    if gains.s3_over_s2 > 0.0 and s3 is not None:
        found["S3 and the gain S3/S2"] = s3.scaled(1.0 / gains.s3_over_s2)
    return found


def s2_by_null(
    v2: Floats, v3: Floats, side: Floats, s3: Estimate, one_sided_share: float = 0.0
) -> Estimate:
    """Return S₂ in V/N as the mean of v₂/v₃, times S₃: eq. (14).

    Variations of the hand force move a control with friction to the extreme of the force, so the
    supply has to reach the extreme and not the mean: v₂/v₃ is too large for an outward approach
    and too small by the same amount for an inward one (`side` ±1). With both sides the difference
    is fitted and cancels. With one side, S₂ has a further error, uniform within ±
    `one_sided_share` of itself.
    """
    ratio = v2 / v3
    if both_sides(side):
        found = _centre(ratio, side)
    else:
        found = mean_of(ratio)
        error = np.hypot(found.error, one_sided_share * found.value / np.sqrt(3.0))
        found = Estimate(found.value, float(error), found.freedom)
    return product(found, s3)


def both_sides(side: Floats) -> bool:
    """Return whether nulls from both sides suffice to fit their difference."""
    return len(side) >= 4 and len(set(side.tolist())) == 2


def _centre(values: Floats, side: Floats) -> Estimate:
    """Return the mean of both sides' values, by least squares of centre and half difference."""
    design = np.column_stack((np.ones_like(side), side))
    figures, *_ = np.linalg.lstsq(design, values, rcond=None)
    freedom = len(values) - 2.0
    variance = float(np.sum((values - design @ figures) ** 2)) / freedom
    error = np.sqrt(variance * np.linalg.inv(design.T @ design)[0, 0])
    return Estimate(float(figures[0]), float(error), freedom)
