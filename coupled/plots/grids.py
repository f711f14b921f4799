"""The figure of a sweep over a grid of two parameters: lines, or a map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import polars as pl
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coupled.authority.figures import kept_figure
from coupled.campaign.entry import AS_FILED
from coupled.display import System, parameter_label
from coupled.errors import InputError
from coupled.plots.histories import plain
from coupled.plots.layout import Layout
from coupled.plots.sweepview import full_title, in_unit, is_logarithmic, label_x, mark_ended

Dashes = Literal["-", "--", ":", "-."]
_MOST_LINES = 8
_STYLES: tuple[Dashes, ...] = ("-", "--", ":", "-.")
_USUAL = Layout()
_MARKS = "os^Dv<>p"


def is_grid(found: pl.DataFrame, keys: Sequence[str], numeric: Sequence[str]) -> bool:
    """Return whether a sweep is a full grid over exactly two parameters."""
    if len(numeric) != 2 or list(keys) != list(numeric):
        return False
    counts = [found[key].n_unique() for key in numeric]
    configurations = found["configuration"].n_unique()
    return min(counts) > 1 and len(found) == counts[0] * counts[1] * configurations


def draw_grid(
    found: pl.DataFrame,
    keys: tuple[str, str],
    figures: Sequence[str],
    heading: tuple[str, str],
    system: System = "si",
    layout: Layout = _USUAL,
) -> Figure:
    """Draw one row per figure of merit and one column per configuration.

    The parameter with more values is on the x axis. `heading` is the title and a remark below it.
    With an overlay, configurations are line styles in one column. Raises InputError for overlaid
    maps.
    """
    along, other = sorted(keys, key=lambda key: -found[key].n_unique())
    configurations = found["configuration"].unique(maintain_order=True).to_list()
    as_lines = found[other].n_unique() <= _MOST_LINES
    if layout.overlay and not as_lines:
        raise InputError("--overlay", "", "the figure is of maps, which hide each other")
    columns = 1 if layout.overlay else len(configurations)
    size = layout.size(max(1.6 + 3.1 * columns, 6.0), 1.5 + 2.4 * len(figures))
    drawn = Figure(figsize=size, layout="constrained")
    ended = not as_lines and bool((found["ended_early"] != "").any())
    title = full_title(*heading, size[0])
    drawn.suptitle(f"{title}\ngray: ended early" if ended else title, fontsize=11)
    panels = drawn.subplots(len(figures), columns, squeeze=False, sharex=True, sharey="row")
    for row, name in zip(panels, figures, strict=True):
        shown = kept_figure(name, system)
        figure = in_unit(found, name, shown)
        if as_lines:
            for i, configuration in enumerate(configurations):
                rows = figure.filter(pl.col("configuration") == configuration)
                axes = row[0 if layout.overlay else i]
                style = _STYLES[i % len(_STYLES)] if layout.overlay else "-"
                _draw_lines(axes, rows, along, other, name, style)
            row[0].set_ylabel(shown.label)
        else:
            _draw_maps(drawn, row, figure, (along, other), (name, shown.label))
    titles = [""] if layout.overlay else configurations
    for axes, configuration in zip(panels[0], titles, strict=True):
        axes.set_title("" if configuration == AS_FILED else plain(configuration), fontsize=10)
    for axes in panels[-1]:
        label_x(axes, along, found[along])
    if as_lines:
        handles, labels = panels[0, 0].get_legend_handles_labels()
        named = dict(zip(reversed(labels), reversed(handles), strict=True))
        labels = list(dict.fromkeys(labels))
        handles = [named[label] for label in labels]
        if layout.overlay:
            handles += [
                Line2D([], [], color="black", linestyle=_STYLES[i % len(_STYLES)])
                for i in range(len(configurations))
            ]
            labels += configurations
        drawn.legend(
            handles,
            labels,
            loc="outside lower center",
            ncols=min(len(labels), 6),
            title=parameter_label(other),
            fontsize=8,
            title_fontsize=9,
        )
    return drawn


def _draw_lines(
    axes: Any, rows: pl.DataFrame, along: str, other: str, name: str, dashes: str
) -> None:
    values = rows[other].unique().sort().to_list()
    colours = colormaps["viridis"](np.linspace(0.0, 0.88, len(values)))
    for value, colour, mark in zip(values, colours, _MARKS, strict=False):
        line = rows.filter((pl.col(other) == value) & (pl.col("ended_early") == "")).sort(along)
        style = {"color": colour, "marker": mark, "markersize": 3.5, "linewidth": 1.2}
        style["linestyle"] = dashes
        axes.plot(line[along], line[name], label=f"{value:.4g}", **style)
    mark_ended(axes, np.asarray(rows.filter(pl.col("ended_early") != "")[along]))
    axes.grid(alpha=0.25)


def _draw_maps(
    drawn: Figure,
    row: Any,
    found: pl.DataFrame,
    keys: tuple[str, str],
    figure: tuple[str, str],
) -> None:
    """Draw one map per configuration with a common colour scale; gray where no flight is.

    `figure` is the column of the figure of merit and its label.
    """
    (along, other), (name, label) = keys, figure
    flown = found.with_columns(
        pl.when(pl.col("ended_early") == "").then(pl.col(name)).otherwise(np.nan)
    )
    values = flown[name].to_numpy()
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    places = [found[key].unique().sort().cast(pl.Float64).to_numpy() for key in (along, other)]
    configurations = found["configuration"].unique(maintain_order=True)
    for axes, configuration in zip(row, configurations, strict=True):
        ours = flown.filter(pl.col("configuration") == configuration).sort(other, along)
        cells = ours[name].to_numpy().reshape(len(places[1]), len(places[0]))
        axes.set_facecolor("0.8")
        mesh = axes.pcolormesh(
            *places, cells, shading="nearest", vmin=low, vmax=high, cmap="viridis"
        )
    logarithmic = is_logarithmic(places[1])
    if logarithmic:
        row[0].set_yscale("log")
    row[0].set_ylabel(parameter_label(other) + (" (logarithmic)" if logarithmic else ""))
    bar = drawn.colorbar(mesh, ax=list(row), aspect=14)
    bar.set_label(label, fontsize=9)
