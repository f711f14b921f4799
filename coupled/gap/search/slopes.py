"""The Jacobian of a residual by finite differences, and its reuse between iterations.

Differences cost a replay for each parameter. For a residual with jumps the last Jacobian is reused
while the residual has changed by less than a difference step. For a smooth residual it is corrected
by the error of its prediction of the last step (Broyden, Math. Comp. 19, 1965).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.thresholds import (
    DIFFERENCE,
    DIFFERENCE_STEPS,
    MISSED_LITTLE,
    MISSED_MOST,
    MOST_CORRECTIONS,
    MOVED_LEAST,
    MOVED_LITTLE,
    SLOPES_KEPT,
)
from coupled.parallel import in_threads

Floats = NDArray[np.float64]
Ends = tuple[Floats, Floats]


@dataclass(frozen=True)
class Slope:
    """The residual of all frames and its Jacobian, at the scaled parameters `at`.

    `residual` has shape (frames,), in noise floors, `jacobian` (frames, parameters).
    """

    at: Floats
    residual: Floats
    jacobian: Floats

    def kept(self) -> Slope | None:
        """Return the Jacobian, to start another fit with; None if it is too large to keep."""
        return self if self.jacobian.size <= SLOPES_KEPT else None


class Slopes:
    """Finite differences over steps that change the residual by about a third of a noise floor.

    Friction, breakout and play make the residual jump by small amounts: a difference over less is
    no derivative of the fit's cost. Far from the optimum the jumps are larger, and a step changes
    the residual by at least a `share` of it. A residual without jumps is `smooth`. `last` is the
    last Jacobian, possibly of another fit of the same parameters to the same frames. Columns of
    `held` without NaN are reused, shape (frames, parameters).
    """

    def __init__(
        self,
        residual: Callable[[Floats], Floats],
        ends: Ends,
        rows: NDArray[np.bool_] | slice,
        share: float = 0.0,
        last: Slope | None = None,
        smooth: bool = False,
        held: Floats | None = None,
    ) -> None:
        self._residual, self._rows, self._share = residual, rows, share
        self._smooth, self._held = smooth, held
        self._low, self._high = ends
        self._step = np.full(len(self._low), 0.01)
        self.last = last
        self.corrections = 0  # since the last differences
        self.sure = True  # the prediction errors were small

    def __call__(self, x: Floats) -> Floats:
        """Return the Jacobian of the fitted rows, shape (rows, parameters)."""
        here = self._residual(x)
        jacobian = self._still_good(x, here)
        if jacobian is None:
            jacobian = self._differences(x, here)
            self.last, self.corrections = Slope(x.copy(), here, jacobian), 0
            self.sure = True
        return np.asarray(jacobian[self._rows])

    def renew(self) -> None:
        """Discard the last Jacobian, so that differences are taken next."""
        self.last = None

    def _still_good(self, x: Floats, here: Floats) -> Floats | None:
        """Return the last Jacobian, corrected if need be; None if it no longer holds."""
        last = self.last
        if last is None or len(last.residual) != len(here):
            return None
        moved, step = here - last.residual, x - last.at
        size = _rms(moved)
        if not self._smooth or size <= MOVED_LEAST:
            return last.jacobian if size <= MOVED_LITTLE else None
        missed = _rms(moved - last.jacobian @ step)
        if self.corrections >= MOST_CORRECTIONS or missed > MISSED_MOST * size:
            return None
        change = np.outer(moved - last.jacobian @ step, step / float(step @ step))
        self.last = Slope(x.copy(), here, last.jacobian + change)
        self.corrections += 1
        self.sure = self.sure and missed <= MISSED_LITTLE * size
        return self.last.jacobian

    def _differences(self, x: Floats, here: Floats) -> Floats:
        wanted = max(DIFFERENCE, self._share * _rms(here[self._rows]))

        def column(i: int) -> Floats:
            if self._held is not None and not np.isnan(self._held[0, i]):
                return self._held[:, i]
            value = x[i]
            room = max(self._high[i] - value, value - self._low[i])
            step = min(self._step[i], 0.5 * room)
            there = x.copy()
            there[i] = value + (step if self._high[i] - value > step else -step)
            change = self._residual(there) - here
            growth = np.clip(wanted / max(_rms(change[self._rows]), 1e-9), 0.1, 10.0)
            self._step[i] = float(np.clip(step * growth, *DIFFERENCE_STEPS))
            return np.asarray(change / (there[i] - value))

        return np.column_stack(in_threads(column, range(len(x))))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))
