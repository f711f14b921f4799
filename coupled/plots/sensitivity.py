"""Sobol indices: bars of the first-order and total index of each parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coupled.authority.figures import kept_figure
from coupled.campaign.sensitivity import SobolIndex
from coupled.display import parameter_label
from coupled.plots.pages import BLUE, GRAY, ORANGE, plain

_LONGEST = 44  # characters of a parameter's name


def draw_sensitivity(indices: Sequence[SobolIndex]) -> Figure:
    """Draw the indices: one row per figure of merit, one column per configuration.

    The parameters are sorted by their greatest total index, the largest on top.
    """
    configurations = list(dict.fromkeys(index.configuration for index in indices))
    figures = list(dict.fromkeys(index.figure for index in indices))
    keys = sorted(
        dict.fromkeys(index.key for index in indices),
        key=lambda key: max(i.total.value if i.total else 0.0 for i in indices if i.key == key),
    )
    height = 0.9 + len(figures) * (0.75 + 0.24 * len(keys))
    size = (4.2 + 3.4 * len(configurations), height)
    drawn = Figure(figsize=size, layout="constrained")
    grid = drawn.subplots(
        len(figures), len(configurations), squeeze=False, sharex=True, sharey=True
    )
    for row, figure in zip(grid, figures, strict=True):
        for axes, configuration in zip(row, configurations, strict=True):
            here = {
                index.key: index
                for index in indices
                if (index.figure, index.configuration) == (figure, configuration)
            }
            _panel(axes, [here[key] for key in keys])
            name = kept_figure(figure).words  # a share of variance has no unit
            axes.set_title(f"{name}: {plain(configuration)}", fontsize=10)
            axes.set_yticks(range(len(keys)), [_label(key) for key in keys], fontsize=8)
    for axes in grid[-1]:
        axes.set_xlabel("share of the figure's variance", fontsize=9)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    drawn.legend(handles, labels, loc="outside upper center", ncols=3, fontsize=8, frameon=False)
    return drawn


def _label(key: str) -> str:
    """Return the label of a parameter without its unit."""
    return plain(parameter_label(key).partition(",")[0], _LONGEST)


def _panel(axes: Any, indices: Sequence[SobolIndex]) -> None:
    axes.set_xlim(-0.03, 1.08)
    axes.grid(axis="x", alpha=0.25)
    axes.tick_params(labelsize=8)
    if all(index.total is None for index in indices):
        axes.text(0.5, 0.5, "does not vary", transform=axes.transAxes, ha="center", color=GRAY)
    alone = [(y, index.first) for y, index in enumerate(indices) if index.first is not None]
    together = [(y, index.total) for y, index in enumerate(indices) if index.total is not None]
    for label, color, shift, shares in (
        ("alone (first)", BLUE, 0.2, alone),
        ("with others (total)", ORANGE, -0.2, together),
    ):
        places = [y + shift for y, _ in shares]
        values = np.array([share.value for _, share in shares])
        axes.barh(places, values, 0.36, color=color, label=label)
        bounds = np.abs(
            [[s.low - s.value for _, s in shares], [s.high - s.value for _, s in shares]]
        )
        axes.errorbar(values, places, xerr=bounds, fmt="none", ecolor="black", elinewidth=0.8)
