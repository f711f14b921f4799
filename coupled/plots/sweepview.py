"""What the figures of a sweep share: labels with units, axes, and which figures vary at all."""

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
_LETTERS_PER_INCH = 12.0  # of a title in 11 points, at the least
_STILL = 1e-9  # what a figure spreads by where it does not vary: the arithmetic's own
_EVEN = 1e-3  # of a step, by which steps differ that are taken as even
_ONE_LINE = 0.01  # of a figure's span, within which lines are one to the eye
_WIDE = 10.0  # greatest over least value of an axis that may be logarithmic


def in_unit(found: pl.DataFrame, name: str, unit: Shown) -> pl.DataFrame:
    """Return a table with a column of numbers in a unit, NaN where it has no value."""
    return found.with_columns(pl.col(name).cast(pl.Float64).fill_null(np.nan) * unit.factor)


def varying(
    found: pl.DataFrame, figures: Sequence[str], system: System = "si"
) -> tuple[list[str], str]:
    """Return the first figures that vary, and a remark on those that do not.

    All of them where none does: a figure of nothing says less than a level line.
    """
    flown = found.filter(pl.col("ended_early") == "")
    drawn, still = [], []
    for name in figures:
        values = flown[name].drop_nulls().cast(pl.Float64).to_numpy()
        size = float(np.max(np.abs(values), initial=0.0))
        if values.size and np.ptp(values) <= _STILL * max(size, 1.0):
            each = kept_figure(name, system)
            level = each.factor * float(np.median(values))
            still.append(f"{each.label}: {0.0 if abs(level) < _STILL else level:.4g}")
        else:
            drawn.append(name)
    if not drawn:
        return list(figures)[:1], ""
    remark = "the same in every flight: " + "; ".join(still) if still else ""
    return drawn[:MOST_ROWS], remark


def coincident(found: pl.DataFrame, keys: Sequence[str], figures: Sequence[str]) -> list[str]:
    """Return which configurations have the same line of a figure, a sentence a figure."""
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


def titled(title: str, remark: str, width_in: float) -> str:
    """Return the title of a figure so many inches wide, with a remark on lines of its own."""
    letters = int(_LETTERS_PER_INCH * width_in)
    return "\n".join([plain(title), *textwrap.wrap(plain(remark), letters)]).strip("\n")


def is_logarithmic(values: Floats) -> bool:
    """Tell whether values were spread evenly in their logarithms, and over more than a decade."""
    if len(values) < 3 or values[0] <= 0.0 or values[-1] < _WIDE * values[0]:
        return False
    steps = np.diff(np.log(values))
    return bool(np.ptp(steps) <= _EVEN * steps.mean())


def place_of(axes: Any, key: str, column: pl.Series) -> None:
    """Label the axis of a parameter along the bottom; logarithmic where its values are spread so.

    An axis that is not linear says so.
    """
    values = column.unique().sort().cast(pl.Float64).to_numpy()
    label = parameter_label(key)
    if is_logarithmic(values):
        axes.set_xscale("log")
        label += " (logarithmic)"
    else:
        axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
    axes.set_xlabel(label)


def mark_ended(axes: Any, places: Floats) -> None:
    """Put a cross on the lower edge where a flight ended early."""
    if not len(places):
        return
    low = np.zeros(len(places))
    marks = {"transform": axes.get_xaxis_transform(), "clip_on": False}
    axes.plot(places, low, "x", color="#cc0000", markersize=6, label="ended early", **marks)
