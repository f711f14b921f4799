"""Damped Gauss-Newton steps between bounds, that end where the residual's jumps hide the rest.

Each step is the least of the residual as its slopes foretell it, within the bounds, and damped
(Levenberg 1944, Marquardt 1963; the damping goes by Nielsen, IMM-REP-1999-05). Friction, breakout
and play move a residual by small jumps. Near the end a step gains no more than those, and shorter
ones gain nothing that the record could tell: so a fit ends where little is foretold, or where two
steps on end bring nothing of the little that they foretold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from coupled.gap.thresholds import (
    DAMPED_MORE,
    DAMPING_FIRST,
    DAMPING_NEXT,
    HOPELESS,
    JUMPS_HIDE,
    REACHED,
    REFUSED,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reached:
    """Where the steps ended: numbers, residual, slopes, and how often the residual was asked for.

    `cost` is half the residual's sum of squares; `refused` says that steps which foretold more
    brought nothing.
    """

    x: Floats
    cost: float
    fun: Floats
    jac: Floats
    asked: int
    refused: bool


def descend(
    residual: Callable[[Floats], Floats],
    slopes: Callable[[Floats], Floats],
    first: Floats,
    ends: tuple[Floats, Floats],
    most: int,
    enough: Callable[[Floats], float],
) -> Reached:
    """Return the least of half a residual's sum of squares that is reached from the first numbers.

    `residual` has shape (frames,), `slopes` (frames, numbers). It asks for residuals `most` times
    at most. A step that foretells less than the share `enough` of the cost is the end, by the
    residual there.
    """
    x = np.clip(first, *ends)
    left, jacobian = residual(x), slopes(x)
    cost, asked = 0.5 * float(left @ left), 1
    damping, refused = DAMPING_FIRST, 0
    share = enough(left)
    # Slopes lead far beyond where a limit or a play stops to matter, and none leads back.
    reach = max(float(np.linalg.norm(x)), 1.0)
    scale = np.linalg.norm(jacobian, axis=0)
    while asked < most:
        near = np.maximum(ends[0], x - reach), np.minimum(ends[1], x + reach)
        step, foretold = _step(jacobian, left, x, near, damping, scale)
        if foretold <= share * cost:
            break
        there = np.clip(x + step, *ends)
        other = residual(there)
        asked += 1
        reached = 0.5 * float(other @ other)
        gain = (cost - reached) / foretold
        if gain <= 0.0:
            refused += 1
            if refused >= (REFUSED if foretold < JUMPS_HIDE * cost else HOPELESS):
                break
            damping = max(DAMPED_MORE * damping, DAMPING_NEXT)
            continue
        little = cost - reached <= share * cost
        x, left, cost, jacobian = there, other, reached, slopes(there)
        share = enough(left)
        scale = np.maximum(scale, np.linalg.norm(jacobian, axis=0))
        damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
        reach, refused = 2.0 * reach if gain > REACHED else reach, 0
        if little:
            break
    return Reached(x, cost, left, jacobian, asked, refused > 0)


def _step(
    jacobian: Floats,
    left: Floats,
    x: Floats,
    ends: tuple[Floats, Floats],
    damping: float,
    scale: Floats,
) -> tuple[Floats, float]:
    """Return a damped step that stays between the ends, and by what it foretells the cost to fall.

    The slopes are brought to a triangle first, so that the bounded problem is a small one.
    """
    base, triangle = np.linalg.qr(jacobian)
    against = base.T @ left
    sizes = np.where(scale > 0.0, scale, 1.0)
    rows = np.vstack((triangle / sizes, np.sqrt(damping) * np.eye(len(x))))
    wanted = np.concatenate((-against, np.zeros(len(x))))
    room = ((ends[0] - x) * sizes - 1e-12, (ends[1] - x) * sizes + 1e-12)
    step = lsq_linear(rows, wanted, room, method="bvls").x / sizes
    after = triangle @ step + against
    return step, 0.5 * float(against @ against - after @ after)
