"""Least squares in two phases: with coarse steps of the loader, then with its own steps.

Coarse steps (`steps`) are enough far from the optimum, and for all derivatives. The second phase
minimises the residual at the loader's own steps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.gap.search.damped import descend
from coupled.gap.search.slopes import Ends, Floats, Slope, Slopes
from coupled.gap.signals.output import memory
from coupled.gap.thresholds import (
    COARSE_DIFFERENCE,
    ENOUGH,
    FEWER,
    FIT_ITERATIONS,
    NOISE_LEFT,
    RACE_BEHIND,
    RACE_EVALUATIONS,
)

Rows = NDArray[np.bool_] | slice
EVERY = slice(None)


class Residual(Protocol):
    """The residual in noise floors as a function of scaled parameters.

    `coarse`: with coarse steps of the loader. `rough`: approximate, for derivatives.
    """

    def __call__(self, scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        """Return the residual, shape (frames,)."""


@dataclass(frozen=True)
class End:
    """The result of least squares: scaled parameters, residual and Jacobian of the fitted rows.

    `cost` is half the residual's sum of squares, `slope` the Jacobian of all rows, if kept.
    """

    x: Floats
    cost: float
    fun: Floats
    jac: Floats
    slope: Slope | None


@dataclass(frozen=True)
class Descent:
    """The options of a fit: its `steps` of the loader, and `most` evaluations in each phase.

    Steps are `own` if the start is near the optimum, `coarse` if only a comparison is needed, or
    `both`. `known` caches fits to the same outputs. `slopes` are Jacobians of a fit that ended at
    the start, by its keys. For `dry` friction the fit stops at a larger gain per step: the last
    steps gain less than the data can show. Columns of the Jacobian in `held` are reused (`Slopes`).
    """

    steps: Literal["coarse", "own", "both"] = "both"
    most: int = FIT_ITERATIONS
    known: dict[Any, Any] | None = field(default=None, repr=False, compare=False)
    slopes: Mapping[tuple[str, ...], Slope | None] = field(
        default_factory=dict, repr=False, compare=False
    )
    dry: bool = False
    held: Floats | None = field(default=None, repr=False, compare=False)

    def end(
        self,
        residual: Residual,
        firsts: Sequence[Floats],
        ends: Ends,
        stepped: bool,
        rows: Rows = EVERY,
        slope: Slope | None = None,
    ) -> End:
        """Return the best minimum of some rows from several starts, between the bounds `ends`.

        If nothing is `stepped` finer than the frames, the second phase is skipped. With a single
        start, `slope` may be the Jacobian of another fit that ended there.
        """
        near, sloping = partial(residual, coarse=True), partial(residual, coarse=True, rough=True)
        best: End | None = None
        if self.steps != "own" or not stepped:
            share = COARSE_DIFFERENCE if stepped else 0.0
            search = _Search(near, sloping, ends, rows, share, not stepped, self.dry, self.held)
            best = self._raced(search, firsts, slope)
        if self.steps != "coarse" and stepped:
            first, known = (firsts[0], slope) if best is None else (best.x, best.slope)
            best = _Search(residual, sloping, ends, rows, dry=self.dry).down(
                first, self.most, known
            )
        assert best is not None
        return best

    def _raced(self, search: _Search, firsts: Sequence[Floats], slope: Slope | None) -> End:
        """Return the best minimum; starts far behind after a few evaluations are dropped."""
        if len(firsts) == 1:
            return search.down(firsts[0], self.most, slope)
        started = [search.down(first, RACE_EVALUATIONS) for first in firsts]
        started.sort(key=lambda one: one.cost)
        if self.most <= RACE_EVALUATIONS:
            return started[0]
        best = search.down(started[0].x, self.most, started[0].slope)
        for other in started[1:]:
            behind = other.cost > RACE_BEHIND * started[0].cost
            if behind or leaves_noise(best.cost, len(best.fun)):
                break
            best = min(best, search.down(other.x, self.most, other.slope), key=lambda one: one.cost)
        return best


WHOLE = Descent()


def leaves_noise(cost: float, frames: int) -> bool:
    """Tell whether half a sum of squares, noise floors², is that of noise alone."""
    return 2.0 * cost <= NOISE_LEFT**2 * frames


@dataclass(frozen=True)
class _Search:
    """Least squares of some rows, with derivatives of a residual that may be approximate."""

    residual: Any
    sloping: Any
    ends: Ends
    rows: Rows
    share: float = 0.0
    smooth: bool = False
    dry: bool = False
    held: Floats | None = None

    def down(self, first: Floats, most: int, slope: Slope | None = None) -> End:
        """Return the minimum from a start, with at most `most` evaluations.

        If the Jacobian was corrected by much, or corrected and its steps were rejected, differences
        are taken again at the end and the descent continues.
        """
        given = (self.rows, self.share, slope, self.smooth, self.held)
        slopes = Slopes(self.sloping, self.ends, *given)
        x0 = np.clip(first, self.ends[0] + 1e-9, self.ends[1] - 1e-9)
        frames = int(np.count_nonzero(self.rows)) if isinstance(self.rows, np.ndarray) else 0

        def enough(left: Floats) -> float:
            """Return the least relative decrease of the cost that a step must make."""
            times = min(memory(left), FEWER) if self.dry else 1.0
            return max(1e-5, ENOUGH * times / max(frames, 1000))

        def left(x: Floats) -> Floats:
            return np.asarray(self.residual(x)[self.rows])

        while True:
            found = descend(left, slopes, x0, self.ends, most, enough)
            most -= found.evaluations
            misled = found.rejected and slopes.corrections > 0
            if (slopes.sure and not misled) or most < 1:
                break
            slopes.renew()
            x0 = found.x
        known = None if slopes.last is None or misled else slopes.last.kept()
        return End(found.x, found.cost, found.fun, found.jac, known)
