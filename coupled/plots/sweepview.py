"""Shared by the figures of a sweep: labels with units, axes, and the figures that vary."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.authority.figures import kept_figure
from coupled.display import Shown, System, parameter_label
from coupled.errors import listed
from coupled.plots.histories import plain

Floats = NDArray[np.float64]
MOST_ROWS = 4
_LETTERS_PER_INCH = 12.0  # least, for a title in 11 points
_CONSTANT = 1e-9  # relative spread of a constant figure, by rounding
_EVEN = 1e-3  # relative difference of steps that count as even
_ONE_LINE = 0.01  # share of a figure's span within which lines count as coincident
_WIDE = 10.0  # least ratio of greatest to least value for a logarithmic axis


def in_unit(found: pl.DataFrame, name: str, unit: Shown) -> pl.DataFrame:
    """Return a table with a column multiplied by the factor of a unit, NaN for missing values."""
    return found.with_columns(pl.col(name).cast(pl.Float64).fill_null(np.nan) * unit.factor)


def varying(
    found: pl.DataFrame, figures: Sequence[str], system: System = "si"
) -> tuple[list[str], str]:
    """Return the first figures that vary, and a remark on those that are constant.

    If none varies, return the first one.
    """
    flown = found.filter(pl.col("ended_early") == "")
    drawn, still = [], []
    for name in figures:
        values = flown[name].drop_nulls().cast(pl.Float64).to_numpy()
        size = float(np.max(np.abs(values), initial=0.0))
        if values.size and np.ptp(values) <= _CONSTANT * max(size, 1.0):
            each = kept_figure(name, system)
            level = each.factor * float(np.median(values))
            still.append(f"{each.label}: {0.0 if abs(level) < _CONSTANT else level:.4g}")
        else:
            drawn.append(name)
    if not drawn:
        return list(figures)[:1], ""
    remark = "the same in every flight: " + "; ".join(still) if still else ""
    return drawn[:MOST_ROWS], remark


def coincident(found: pl.DataFrame, keys: Sequence[str], figures: Sequence[str]) -> list[str]:
    """Return sentences on the configurations whose lines coincide, one per figure."""
    said = []
    for name in figures:
        values = found[name].drop_nulls().cast(pl.Float64).to_numpy()
        span = float(np.ptp(values)) if values.size else 0.0
        groups: list[tuple[list[str], Floats]] = []
        for configuration in found["configuration"].unique(maintain_order=True):
            rows = found.filter(pl.col("configuration") == configuration).sort(*keys)
            line = rows[name].cast(pl.Float64).fill_null(np.nan).to_numpy()
            for names, other in groups:
                alike = line.shape == other.shape
                if alike and np.allclose(line, other, 0.0, _ONE_LINE * span, equal_nan=True):
                    names.append(configuration)
                    break
            else:
                groups.append(([configuration], line))
        word = kept_figure(name).words
        said += [
            f"{word[0].upper()}{word[1:]}: {listed(names[:-1])} and {names[-1]} coincide."
            for names, _ in groups
            if len(names) > 1
        ]
    return said


def full_title(title: str, remark: str, width_in: float) -> str:
    """Return a title with a remark below, wrapped to the width of the figure in inches."""
    letters = int(_LETTERS_PER_INCH * width_in)
    return "\n".join([plain(title), *textwrap.wrap(plain(remark), letters)]).strip("\n")


def is_logarithmic(values: Floats) -> bool:
    """Return whether values are evenly spaced in their logarithms, over a decade or more."""
    if len(values) < 3 or values[0] <= 0.0 or values[-1] < _WIDE * values[0]:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) <= _EVEN * steps.mean())


def label_x(axes: Any, key: str, column: pl.Series) -> None:
    """Label the x axis with a parameter; use a logarithmic axis if its values are spaced so."""
    values = column.unique().sort().cast(pl.Float64).to_numpy()
    label = parameter_label(key)
    if is_logarithmic(values):
        axes.set_xscale("log")
        label += " (logarithmic)"
    else:
        axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
    axes.set_xlabel(label)


def mark_ended(axes: Any, places: Floats) -> None:
    """Draw a cross on the lower edge for each flight that ended early."""
    if not len(places):
        return
    low = np.zeros(len(places))
    marks = {"transform": axes.get_xaxis_transform(), "clip_on": False}
    axes.plot(places, low, "x", color="#cc0000", markersize=6, label="ended early", **marks)
