"""The joint fit of v₁ = a·δ + b·F and v₃ = S₃·F with errors in all variables.

Maximum likelihood for known error variances (weighted total least squares), over the true δ and F
of each reading as well as a, b and S₃. The force is measured twice, by the spring scale and by the
strain gauge's v₃. With the residuals r = (v₁ − a·δ − b·F, v₃ − S₃·F) and J = ((a, b), (0, S₃)), the
problem reduces to

    minimise  Σ rᵀ·W⁻¹·r,    W = J·diag(u_δ², u_F²)·Jᵀ + diag(u_v₁², u_v₃²)

by Gauss-Newton. The derivative of r by (a, b, S₃) uses the adjusted (δ̂, F̂), the estimates of the
true values. Ordinary least squares uses the measured ones instead, which causes its bias. The
estimates depend only on the ratios of the variances; their errors are from the residuals.

Each force held on another control of the same structure adds one true value and one parameter:
r₁ = v₁ − a·δ − b·F − Σ_j c_j·F_j, and K_j = −c_j/a.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.fit import LineFit, error_variance, line_fit, solve
from coupled.calibration.readings import Readings
from coupled.calibration.sandwich import Sandwich, sandwich

Floats = NDArray[np.float64]
MOST_STEPS = 100
BLIND = 1e6  # of the greatest force: standard deviation of a v3 that nobody read
FINEST = 1e-6  # of the largest voltage: least error of a meter, which keeps W regular


@dataclass(frozen=True)
class JointFit:
    """S₁ and K (`line`) and S₃ in V/N, fitted together; `errors` are those of (a, b, S₃, c…).

    `others`: {another control: the bend K_j in d/N by a force on it}.
    """

    line: LineFit
    s3: Estimate
    errors: Sandwich
    others: Mapping[str, Estimate]

    def estimate(self, value: float, by_s1: float, by_bend: float, by_s3: float) -> Estimate:
        """Return a function of S₁, K and S₃ with its error, from its derivatives."""
        a, b = self.line.s1.value, -self.line.bend.value * self.line.s1.value
        slope = np.zeros(len(self.errors.back))
        slope[:3] = by_s1 + by_bend * b / a**2, -by_bend / a, by_s3
        return self.errors.estimate(value, slope)

    @property
    def correlation(self) -> Floats:
        """The correlation of the errors of S₁, K and S₃, shape (3, 3); 0 for zero errors."""
        a, b = self.line.s1.value, -self.line.bend.value * self.line.s1.value
        slopes = np.array([[1.0, 0.0, 0.0], [b / a**2, -1.0 / a, 0.0], [0.0, 0.0, 1.0]])
        found = slopes @ self.errors.covariance[:3, :3] @ slopes.T
        error = np.sqrt(np.diag(found))
        size = np.outer(error, error)
        return np.asarray(np.divide(found, size, out=np.eye(3), where=size > 0.0))


def errors_in_variables(readings: Readings, instruments: Instruments) -> JointFit:
    """Return the fit with errors of δ, F, v₁ and v₃.

    Raises FloatingPointError if it does not converge.
    """
    force, v3 = readings.force, readings.v3
    columns = np.column_stack((readings.deflection, force, readings.others))
    a, b, *c = solve(columns, readings.v1)
    figures = np.array([a, b, force @ v3 / (force @ force), *c])
    for _ in range(MOST_STEPS):
        design, whitened = _whitened(figures, readings, instruments)
        step = solve(design.reshape(-1, len(figures)), whitened.ravel())
        figures = figures + step
        least = _settled(figures, columns)
        if not readings.gauge:
            least[2] = np.inf  # no reading determines S₃, and its steps are rounding
        if np.all(np.abs(step) <= least):
            break
    else:
        raise FloatingPointError
    a, b, s3, *c = (float(figure) for figure in figures)
    errors = sandwich(*_whitened(figures, readings, instruments))
    residual = readings.v1 - columns @ np.array([a, b, *c])
    line = line_fit(a, b, errors, residual, error_variance(a, b, readings, instruments, c))
    unit = np.eye(len(figures))
    others = {
        name: errors.estimate(-at / a, (at / a * unit[0] - unit[3 + j]) / a)
        for j, (name, at) in enumerate(zip(readings.other_names, c, strict=True))
    }
    return JointFit(line, errors.estimate(s3, unit[2]), errors, others)


def _settled(figures: Floats, columns: Floats) -> Floats:
    """Return the step sizes at which the fit has converged; b and c may truly be zero."""
    least = 1e-12 * np.abs(figures)
    size = np.max(np.abs(columns), axis=0, initial=1e-300)
    own = 1e-12 * abs(figures[0]) * size[0] / size[1:]
    least[1] = max(least[1], own[0])
    least[3:] = np.maximum(least[3:], own[1:])
    return np.asarray(least)


def _whitened(
    figures: Floats, readings: Readings, instruments: Instruments
) -> tuple[Floats, Floats]:
    """Return the whitened derivatives of r by (a, b, S₃, c…), shape (n, 2, p), and r, (n, 2)."""
    a, b, s3, *c = figures
    seen = np.column_stack((readings.deflection, readings.force, readings.others))
    volts = np.column_stack((readings.v1, readings.v3))
    jacobian = np.array([[a, b, *c], [0.0, s3, *(0.0 for _ in c)]])
    own = reading_variances(readings, instruments)
    looked = np.column_stack((own[:, :2], instruments.force_variance(readings.others)))
    carried = jacobian[None] * looked[:, None, :]
    root = np.linalg.cholesky(carried @ jacobian.T + own[:, 2:, None] * np.eye(2))
    residual = volts - seen @ jacobian.T
    whitened = np.linalg.solve(root, residual[:, :, None])
    weighed = np.linalg.solve(root.transpose(0, 2, 1), whitened)
    adjusted = seen + (carried.transpose(0, 2, 1) @ weighed)[:, :, 0]
    return _design(root, adjusted), whitened[:, :, 0]


def _design(root: Floats, true: Floats) -> Floats:
    """Return the derivatives of (v₁, v₃) by (a, b, S₃, c…) at (δ, F, F_j…), over W's root."""
    design = np.zeros((len(true), 2, 1 + true.shape[1]))
    design[:, 0, :2] = true[:, :2]
    design[:, 1, 2] = true[:, 1]
    design[:, 0, 3:] = true[:, 2:]
    return np.asarray(np.linalg.solve(root, design))


def reading_variances(readings: Readings, instruments: Instruments) -> Floats:
    """Return the variances of δ, F, v₁ and v₃ as read, shape (n, 4)."""
    volts = np.column_stack((readings.v1, readings.v3))
    finest = (FINEST * np.max(np.abs(volts), axis=0)) ** 2
    own = np.maximum(instruments.voltage_variance(volts), finest)
    if not readings.gauge:
        own[:, 1] = (BLIND * np.max(np.abs(volts[:, 1]))) ** 2
    return np.column_stack(
        (
            instruments.deflection_variance(readings.deflection, readings.deflection_looks),
            instruments.force_variance(readings.force, readings.force_looks),
            own,
        )
    )


def expected_design(
    readings: Readings, instruments: Instruments, figures: Sequence[float]
) -> Floats:
    """Return the whitened derivatives, shape (n, 2, p), at error-free readings: for a plan."""
    return _whitened(np.array(figures), readings, instruments)[0]
