"""What a model that is free in form could still take of a stage's residual.

The effects of the library are physics, each with a number or two. Where they leave structure, a
ridge regression on the stage's own signals tells whether these could explain it: with bends at
their quantiles, products of two, and lagged copies. It is fitted on every other stretch and held
against those between, so noise is not taken.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from coupled.gap.output import Output

Floats = NDArray[np.float64]
BENDS = (0.1, 0.3, 0.5, 0.7, 0.9)  # quantiles of a signal where its function may bend
LAGS_s = (0.03, 0.1, 0.3, 1.0)
RIDGES = tuple(10.0**k for k in range(-6, 7))


def free_share(output: Output, left: Floats, signals: Iterable[Floats]) -> float:
    """Return the share of a residual's power that a free model of the signals takes, 0 to 1.

    `left` is the residual in floors, shape (frames,), as each signal. It is counted on held-out
    stretches.
    """
    columns = _columns(list(signals), output.frame_rate_Hz)
    remains = np.empty_like(left)
    fitted = output.rows("fitted")
    for known in (fitted, ~fitted):
        remains[~known] = left[~known] - _ridge(columns[known], left[known], columns[~known])
    power = float(left @ left)
    return max(0.0, 1.0 - float(remains @ remains) / power) if power > 0.0 else 0.0


def _columns(signals: list[Floats], rate_Hz: float) -> Floats:
    """Return the functions of the signals that a model may use, shape (frames, functions)."""
    plain = [(s - s.mean()) / s.std() for s in signals if s.std() > 0.0]
    found = [np.ones(len(signals[0]))]
    for signal in plain:
        found.append(signal)
        found += [np.maximum(signal - bend, 0.0) for bend in np.quantile(signal, BENDS)]
        for lag_s in LAGS_s:
            share = -np.expm1(-1.0 / (lag_s * rate_Hz))
            found.append(lfilter([share], [1.0, share - 1.0], signal))
    found += [a * b for a, b in combinations(plain, 2)]
    return np.column_stack(found)


def _ridge(known: Floats, wanted: Floats, asked: Floats) -> Floats:
    """Return a ridge regression's prediction, its strength found by cross-validation (GCV)."""
    mean, spread = known.mean(axis=0), known.std(axis=0)
    spread[spread == 0.0] = 1.0
    level = float(wanted.mean())
    left, sizes, right = np.linalg.svd((known - mean) / spread, full_matrices=False)
    turned, rows = left.T @ (wanted - level), len(wanted)
    best, weights = np.inf, np.zeros(len(sizes))
    for ridge in RIDGES:
        passed = sizes**2 / (sizes**2 + ridge * rows)
        misfit = float(np.sum((wanted - level - left @ (passed * turned)) ** 2))
        score = misfit / (rows - 1.0 - float(passed.sum())) ** 2
        if score < best:
            best, weights = score, sizes / (sizes**2 + ridge * rows) * turned
    return np.asarray(level + (asked - mean) / spread @ (right.T @ weights))
