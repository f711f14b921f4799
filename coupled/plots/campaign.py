"""The figure of a sweep: each figure of merit against each varied parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from coupled.authority.figures import kept_figure
from coupled.campaign.entry import AS_FILED
from coupled.display import System, parameter_label
from coupled.plots.grids import draw_grid, is_grid
from coupled.plots.layout import Layout, for_print
from coupled.plots.sweepview import coincident, full_title, in_unit, label_x, mark_ended, varying

_COLOURS = ("black", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00")
_MOST_COLUMNS = 4
_USUAL = Layout()


def draw_sweep(
    found: pl.DataFrame,
    keys: Sequence[str],
    figures: Sequence[str],
    title: str = "",
    remarks: Sequence[str] = (),
    system: System = "si",
    layout: Layout = _USUAL,
) -> Figure:
    """Draw up to four figures of merit, one row each; the title has constant ones and `remarks`.

    A grid over two parameters is drawn as lines or as a map. Any other sweep has one column for
    each numeric parameter, up to four. Colours are configurations, or the values of the next
    parameter if there is one configuration only. Crosses below are flights that ended early.

    `layout` may select figures, and overlay the configurations of a grid's lines. Raises InputError
    for an unknown figure, and for overlaid maps.
    """
    numeric = [key for key in keys if found[key].dtype.is_numeric()][:_MOST_COLUMNS] or ["flight"]
    figures, still = varying(found, layout.chosen(figures), system)
    remarks = (*remarks, *coincident(found, keys, figures))
    remark = " ".join((f"{still}." if still and remarks else still, *remarks)).strip()
    if is_grid(found, keys, numeric):
        pair, heading = (numeric[0], numeric[1]), (title, remark)
        return for_print(draw_grid(found, pair, figures, heading, system, layout), layout)
    width, height = layout.size(max(1.5 + 3.6 * len(numeric), 5.5), 1.1 + 2.3 * len(figures))
    drawn = Figure(figsize=(width, height), layout="constrained")
    drawn.suptitle(full_title(title, remark, width), fontsize=11)
    panels = drawn.subplots(len(figures), len(numeric), squeeze=False, sharex="col", sharey="row")
    for row, name in enumerate(figures):
        shown = kept_figure(name, system)
        figure = in_unit(found, name, shown)
        for column, key in enumerate(numeric):
            _panel(panels[row, column], figure, keys, key, _colour_key(numeric, column), name)
        panels[row, 0].set_ylabel(shown.label)
    for column, key in enumerate(numeric):
        label_x(panels[-1, column], key, found[key])
        _add_colours(drawn, panels[:, column], _colour_key(numeric, column))
    handles, labels = panels[0, 0].get_legend_handles_labels()
    if len(labels) > 1 or "ended early" in labels:
        drawn.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return for_print(drawn, layout)


def _add_colours(drawn: Figure, column: Any, other: str) -> None:
    """Add a colour bar above a column whose colours are the values of a parameter."""
    points = column[0].collections
    if not other or not points:
        return
    bar = drawn.colorbar(points[0], ax=list(column), location="top", shrink=0.9)
    bar.ax.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
    bar.ax.tick_params(labelsize=8)
    bar.set_label(parameter_label(other), fontsize=8)


def _colour_key(keys: Sequence[str], column: int) -> str:
    """Return the parameter that colours a column, or "" if there is no other parameter."""
    return keys[(column + 1) % len(keys)] if len(keys) > 1 else ""


def _panel(
    axes: Any, found: pl.DataFrame, keys: Sequence[str], key: str, other: str, name: str
) -> None:
    configurations = found["configuration"].unique(maintain_order=True).to_list()
    flown = found.filter((pl.col("ended_early") == "") & pl.col(name).is_not_nan())
    alone = [k for k in keys if k != key]
    for configuration, colour in zip(configurations, _COLOURS, strict=False):
        rows = flown.filter(pl.col("configuration") == configuration).sort(key)
        if other and len(configurations) == 1:
            axes.scatter(rows[key], rows[name], 16, c=rows[other], cmap="viridis")
            continue
        # A line joins flights that differ in this parameter only. In a random sample there are
        # none.
        label = "" if configuration == AS_FILED else configuration
        for line in rows.partition_by(alone, maintain_order=True) if alone else [rows]:
            axes.plot(line[key], line[name], "o-", ms=3.5, lw=1.0, color=colour, label=label)
            label = ""
    mark_ended(axes, np.asarray(found.filter(pl.col("ended_early") != "")[key]))
    axes.grid(alpha=0.25)
