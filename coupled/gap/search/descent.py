"""How least squares go down to where a fit ends: by wide steps of the loader, then by its own.

Far from the end, and for slopes everywhere, wide steps do (`steps`); what the fit ends at makes the
residual by the loader's own steps least.
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
    ENOUGH,
    FEWER,
    FIT_ITERATIONS,
    NOISE_LEFT,
    RACE_BEHIND,
    RACE_EVALUATIONS,
    WIDE_DIFFERENCE,
)

Rows = NDArray[np.bool_] | slice
EVERY = slice(None)


class Residual(Protocol):
    """Scaled parameters' residual in floors, by wide steps of the loader where asked for.

    A `rough` one is to take slopes by.
    """

    def __call__(self, scaled: Floats, wide: bool = False, rough: bool = False) -> Floats:
        """Return it, shape (frames,)."""


@dataclass(frozen=True)
class End:
    """Where least squares end: scaled numbers, residual and Jacobian of the rows that were fitted.

    `cost` is half the residual's sum of squares, `slope` what is known of all rows.
    """

    x: Floats
    cost: float
    fun: Floats
    jac: Floats
    slope: Slope | None


@dataclass(frozen=True)
class Descent:
    """By which `steps` of the loader, and by how many evaluations at `most` with each.

    By its `own` alone from a start that is near; by `wide` ones alone where the end is not needed.
    `known` remembers what was fitted to the same outputs, so that none is fitted twice; `slopes`
    are those of a fit to them that ended at the start, by the keys of its numbers. Of dry friction,
    which `rubs`, the last steps along a valley gain what no record tells, and a fit ends sooner.
    Slopes of `held` are taken over (`Slopes`): where the first of many starts is looked for.
    """

    steps: Literal["wide", "own", "both"] = "both"
    most: int = FIT_ITERATIONS
    known: dict[Any, Any] | None = field(default=None, repr=False, compare=False)
    slopes: Mapping[tuple[str, ...], Slope | None] = field(
        default_factory=dict, repr=False, compare=False
    )
    rubs: bool = False
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
        """Return the least of some rows that is reached from several starts, between two `ends`.

        Where nothing is `stepped` finer than the frames, all steps are alike. With a single start,
        `slope` may be what another fit that ended there knew.
        """
        near, sloping = partial(residual, wide=True), partial(residual, wide=True, rough=True)
        best: End | None = None
        if self.steps != "own" or not stepped:
            share = WIDE_DIFFERENCE if stepped else 0.0
            search = _Search(near, sloping, ends, rows, share, not stepped, self.rubs, self.held)
            best = self._raced(search, firsts, slope)
        if self.steps != "wide" and stepped:
            first, known = (firsts[0], slope) if best is None else (best.x, best.slope)
            best = _Search(residual, sloping, ends, rows, rubs=self.rubs).down(
                first, self.most, known
            )
        assert best is not None
        return best

    def _raced(self, search: _Search, firsts: Sequence[Floats], slope: Slope | None) -> End:
        """Return the least that is reached; a start soon far behind the best is given up."""
        if len(firsts) == 1:
            return search.down(firsts[0], self.most, slope)
        begun = [search.down(first, RACE_EVALUATIONS) for first in firsts]
        begun.sort(key=lambda one: one.cost)
        if self.most <= RACE_EVALUATIONS:
            return begun[0]
        best = search.down(begun[0].x, self.most, begun[0].slope)
        for other in begun[1:]:
            behind = other.cost > RACE_BEHIND * begun[0].cost
            if behind or leaves_noise(best.cost, len(best.fun)):
                break
            best = min(best, search.down(other.x, self.most, other.slope), key=lambda one: one.cost)
        return best


WHOLE = Descent()


def leaves_noise(cost: float, frames: int) -> bool:
    """Tell whether half a sum of squares, floors², is that of so many frames of noise."""
    return 2.0 * cost <= NOISE_LEFT**2 * frames


@dataclass(frozen=True)
class _Search:
    """Least squares of some rows, by slopes that may be another residual's."""

    residual: Any
    sloping: Any
    ends: Ends
    rows: Rows
    share: float = 0.0
    smooth: bool = False
    rubs: bool = False
    held: Floats | None = None

    def down(self, first: Floats, most: int, slope: Slope | None = None) -> End:
        """Return where they lead from a start, by so many evaluations at most.

        Slopes that were corrected by much, or corrected and led nowhere, are taken anew at the end,
        and may lead on.
        """
        given = (self.rows, self.share, slope, self.smooth, self.held)
        slopes = Slopes(self.sloping, self.ends, *given)
        x0 = np.clip(first, self.ends[0] + 1e-9, self.ends[1] - 1e-9)
        frames = int(np.count_nonzero(self.rows)) if isinstance(self.rows, np.ndarray) else 0

        def enough(left: Floats) -> float:
            """Return the share of the cost that a step must gain, by what is left."""
            times = min(memory(left), FEWER) if self.rubs else 1.0
            return max(1e-5, ENOUGH * times / max(frames, 1000))

        def left(x: Floats) -> Floats:
            return np.asarray(self.residual(x)[self.rows])

        while True:
            found = descend(left, slopes, x0, self.ends, most, enough)
            most -= found.asked
            misled = found.refused and slopes.corrections > 0
            if (slopes.sure and not misled) or most < 1:
                break
            slopes.renew()
            x0 = found.x
        known = None if slopes.last is None or misled else slopes.last.kept()
        return End(found.x, found.cost, found.fun, found.jac, known)
