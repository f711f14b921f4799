"""What a richer law of a bend or a servo would gain, and where its fit begins.

The score test (Rao, Math. Proc. Camb. Phil. Soc. 44, 1948) at the plainer law's end, by slopes that
are taken anew. A fit of numbers that make up for each other, as a servo's dead time and its
frequency do, ends in a long valley, and its own slopes are too coarse to say what lies across it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, Parameter, possible
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.laws import Starts, of_a_slope, slope_of, turned
from coupled.gap.signals.output import Output, memory
from coupled.parallel import go_on

Floats = NDArray[np.float64]
SLOPE_SHARE = 0.05  # chosen: of an interval, over which slopes are taken anew


@dataclass(frozen=True)
class Try:
    """Where a fit of a richer law may begin, and the log-likelihood that it is foretold to gain.

    `most` is what it may be said to gain, where its slopes go as far as the law: a fit that gains
    more than they foretell has gone along a valley, where the model's own error is as large.
    """

    gain: float
    start: dict[str, float]
    most: float = np.inf


@dataclass(frozen=True)
class _Residual:
    """What rigs leave of the outputs that a law shows in, in floors, on all of the record."""

    case: Case
    outputs: Sequence[Output]

    def by(self, effects: Sequence[Effect], values: Mapping[str, float]) -> Floats | None:
        """Return it for effects of these sizes, shape (frames,); None where no rig has them."""
        case, every = self.case, [*effects, *self.case.nuisances(effects)]
        rig = possible(case.nominal, case.control, every, {**case.neutral, **values})
        if rig is None:
            return None
        go_on()
        each = [output.residual(rig, wide=True)[output.rows("all")] for output in self.outputs]
        return np.concatenate(each)

    def slopes(self, fitted: Fit, numbers: Sequence[str]) -> Floats | None:
        """Return its slopes at a fit's end by what each number moves it by, (frames, numbers)."""
        columns = list[Floats]()
        for key in numbers:
            step = SLOPE_SHARE * (fitted.high[key] - fitted.low[key])
            sides = (fitted.values[key] - step, fitted.values[key] + step)
            less, more = (self.by(fitted.effects, {**fitted.values, key: one}) for one in sides)
            if step <= 0.0 or less is None or more is None:
                return None
            columns.append((more - less) / (2.0 * step))
        return np.stack(columns, axis=1) if columns else None


def scored(case: Case, law: Effect, plain: Effect, fitted: Fit, tries: Starts) -> list[Try]:
    """Return the tries of a richer law with what each is foretold to gain over the plainer one.

    On all of the record. Of a law with a factor that begins at 1 the try is moved to where slopes
    foretell most. Where there are no slopes all may gain.
    """
    keys, _ = slope_of(plain, fitted)
    numbers = [key for key in keys if key in fitted.low]
    residual = _Residual(case, of_a_slope(case, fitted, keys))
    slopes = residual.slopes(fitted, numbers)
    left = residual.by(fitted.effects, fitted.values) if slopes is not None else None
    effects = [law if one is plain else one for one in fitted.effects]
    ends = [residual.by(effects, start) for start in tries] if left is not None else []
    if slopes is None or left is None or any(one is None for one in ends):
        return [Try(np.inf, start) for start in tries]
    base, mixing = np.linalg.qr(slopes)
    memories = max(memory(output.residual(fitted.rig, wide=True)) for output in residual.outputs)
    unit = float(np.mean(left**2)) * memories
    renamed = {plain.value_key(p): law.value_key(p) for p in plain.free}
    found = list[Try]()
    for start, end in zip(tries, ends, strict=True):
        less, power, along = turned(left, base, np.asarray(end) - left)
        part = min(max(less, 0.0) / power, 1.0) if power > 0.0 else 0.0
        gain = 0.5 * less * less / power / unit if part > 0.0 else 0.0
        back = np.linalg.lstsq(mixing, part * along + base.T @ left, rcond=None)[0]
        moved = {renamed.get(key, key): -float(b) for key, b in zip(numbers, back, strict=True)}
        begun = _moved(law, plain, start, moved, part)
        found.append(Try(gain, begun, np.inf if begun == start else gain))
    return found


def _moved(
    law: Effect, plain: Effect, start: Mapping[str, float], moved: Mapping[str, float], part: float
) -> dict[str, float]:
    """Return a start by so large a part of what makes a law richer, and the others moved along.

    What is no factor that begins at 1 has no size of nothing to go a part of the way from.
    """
    shared = {p.key for p in plain.free}
    more = [p for p in law.free if p.key not in shared]
    if not all(begins_at_one(p) for p in more) or part == 0.0:
        return dict(start)
    values = {**start, **{key: start[key] + by for key, by in moved.items() if key in start}}
    values |= {law.value_key(p): 1.0 + part * (start[law.value_key(p)] - 1.0) for p in more}
    bounds = {law.value_key(p): (p.low, p.high) for p in law.free}
    return {
        k: min(max(v, bounds[k][0]), bounds[k][1]) if k in bounds else v for k, v in values.items()
    }


def begins_at_one(number: Parameter) -> bool:
    """Tell whether a number is a factor that begins at 1, so that it changes nothing there."""
    return number.mode == "factor" and number.starts == (1.0,)
