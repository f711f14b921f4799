"""How least squares go down to where a fit ends: by wide steps of the loader, then by its own.

Far from the end, and for slopes everywhere, wide steps do (`steps`); what the fit ends at makes the
residual by the loader's own steps least.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from coupled.gap.thresholds import (
    DIFFERENCE,
    DIFFERENCE_STEPS,
    FIT_ITERATIONS,
    NOISE_LEFT,
    RACE_BEHIND,
    RACE_EVALUATIONS,
    WIDE_DIFFERENCE,
)
from coupled.parallel import in_threads

Floats = NDArray[np.float64]
Ends = tuple[Floats, Floats]


class Residual(Protocol):
    """Scaled parameters' residual in floors, by wide steps of the loader where asked for."""

    def __call__(self, scaled: Floats, wide: bool = False) -> Floats:
        """Return it, shape (frames,)."""


@dataclass(frozen=True)
class Descent:
    """By which `steps` of the loader, and by how many evaluations at `most` with each.

    By its `own` alone from a start that is near; by `wide` ones alone where the end is not needed.
    `known` remembers what was fitted to the same outputs, so that none is fitted twice.
    """

    steps: Literal["wide", "own", "both"] = "both"
    most: int = FIT_ITERATIONS
    known: dict[Any, Any] | None = field(default=None, repr=False, compare=False)

    def end(self, residual: Residual, firsts: Sequence[Floats], ends: Ends, stepped: bool) -> Any:
        """Return the least that is reached from several starts, between two `ends`.

        Where nothing is `stepped` finer than the frames, all steps are alike.
        """
        near = partial(residual, wide=True)
        if self.steps != "own" or not stepped:
            share = WIDE_DIFFERENCE if stepped else 0.0
            best = self._raced(near, firsts, ends, share)
            firsts = [best.x]
        if self.steps != "wide" and stepped:
            slopes = _Slopes(near, ends)
            best = _descended(residual, slopes, firsts[0], ends, self.most)
        return best

    def _raced(self, near: Any, firsts: Sequence[Floats], ends: Ends, share: float) -> Any:
        """Return the least that is reached; a start soon far behind the best is given up."""

        def down(first: Floats, most: int) -> Any:
            return _descended(near, _Slopes(near, ends, share), first, ends, most)

        if len(firsts) == 1:
            return down(firsts[0], self.most)
        begun = [down(first, RACE_EVALUATIONS) for first in firsts]
        begun.sort(key=lambda one: float(one.cost))
        if self.most <= RACE_EVALUATIONS:
            return begun[0]
        best = down(begun[0].x, self.most)
        for other in begun[1:]:
            behind = other.cost > RACE_BEHIND * begun[0].cost
            if behind or leaves_noise(best.cost, len(best.fun)):
                break
            best = min(best, down(other.x, self.most), key=lambda one: float(one.cost))
        return best


WHOLE = Descent()


def leaves_noise(cost: float, frames: int) -> bool:
    """Tell whether half a sum of squares, floors², is that of so many frames of noise."""
    return 2.0 * cost <= NOISE_LEFT**2 * frames


def _descended(residual: Any, slopes: _Slopes, first: Floats, ends: Ends, most: int) -> Any:
    """Return where least squares lead from a start, by slopes that may be another residual's."""
    x0 = np.clip(first, ends[0] + 1e-9, ends[1] - 1e-9)
    until = {"xtol": 1e-4, "ftol": 1e-5, "max_nfev": most}
    return least_squares(residual, x0, slopes, bounds=ends, **until)


class _Slopes:
    """Derivatives by differences, over steps that change the residual by about a third of a floor.

    Friction, breakout and play move the residual in small jumps: a difference over less than
    those says nothing of where the fit should go, nor of how well it knows. Far from the end the
    jumps are larger: a difference is over no less than a `share` of the residual.
    """

    def __init__(self, residual: Any, ends: Ends, share: float = 0.0) -> None:
        self._residual, self._share = residual, share
        self._low, self._high = ends
        self._step = np.full(len(self._low), 0.01)

    def __call__(self, x: Floats) -> Floats:
        here = self._residual(x)
        wanted = max(DIFFERENCE, self._share * float(np.sqrt(np.mean(here**2))))

        def column(i: int) -> Floats:
            value = x[i]
            room = max(self._high[i] - value, value - self._low[i])
            step = min(self._step[i], 0.5 * room)
            there = x.copy()
            there[i] = value + (step if self._high[i] - value > step else -step)
            change = self._residual(there) - here
            size = float(np.sqrt(np.mean(change**2)))
            growth = np.clip(wanted / max(size, 1e-9), 0.1, 10.0)
            self._step[i] = float(np.clip(step * growth, *DIFFERENCE_STEPS))
            return np.asarray(change / (there[i] - value))

        return np.column_stack(in_threads(column, range(len(x))))
