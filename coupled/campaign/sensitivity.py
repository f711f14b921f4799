"""Sensitivity of a sweep's figures: Sobol indices of its parameters, with bootstrap intervals.

The points are two independent sets A and B of a scrambled Sobol sequence, and for each parameter i
the set A with its i-th column from B. For a figure f with variance V over them,

    first_i = ⟨f_B·(f_ABi − f_A)⟩/V        share of V by i alone (Saltelli et al. 2010)
    total_i = ⟨(f_A − f_ABi)²⟩/(2·V)       with all interactions of i (Jansen 1999)

`scipy.stats.sobol_indices` gives the same numbers, but refuses any number of points that is no
power of two. The intervals are those of 95 % over resampled points. A point is left out if one of
its flights could not be flown, or ended before the figure was available.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.stats import qmc

from coupled.record.csvfile import write_table

Floats = NDArray[np.float64]
INDICES = "sensitivity.csv"
_RESAMPLED = 1000
_LEAST_POINTS = 8
_CONSTANT = 1e-9  # of the largest value: a figure with a smaller spread is constant


@dataclass(frozen=True)
class VarianceShare:
    """A share of a figure's variance, with its 95 % interval."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class SobolIndex:
    """The indices of one parameter and one figure: alone (`first`), and with others (`total`).

    None if the figure is constant. `points` is the number of sampled points used.
    """

    configuration: str
    figure: str
    key: str
    first: VarianceShare | None
    total: VarianceShare | None
    points: int

    def as_dict(self) -> dict[str, str | int | float | None]:
        """Return a row for JSON and CSV."""
        row: dict[str, str | int | float | None] = {
            "configuration": self.configuration,
            "figure": self.figure,
            "key": self.key,
        }
        for name, share in (("first", self.first), ("total", self.total)):
            row[name] = None if share is None else share.value
            row[f"{name}_low"] = None if share is None else share.low
            row[f"{name}_high"] = None if share is None else share.high
        return {**row, "points": self.points}


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

    Rows are A, B and the mixed sets, as in `design`; the indices have shape (…, parameters).
    """
    values = values - values[..., :2, :].mean(axis=(-2, -1), keepdims=True)
    a, b, mixed = values[..., :1, :], values[..., 1:2, :], values[..., 2:, :]
    variance = values[..., :2, :].var(axis=(-2, -1))[..., None]
    first = (b * (mixed - a)).mean(axis=-1) / variance
    total = ((a - mixed) ** 2).mean(axis=-1) / (2.0 * variance)
    return first, total


def sensitivity(
    found: pl.DataFrame, keys: Sequence[str], figures: Sequence[str], samples: int
) -> list[SobolIndex]:
    """Return the indices of a sweep's table, by configuration, figure and parameter."""
    indices = []
    for configuration in found["configuration"].unique(maintain_order=True):
        rows = found.filter(pl.col("configuration") == configuration).sort("flight")
        for figure in figures:
            values = rows[figure].fill_null(float("nan")).to_numpy().reshape(-1, samples)
            whole = values[:, np.isfinite(values).all(axis=0)]
            indices += _of_figure(str(configuration), figure, keys, whole)
    return indices


def _of_figure(
    configuration: str, figure: str, keys: Sequence[str], values: Floats
) -> list[SobolIndex]:
    points = values.shape[1]
    if points < _LEAST_POINTS or np.ptp(values) <= _CONSTANT * float(np.max(np.abs(values))):
        return [SobolIndex(configuration, figure, key, None, None, points) for key in keys]
    rng = np.random.default_rng(points)
    again = [sobol(values[:, rng.integers(points, size=points)]) for _ in range(_RESAMPLED)]
    first, total = (
        _shares(whole, np.array([one[i] for one in again])) for i, whole in enumerate(sobol(values))
    )
    return [
        SobolIndex(configuration, figure, key, alone, together, points)
        for key, alone, together in zip(keys, first, total, strict=True)
    ]


def _shares(whole: Floats, resampled: Floats) -> list[VarianceShare]:
    """Return each parameter's index with its interval, from (resamples, parameters)."""
    low, high = np.quantile(resampled, [0.025, 0.975], axis=0)
    return [
        VarianceShare(float(value), float(least), float(most))
        for value, least, most in zip(whole, low, high, strict=True)
    ]


def write_indices(indices: Sequence[SobolIndex], path: Path) -> None:
    """Write the indices as CSV, a row for each, atomically."""
    write_table(pl.DataFrame([index.as_dict() for index in indices]), path)
