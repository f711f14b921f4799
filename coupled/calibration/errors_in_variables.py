"""The fit of v₁ = a·δ + b·F and v₃ = S₃·F together, where every instrument errs.

Maximum likelihood for known error variances (a weighted total least squares): over the
true δ and F of each reading as well as a, b and S₃. The force is measured twice, by the
spring scale and by the strain gauge's v₃, and both tell of it. With r = (v₁ − a·δ − b·F,
v₃ − S₃·F) of what was read, and J = ((a, b), (0, S₃)), it comes down to

    minimise  Σ rᵀ·W⁻¹·r,    W = J·diag(u_δ², u_F²)·Jᵀ + diag(u_v₁², u_v₃²)

by Gauss-Newton; the derivative of r by (a, b, S₃) is made of the reading's own adjusted
(δ̂, F̂), the best guess of what was true. Ordinary least squares has the measured ones
there instead, whence its bias. Only the ratios of the variances matter for the figures;
their errors come from the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.fit import LineFit, error_variance, line_fit, solve
from coupled.calibration.readings import Readings
from coupled.calibration.sandwich import Sandwich, sandwich

Floats = NDArray[np.float64]
MOST_STEPS = 100
FINEST = 1e-6  # of the largest voltage: no meter is better, and W stays regular


@dataclass(frozen=True)
class JointFit:
    """S₁ and K (`line`) and S₃ in V/N, found together; `errors` are those of (a, b, S₃)."""

    line: LineFit
    s3: Estimate
    errors: Sandwich

    def estimate(self, value: float, by_s1: float, by_bend: float, by_s3: float) -> Estimate:
        """Return a figure made of S₁, K and S₃, whose derivatives by them are given."""
        a, b = self.line.s1.value, -self.line.bend.value * self.line.s1.value
        slope = np.array([by_s1 + by_bend * b / a**2, -by_bend / a, by_s3])
        return self.errors.estimate(value, slope)

    @property
    def correlation(self) -> Floats:
        """The correlation of the errors of S₁, K and S₃, shape (3, 3); 0 where there are none."""
        a, b = self.line.s1.value, -self.line.bend.value * self.line.s1.value
        slopes = np.array([[1.0, 0.0, 0.0], [b / a**2, -1.0 / a, 0.0], [0.0, 0.0, 1.0]])
        found = slopes @ self.errors.covariance @ slopes.T
        error = np.sqrt(np.diag(found))
        size = np.outer(error, error)
        return np.asarray(np.divide(found, size, out=np.eye(3), where=size > 0.0))


def errors_in_variables(readings: Readings, instruments: Instruments) -> JointFit:
    """Return the fit that allows for errors of δ, F, v₁ and v₃.

    Raises FloatingPointError where it does not settle.
    """
    force, v3 = readings.force, readings.v3
    a, b = solve(np.column_stack((readings.deflection, force)), readings.v1)
    figures = np.array([a, b, force @ v3 / (force @ force)])
    for _ in range(MOST_STEPS):
        design, whitened = _whitened(figures, readings, instruments)
        step = solve(design.reshape(-1, 3), whitened.ravel())
        figures = figures + step
        if np.all(np.abs(step) <= 1e-12 * np.abs(figures)):
            break
    else:
        raise FloatingPointError
    a, b, s3 = (float(figure) for figure in figures)
    errors = sandwich(*_whitened(figures, readings, instruments))
    residual = readings.v1 - a * readings.deflection - b * force
    line = line_fit(a, b, errors, residual, error_variance(a, b, readings, instruments))
    return JointFit(line, errors.estimate(s3, np.array([0.0, 0.0, 1.0])), errors)


def _whitened(
    figures: Floats, readings: Readings, instruments: Instruments
) -> tuple[Floats, Floats]:
    """Return the whitened derivatives of r by (a, b, S₃), shape (n, 2, 3), and r, (n, 2)."""
    a, b, s3 = figures
    seen = np.column_stack((readings.deflection, readings.force))
    volts = np.column_stack((readings.v1, readings.v3))
    jacobian = np.array([[a, b], [0.0, s3]])
    own = reading_variances(readings, instruments)
    carried = jacobian[None] * own[:, None, :2]
    root = np.linalg.cholesky(carried @ jacobian.T + own[:, 2:, None] * np.eye(2))
    residual = volts - seen @ jacobian.T
    whitened = np.linalg.solve(root, residual[:, :, None])
    weighed = np.linalg.solve(root.transpose(0, 2, 1), whitened)
    adjusted = seen + (carried.transpose(0, 2, 1) @ weighed)[:, :, 0]
    return _design(root, adjusted), whitened[:, :, 0]


def _design(root: Floats, true: Floats) -> Floats:
    """Return the derivatives of (v₁, v₃) by (a, b, S₃) at (δ, F), over the root of W."""
    design = np.zeros((len(true), 2, 3))
    design[:, 0, :2] = true
    design[:, 1, 2] = true[:, 1]
    return np.asarray(np.linalg.solve(root, design))


def reading_variances(readings: Readings, instruments: Instruments) -> Floats:
    """Return the variances of δ, F, v₁ and v₃ as read, shape (n, 4)."""
    volts = np.column_stack((readings.v1, readings.v3))
    finest = (FINEST * np.max(np.abs(volts), axis=0)) ** 2
    return np.column_stack(
        (
            instruments.deflection_variance(readings.deflection, readings.deflection_looks),
            instruments.force_variance(readings.force, readings.force_looks),
            np.maximum(instruments.voltage_variance(volts), finest),
        )
    )


def expected_design(
    readings: Readings, instruments: Instruments, figures: tuple[float, float, float]
) -> Floats:
    """Return the whitened derivatives, shape (n, 2, 3), at readings that are true: for a plan."""
    return _whitened(np.array(figures), readings, instruments)[0]
