"""Levenberg-Marquardt least squares between bounds, for residuals with small jumps.

Each step minimises the linearised residual within the bounds, with damping (Levenberg 1944,
Marquardt 1963; damping updated after Nielsen, IMM-REP-1999-05). Friction, breakout and play make
the residual jump by small amounts. Near the minimum the predicted decrease is smaller than the
jumps. The descent therefore ends at a small predicted decrease, or after several rejected steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from coupled.gap.thresholds import (
    DAMPING_FACTOR,
    DAMPING_FIRST,
    DAMPING_NEXT,
    JUMPS_SHARE,
    MOST_REJECTED,
    REACHED,
    REJECTED,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reached:
    """The result of a descent: parameters, residual, Jacobian and residual evaluations.

    `cost` is half the residual's sum of squares. `rejected`: the last steps did not decrease it.
    """

    x: Floats
    cost: float
    fun: Floats
    jac: Floats
    evaluations: int
    rejected: bool


def descend(
    residual: Callable[[Floats], Floats],
    slopes: Callable[[Floats], Floats],
    first: Floats,
    ends: tuple[Floats, Floats],
    most: int,
    enough: Callable[[Floats], float],
) -> Reached:
    """Minimise half a residual's sum of squares from the first parameters, between bounds `ends`.

    `residual` returns shape (frames,), `slopes` its Jacobian, (frames, parameters). At most `most`
    residuals are evaluated. `enough` returns the relative decrease of the cost by the residual; the
    descent ends at a smaller predicted decrease.
    """
    x = np.clip(first, *ends)
    current, jacobian = residual(x), slopes(x)
    cost, evaluations = 0.5 * float(current @ current), 1
    damping, rejected = DAMPING_FIRST, 0
    share = enough(current)
    # Beyond a saturation (a limit, a play) the Jacobian vanishes: the step is limited.
    reach = max(float(np.linalg.norm(x)), 1.0)
    scale = np.linalg.norm(jacobian, axis=0)
    while evaluations < most:
        near = np.maximum(ends[0], x - reach), np.minimum(ends[1], x + reach)
        step, predicted = _step(jacobian, current, x, near, damping, scale)
        if predicted <= share * cost:
            break
        trial = np.clip(x + step, *ends)
        trial_residuals = residual(trial)
        evaluations += 1
        reached = 0.5 * float(trial_residuals @ trial_residuals)
        gain = (cost - reached) / predicted
        if gain <= 0.0:
            rejected += 1
            if rejected >= (REJECTED if predicted < JUMPS_SHARE * cost else MOST_REJECTED):
                break
            damping = max(DAMPING_FACTOR * damping, DAMPING_NEXT)
            continue
        little = cost - reached <= share * cost
        x, current, cost, jacobian = trial, trial_residuals, reached, slopes(trial)
        share = enough(current)
        scale = np.maximum(scale, np.linalg.norm(jacobian, axis=0))
        damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
        reach, rejected = 2.0 * reach if gain > REACHED else reach, 0
        if little:
            break
    return Reached(x, cost, current, jacobian, evaluations, rejected > 0)


def _step(
    jacobian: Floats,
    current: Floats,
    x: Floats,
    ends: tuple[Floats, Floats],
    damping: float,
    scale: Floats,
) -> tuple[Floats, float]:
    """Return a damped step between the bounds, and the predicted decrease of the cost.

    The Jacobian is reduced by a QR factorisation, so that the bounded problem is small.
    """
    base, triangle = np.linalg.qr(jacobian)
    against = base.T @ current
    sizes = np.where(scale > 0.0, scale, 1.0)
    rows = np.vstack((triangle / sizes, np.sqrt(damping) * np.eye(len(x))))
    wanted = np.concatenate((-against, np.zeros(len(x))))
    room = ((ends[0] - x) * sizes - 1e-12, (ends[1] - x) * sizes + 1e-12)
    step = lsq_linear(rows, wanted, room, method="bvls").x / sizes
    after = triangle @ step + against
    return step, 0.5 * float(against @ against - after @ after)
