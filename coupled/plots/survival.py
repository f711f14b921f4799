"""Survival in a sweep: the values that each configuration survives, and the boundary."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coupled.campaign.survival import SurvivalLimit
from coupled.display import parameter_label

_LIVES, _LOST = "#009e73", "#cc0000"


def draw_survival(name: str, key: str, limits: Sequence[SurvivalLimit]) -> Figure:
    """Draw one row per configuration and one dot per value, paler if some flights were lost."""
    figure = Figure(figsize=(8.0, 1.5 + 0.45 * len(limits)), layout="constrained")
    axes = figure.subplots()
    places = np.arange(len(limits))[::-1]
    for y, limit in zip(places, limits, strict=True):
        for value, share in limit.shares:
            if share in (0.0, 1.0):
                mark, colour = ("o", _LIVES) if share else ("x", _LOST)
                axes.plot(value, y, mark, color=colour, markersize=5)
            else:
                axes.plot(value, y, "o", color=_LIVES, alpha=0.25 + 0.6 * share, markersize=5)
        if limit.boundary is not None:
            axes.plot([limit.boundary] * 2, [y - 0.38, y + 0.38], color="black", linewidth=1.6)
            axes.annotate(
                f"{limit.boundary:.3g}",
                (limit.boundary, y),
                xytext=(4, 8),
                textcoords="offset points",
                fontsize=8,
                va="center",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
            )
        if limit.predicted is not None:
            ends = [y - 0.38, y + 0.38]
            axes.plot([limit.predicted] * 2, ends, color="#0072b2", linewidth=1.4, linestyle=":")
    axes.set_yticks(places, [limit.configuration for limit in limits])
    axes.set_ylim(-0.6, len(limits) - 0.3)
    axes.set_xlabel(parameter_label(key))
    axes.grid(alpha=0.25, axis="x")
    handles = [
        Line2D([], [], color=_LIVES, marker="o", linestyle="", markersize=5, label="survived"),
        Line2D([], [], color=_LOST, marker="x", linestyle="", markersize=5, label="lost"),
        Line2D([], [], color="black", linewidth=1.6, label="boundary"),
    ]
    if any(0.0 < share < 1.0 for limit in limits for _, share in limit.shares):
        some = Line2D([], [], color=_LIVES, marker="o", linestyle="", alpha=0.5, markersize=5)
        some.set_label("survived by some")
        handles.insert(1, some)
    if any(limit.predicted is not None for limit in limits):
        label = "rigid boundary × (1 − closed form's loss)"
        handles.append(Line2D([], [], color="#0072b2", linestyle=":", label=label))
    figure.suptitle(name, fontsize=11)
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=8)
    return figure
