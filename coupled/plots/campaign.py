"""A sweep drawn: each kept figure against each parameter that varies."""

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
from coupled.plots.sweepview import coincident, in_unit, mark_ended, place_of, titled, varying

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
    """Draw up to four figures, a row each; those that do not vary are named in the title.

    So are the `remarks`, sentences on what the figures alone do not show.

    A grid over two parameters is drawn as lines or a map. Of any other, up to four parameters
    with numbers have a column each, and a colour stands for a configuration; with a single one,
    for the next parameter's value. The flights that ended early are crosses on the lower edge.

    The layout may name some of the figures, and overlay the configurations of a grid's lines.
    Raises InputError for a figure that is not there, and for maps overlaid.
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
    drawn.suptitle(titled(title, remark, width), fontsize=11)
    panels = drawn.subplots(len(figures), len(numeric), squeeze=False, sharex="col", sharey="row")
    for row, name in enumerate(figures):
        shown = kept_figure(name, system)
        figure = in_unit(found, name, shown)
        for column, key in enumerate(numeric):
            _panel(panels[row, column], figure, keys, key, _other(numeric, column), name)
        panels[row, 0].set_ylabel(shown.label)
    for column, key in enumerate(numeric):
        place_of(panels[-1, column], key, found[key])
        _add_colours(drawn, panels[:, column], _other(numeric, column))
    handles, labels = panels[0, 0].get_legend_handles_labels()
    if len(labels) > 1 or "ended early" in labels:
        drawn.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return for_print(drawn, layout)


def _add_colours(drawn: Figure, column: Any, other: str) -> None:
    """Say above a column what its colours stand for, where they stand for a parameter."""
    points = column[0].collections
    if not other or not points:
        return
    bar = drawn.colorbar(points[0], ax=list(column), location="top", shrink=0.9)
    bar.ax.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
    bar.ax.tick_params(labelsize=8)
    bar.set_label(parameter_label(other), fontsize=8)


def _other(keys: Sequence[str], column: int) -> str:
    """Return the parameter that colours a column, if there is another."""
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
        # A line joins the flights that differ in this parameter alone; of a draw none do.
        label = "" if configuration == AS_FILED else configuration
        for line in rows.partition_by(alone, maintain_order=True) if alone else [rows]:
            axes.plot(line[key], line[name], "o-", ms=3.5, lw=1.0, color=colour, label=label)
            label = ""
    mark_ended(axes, np.asarray(found.filter(pl.col("ended_early") != "")[key]))
    axes.grid(alpha=0.25)
