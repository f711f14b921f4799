"""The report's fit, v₁ = a·δ + b·F: S₁ = a, K = −b/S₁ (eqs. (2) to (5), appendix A).

Ordinary least squares by the printed normal equations and by a QR factorisation of scaled columns.
It neglects the errors of δ and F (see `errors_in_variables`). Forces held on other controls of the
same structure are further columns,

    v₁ = S₁·(δ − K·F − Σ_j K_j·F_j) = a·δ + b·F + Σ_j c_j·F_j,    K_j = −c_j/a
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.readings import Readings
from coupled.calibration.sandwich import Sandwich, sandwich

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LineFit:
    """S₁ in V/d and K in d/N, with measures of their quality.

    `residual` is v₁ read less v₁ fitted, V; `correlation` that of the errors of S₁ and K;
    `excess` the residuals over the instruments' errors.
    """

    s1: Estimate
    bend: Estimate
    correlation: float
    residual: Floats
    excess: float


def normal_equations(deflection: Floats, force: Floats, v1: Floats) -> tuple[float, float]:
    """Return a in V/d and b in V/N by Cramer's rule, as appendix A prints it."""
    dd, ff, df = deflection @ deflection, force @ force, deflection @ force
    dv, fv = deflection @ v1, force @ v1
    determinant = dd * ff - df**2
    return float((ff * dv - fv * df) / determinant), float((dd * fv - dv * df) / determinant)


def solve(design: Floats, v1: Floats) -> Floats:
    """Return (a, b) of eq. (4) by QR of the design's columns, each scaled to unit length."""
    size = np.linalg.norm(design, axis=0)
    q, r = np.linalg.qr(design / size)
    return np.asarray(np.linalg.solve(r, q.T @ v1) / size)


def condition(deflection: Floats, force: Floats) -> float:
    """Return the condition number of the design, its columns scaled to unit length."""
    design = np.column_stack((deflection, force))
    return float(np.linalg.cond(design / np.linalg.norm(design, axis=0)))


def ordinary(readings: Readings, instruments: Instruments) -> LineFit:
    """Return the ordinary least-squares fit, with standard errors from its residuals."""
    deflection, force, v1 = readings.deflection, readings.force, readings.v1
    design = np.column_stack((deflection, force, readings.others))
    found = solve(design, v1)
    residual = v1 - design @ found
    errors = sandwich(design[:, None, :], residual[:, None])
    a, b, *c = (float(figure) for figure in found)
    return line_fit(a, b, errors, residual, error_variance(a, b, readings, instruments, c))


def error_variance(
    a: float, b: float, readings: Readings, instruments: Instruments, c: Sequence[float] = ()
) -> Floats:
    """Return the variance of a·δ + b·F + Σ c·F_j − v₁ from the instruments' errors, V²."""
    crossed = 0.0
    if len(c):
        crossed = instruments.force_variance(readings.others) @ np.square(np.array(c))
    return np.asarray(
        crossed
        + a**2 * instruments.deflection_variance(readings.deflection, readings.deflection_looks)
        + b**2 * instruments.force_variance(readings.force, readings.force_looks)
        + instruments.voltage_variance(readings.v1)
    )


def line_fit(a: float, b: float, errors: Sandwich, residual: Floats, variance: Floats) -> LineFit:
    """Return S₁ and K = −b/a of a fit whose first two parameters are a and b: eqs. (5a) and (5b).

    `residual` of v₁ in V, and its `variance` from the instruments' errors in V².
    """
    n, more = len(residual), len(errors.back) - 2
    slopes = np.array([[1.0, 0.0], [b / a**2, -1.0 / a]])
    slopes = np.hstack((slopes, np.zeros((2, more))))
    s1 = errors.estimate(float(a), slopes[0])
    bend = errors.estimate(float(-b / a), slopes[1])
    product = s1.error * bend.error
    together = float(slopes[0] @ errors.covariance @ slopes[1])
    known = float(np.sum(variance))
    excess = np.nan
    if known > 0.0:
        excess = np.sqrt(np.mean(residual**2 / np.maximum(variance, 1e-300)) * n / (n - 2))
    correlation = together / product if product > 0.0 else 0.0
    return LineFit(s1, bend, correlation, residual, float(excess))
