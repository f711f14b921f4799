"""The fit v₁ = a·δ + b·F when ruler, spring scale and voltmeter all err.

Maximum likelihood for known error variances u² (a weighted total least squares): over
the true δ and F as well as a and b, it comes down to

    minimise  Q(a, b) = Σ (a·δ + b·F − v₁)² / w,    w = a²·u_δ² + b²·u_F² + u_v²

by Gauss-Newton; the derivative of a whitened residual by (a, b) is the reading's own
adjusted (δ̂, F̂), the best guess of what was true, over √w. Ordinary least squares has
the measured ones there instead, whence its bias. Only the ratios of the variances matter
for the figures; their errors come from the residuals.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Instruments
from coupled.calibration.fit import LineFit, error_variance, line_fit, solve

Floats = NDArray[np.float64]
MOST_STEPS = 100


def errors_in_variables(
    deflection: Floats, force: Floats, v1: Floats, instruments: Instruments
) -> LineFit:
    """Return the fit that allows for errors of δ in d, F in N and v₁ in V.

    Without any error of the instruments it is the ordinary fit. Raises FloatingPointError
    where it does not settle.
    """
    a, b = solve(np.column_stack((deflection, force)), v1)
    if not np.any(error_variance(a, b, deflection, force, v1, instruments)):
        design = np.column_stack((deflection, force))
        nothing = np.zeros_like(v1)
        return line_fit(design, a, b, v1 - design @ np.array([a, b]), nothing)
    for _ in range(MOST_STEPS):
        adjusted, whitened, weight = _adjusted(a, b, deflection, force, v1, instruments)
        step = solve(adjusted / weight[:, None], whitened)
        a, b = a - step[0], b - step[1]
        if np.abs(step[0]) <= 1e-13 * abs(a) and np.abs(step[1]) <= 1e-12 * abs(b):
            break
    else:
        raise FloatingPointError
    adjusted, whitened, weight = _adjusted(a, b, deflection, force, v1, instruments)
    found = line_fit(adjusted / weight[:, None], a, b, -whitened, np.ones_like(whitened))
    residual = v1 - a * deflection - b * force
    return LineFit(found.s1, found.bend, found.correlation, residual, found.excess)


def _adjusted(
    a: float, b: float, deflection: Floats, force: Floats, v1: Floats, instruments: Instruments
) -> tuple[Floats, Floats, Floats]:
    """Return the adjusted (δ̂, F̂), shape (n, 2), the whitened residuals, and √w in V."""
    variance = error_variance(a, b, deflection, force, v1, instruments)
    residual = a * deflection + b * force - v1
    share = residual / variance
    adjusted = np.column_stack(
        (
            deflection - share * a * instruments.deflection_variance(deflection),
            force - share * b * instruments.force_variance(force),
        )
    )
    weight = np.sqrt(variance)
    return adjusted, residual / weight, weight
