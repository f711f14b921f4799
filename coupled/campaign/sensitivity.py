"""Which parameters matter: Sobol's indices of a sweep's figures, with bootstrap intervals.

The points are two independent sets A and B of a scrambled Sobol sequence, and for each
parameter i the set A with its i-th column from B. Of a figure f with variance V over them,

    first_i = ⟨f_B·(f_ABi − f_A)⟩/V        its share of V that is i's alone (Saltelli et al. 2010)
    total_i = ⟨(f_A − f_ABi)²⟩/(2·V)       with all that i does together with others (Jansen 1999)

The intervals are those of 95 % over resampled points. A point of which one flight could not
be flown, or ended before the figure could be read, is left out whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import qmc

from coupled.files import write_whole

Floats = NDArray[np.float64]
INDICES = "sensitivity.csv"
_RESAMPLED = 1000
_LEAST_POINTS = 8
_CONSTANT = 1e-9  # of the largest value: a figure that spreads by less does not vary


@dataclass(frozen=True)
class Index:
    """What one parameter does to one figure, with 95 % intervals; None where nothing varies.

    `points` is how many of the sampled points it is made from.
    """

    configuration: str
    figure: str
    key: str
    first: float | None
    first_low: float | None
    first_high: float | None
    total: float | None
    total_low: float | None
    total_high: float | None
    points: int


def design(samples: int, parameters: int, seed: int) -> Floats:
    """Return the points as shares from 0 to 1, shape (samples·(parameters + 2), parameters).

    A first, then B, then A with one column of B each. `samples` is a power of two.
    """
    drawn = qmc.Sobol(2 * parameters, seed=seed).random(samples)
    a, b = drawn[:, :parameters], drawn[:, parameters:]
    mixed = np.repeat(a[None], parameters, axis=0)
    for i in range(parameters):
        mixed[i, :, i] = b[:, i]
    return np.concatenate((a, b, *mixed))


def sobol(values: Floats) -> tuple[Floats, Floats]:
    """Return first and total indices of values of shape (…, parameters + 2, samples).

    Rows are A, B and the mixed sets, as `design` has them; the indices have shape
    (…, parameters).
    """
    values = values - values[..., :2, :].mean(axis=(-2, -1), keepdims=True)
    a, b, mixed = values[..., :1, :], values[..., 1:2, :], values[..., 2:, :]
    variance = values[..., :2, :].var(axis=(-2, -1))[..., None]
    first = (b * (mixed - a)).mean(axis=-1) / variance
    total = ((a - mixed) ** 2).mean(axis=-1) / (2.0 * variance)
    return first, total


def sensitivity(
    found: pl.DataFrame, keys: Sequence[str], figures: Sequence[str], samples: int
) -> list[Index]:
    """Return the indices of a sweep's table, by configuration, figure and parameter."""
    told = []
    for configuration in found["configuration"].unique(maintain_order=True):
        rows = found.filter(pl.col("configuration") == configuration).sort("flight")
        for figure in figures:
            values = rows[figure].fill_null(float("nan")).to_numpy().reshape(-1, samples)
            whole = values[:, np.isfinite(values).all(axis=0)]
            told += _of_figure(str(configuration), figure, keys, whole)
    return told


def _of_figure(configuration: str, figure: str, keys: Sequence[str], values: Floats) -> list[Index]:
    points = values.shape[1]
    if points < _LEAST_POINTS or np.ptp(values) <= _CONSTANT * float(np.max(np.abs(values))):
        nothing = (None, None, None)
        return [Index(configuration, figure, key, *nothing, *nothing, points) for key in keys]
    rng = np.random.default_rng(points)
    again = [sobol(values[:, rng.integers(points, size=points)]) for _ in range(_RESAMPLED)]
    # For each parameter the index, its low and its high bound.
    first, total = (
        np.vstack((whole, np.quantile([one[i] for one in again], [0.025, 0.975], axis=0))).T
        for i, whole in enumerate(sobol(values))
    )
    found = np.hstack((first, total)).tolist()
    return [
        Index(configuration, figure, key, a, a_low, a_high, b, b_low, b_high, points)
        for key, (a, a_low, a_high, b, b_low, b_high) in zip(keys, found, strict=True)
    ]


def write_indices(told: Sequence[Index], path: Path) -> None:
    """Write the indices as CSV, a row an index, whole."""
    write_whole(path, pl.DataFrame(told).write_csv)
