"""Nonparametric models of a stage's residual.

Where the effects leave a residual, ridge regressions show whether the stage's own signals predict
it: piecewise linear functions of one signal, with knots at its quantiles, lagged copies, the same
filtered by the stage's response, or all signals with their pairwise products. The models are
fitted on every other stretch and compared on the stretches between.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.filters import filtered
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import BENDS, FLAT, RIDGES, LAGS_s

Floats = NDArray[np.float64]
Response = tuple[Floats, Floats]
ALL = "all"


def free_share(
    output: Output, left: Floats, signals: Mapping[str, Floats], response: Response | None = None
) -> tuple[float, str]:
    """Return the share of a residual's power that the best model predicts, 0 to 1, and its signal.

    `left` is the residual in noise floors, shape (frames,), as each signal. `response` is the
    digital filter from a force inside the stage to its output. The share is that on held-out
    stretches; the signal is `ALL` for a model of all signals.
    """
    plain = {name: (s - s.mean()) / s.std() for name, s in signals.items() if s.std() > 0.0}
    each = {name: _functions(signal, output.frame_rate_Hz) for name, signal in plain.items()}
    crossed = [a * b for a, b in combinations(plain.values(), 2)]
    if crossed:
        each[ALL] = np.column_stack((*each.values(), *crossed))
    best = 0.0, ""
    for name, columns in each.items():
        answers = [] if response is None else [filtered(*response, columns)]
        best = max(best, (_taken(output, left, np.hstack((columns, *answers))), name))
    return best


def _functions(signal: Floats, rate_Hz: float) -> Floats:
    """Return a model's functions of one signal, shape (frames, functions)."""
    found = [signal, *(np.maximum(signal - bend, 0.0) for bend in np.quantile(signal, BENDS))]
    for lag_s in LAGS_s:
        share = -np.expm1(-1.0 / (lag_s * rate_Hz))
        found.append(filtered([share], [1.0, share - 1.0], signal))
    return np.column_stack(found)


def _taken(output: Output, left: Floats, columns: Floats) -> float:
    """Return the share of the residual's power that the functions predict on held-out stretches.

    The held-out stretches also select the ridge parameter. The residual is autocorrelated, so
    cross-validation by single frames would overfit.
    """
    fitted = output.rows("fitted")
    remains = np.zeros(len(RIDGES))
    for known in (fitted, ~fitted):
        made = _ridges(columns[known], left[known], columns[~known])
        remains += np.sum((left[~known, None] - made) ** 2, axis=0)
    power = float(left @ left)
    return max(0.0, 1.0 - float(np.min(remains)) / power) if power > 0.0 else 0.0


def _ridges(known: Floats, wanted: Floats, asked: Floats) -> Floats:
    """Return the ridge regressions' predictions, shape (frames, RIDGES)."""
    spread = known.std(axis=0)
    varies = spread > FLAT * np.vstack((known, asked)).std(axis=0)
    mean, spread = known[:, varies].mean(axis=0), spread[varies]
    level = float(wanted.mean())
    left, sizes, right = np.linalg.svd((known[:, varies] - mean) / spread, full_matrices=False)
    passed = sizes[:, None] / (sizes[:, None] ** 2 + np.array(RIDGES) * len(wanted))
    weights = right.T @ (passed * (left.T @ (wanted - level))[:, None])
    return np.asarray(level + (asked[:, varies] - mean) / spread @ weights)
