"""A sweep drawn: each kept figure against each parameter that varies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.figure import Figure

from coupled.campaign.entry import AS_FILED
from coupled.campaign.labels import parameter_label

_COLOURS = ("black", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00")
_MOST_ROWS, _MOST_COLUMNS = 4, 4
FIGURES = {
    "asked_norm": "surface asked, of travel",
    "reached_norm": "surface reached, of travel",
    "loss": "authority lost, share",
    "loss_closed_form": "loss, closed form, share",
    "felt_ratio": "felt over specified",
    "felt_ratio_closed_form": "felt, closed form",
    "force_N": "force needed, N",
    "force_step_N": "force step, N",
    "peak_rate_rad_per_s": "peak rate, rad/s",
    "peak_load_factor": "peak load factor",
    "time_to_attitude_s": "time to attitude, s",
}


def draw_sweep(found: pl.DataFrame, keys: Sequence[str], figures: Sequence[str]) -> Figure:
    """Draw up to four figures, a row each, against up to four numeric parameters.

    A colour a configuration; with a single one, a colour a value of the next parameter. The
    flights that ended early stand as crosses on the lower edge.
    """
    numeric = [key for key in keys if found[key].dtype.is_numeric()][:_MOST_COLUMNS] or ["flight"]
    figures = list(figures)[:_MOST_ROWS]
    width, height = 1.5 + 3.6 * len(numeric), 0.7 + 2.3 * len(figures)
    drawn = Figure(figsize=(max(width, 5.5), height), layout="constrained")
    panels = drawn.subplots(len(figures), len(numeric), squeeze=False, sharex="col", sharey="row")
    for row, name in enumerate(figures):
        for column, key in enumerate(numeric):
            _panel(panels[row, column], found, keys, key, _other(numeric, column), name)
        panels[row, 0].set_ylabel(FIGURES[name])
    for column, key in enumerate(numeric):
        panels[-1, column].set_xlabel(parameter_label(key))
        other = _other(numeric, column)
        points = panels[0, column].collections
        if other and points:
            bar = drawn.colorbar(points[0], ax=list(panels[:, column]), location="top", shrink=0.9)
            bar.ax.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
            bar.ax.tick_params(labelsize=8)
            bar.set_label(parameter_label(other), fontsize=8)
    handles, labels = panels[0, 0].get_legend_handles_labels()
    if len(labels) > 1 or "ended early" in labels:
        drawn.legend(handles, labels, loc="outside upper left", ncols=3, frameon=False, fontsize=8)
    return drawn


def _other(keys: Sequence[str], column: int) -> str:
    """Return the parameter that colours a column, if there is another."""
    return keys[(column + 1) % len(keys)] if len(keys) > 1 else ""


def _panel(
    axes: Any, found: pl.DataFrame, keys: Sequence[str], key: str, other: str, name: str
) -> None:
    configurations = found["configuration"].unique(maintain_order=True).to_list()
    flown = found.filter((pl.col("ended_early") == "") & pl.col(name).is_not_null())
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
    ended = found.filter(pl.col("ended_early") != "")[key].to_numpy()
    if len(ended):
        low = np.zeros(len(ended))
        marks = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(ended, low, "x", color="#cc0000", markersize=6, label="ended early", **marks)
    axes.grid(alpha=0.25)
    axes.ticklabel_format(axis="x", style="sci", scilimits=(-3, 4), useMathText=True)
