"""S₃ by eq. (13), and S₂ both ways: from the internal gains, and by the null of eq. (14)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate, Instruments, mean_of, product
from coupled.rig.parameters import Gains

Floats = NDArray[np.float64]


def s3_by_ratios(force: Floats, v3: Floats) -> Estimate:
    """Return S₃ in V/N as the mean of v₃/F, eq. (13)."""
    return mean_of(v3 / force)


def s3_by_line(force: Floats, v3: Floats, instruments: Instruments) -> Estimate:
    """Return S₃ in V/N as the slope of v₃ = S₃·F through the origin, both with errors.

    Weighs a reading by its accuracy, where eq. (13) counts a small force as much as a large.
    """
    slope = float(force @ v3 / (force @ force))
    variance = slope**2 * instruments.force_variance(force) + instruments.voltage_variance(v3)
    if not np.any(variance):
        variance = np.ones_like(force)
    adjusted = force
    for _ in range(50):
        residual = v3 - slope * force
        adjusted = force + slope * instruments.force_variance(force) * residual / variance
        step = float((adjusted / variance) @ residual / ((adjusted / variance) @ adjusted))
        slope += step
        if abs(step) <= 1e-14 * abs(slope):
            break
    pull = adjusted / np.sqrt(variance)
    leverage = np.minimum(pull**2 / (pull @ pull), 1.0 - 1e-9)
    left = (v3 - slope * force) / np.sqrt(variance) / (1.0 - leverage)
    error = float(np.sqrt(np.sum((pull * left) ** 2)) / (pull @ pull))
    return Estimate(slope, error, len(force) - 1.0)


def s2_from_gains(s1: Estimate, s3: Estimate, gains: Gains) -> dict[str, Estimate]:
    """Return S₂ in V/N from each internal gain that is known: S₁/(S₁/S₂) and S₃/(S₃/S₂)."""
    found = {}
    if gains.s1_over_s2 > 0.0:
        found["S1 and the gain S1/S2"] = s1.scaled(1.0 / gains.s1_over_s2)
    if gains.s3_over_s2 > 0.0:
        found["S3 and the gain S3/S2"] = s3.scaled(1.0 / gains.s3_over_s2)
    return found


def s2_by_null(v2: Floats, v3: Floats, s3: Estimate) -> Estimate:
    """Return S₂ in V/N as the mean of v₂/v₃, times S₃: eq. (14)."""
    return product(mean_of(v2 / v3), s3)
