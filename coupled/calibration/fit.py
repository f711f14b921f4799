"""The report's fit, v₁ = a·δ + b·F: S₁ = a, K = −b/S₁ (eqs. (2) to (5), appendix A).

Ordinary least squares by the printed normal equations and by a QR factorisation of
scaled columns. It takes δ and F as exact, which they are not: see errors_in_variables.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate, Instruments

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LineFit:
    """S₁ in V/d and K in d/N, with what tells how far to trust them.

    `residual` is v₁ read less v₁ fitted, V; `correlation` that of the errors of S₁ and K;
    `excess` the residuals' size over what the instruments' errors explain.
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
    """Return (a, b) by QR of the design's columns, each scaled to unit length."""
    size = np.linalg.norm(design, axis=0)
    q, r = np.linalg.qr(design / size)
    return np.asarray(np.linalg.solve(r, q.T @ v1) / size)


def condition(deflection: Floats, force: Floats) -> float:
    """Return the condition number of the design, its columns scaled to unit length."""
    design = np.column_stack((deflection, force))
    return float(np.linalg.cond(design / np.linalg.norm(design, axis=0)))


def ordinary(deflection: Floats, force: Floats, v1: Floats, instruments: Instruments) -> LineFit:
    """Return the ordinary least-squares fit.

    The standard errors allow for readings of unequal accuracy (MacKinnon and White's HC3).
    """
    design = np.column_stack((deflection, force))
    a, b = solve(design, v1)
    variance = error_variance(a, b, deflection, force, v1, instruments)
    return line_fit(design, a, b, v1 - design @ np.array([a, b]), variance)


def error_variance(
    a: float, b: float, deflection: Floats, force: Floats, v1: Floats, instruments: Instruments
) -> Floats:
    """Return the variance of a·δ + b·F − v₁ that the instruments give each reading, V²."""
    return np.asarray(
        a**2 * instruments.deflection_variance(deflection)
        + b**2 * instruments.force_variance(force)
        + instruments.voltage_variance(v1)
    )


def line_fit(design: Floats, a: float, b: float, residual: Floats, variance: Floats) -> LineFit:
    """Return a fit's figures from (a, b), by the sandwich of its design, shape (n, 2).

    Each residual is weighed up by its leverage, which keeps the interval honest for few
    readings. K = −b/a by its derivatives.
    """
    n = len(residual)
    size = np.linalg.norm(design, axis=0)
    scaled = design / size
    q, r = np.linalg.qr(scaled)
    leverage = np.minimum(np.einsum("ij,ij->i", q, q), 1.0 - 1e-9)
    spread = np.linalg.solve(r, (q * (residual / (1.0 - leverage))[:, None]).T)
    covariance = spread @ spread.T / np.outer(size, size)
    slope = np.array([[1.0, 0.0], [b / a**2, -1.0 / a]])
    found = slope @ covariance @ slope.T
    errors = np.sqrt(np.diag(found))
    product = float(errors[0] * errors[1])
    known = float(np.sum(variance))
    excess = np.sqrt(np.sum(residual**2) / known * n / (n - 2)) if known > 0.0 else np.nan
    return LineFit(
        Estimate(float(a), float(errors[0]), n - 2.0),
        Estimate(float(-b / a), float(errors[1]), n - 2.0),
        float(found[0, 1]) / product if product > 0.0 else 0.0,
        residual,
        float(excess),
    )
