"""The score of blind trials drawn: power against size, and reliability of the probabilities."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

_BLUE, _ORANGE = "#0072b2", "#d55e00"


def draw_score(score: dict[str, Any]) -> Figure:
    """Draw the share named against the size of the effect, and told against true probability.

    Bars are 95 % intervals after Clopper and Pearson.
    """
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    power, reliability = figure.subplots(1, 2)
    _points(power, [row["ratio"] for row in score["power"]], score["power"], _BLUE, "named")
    wrong = [row["wrong"] / row["of"] for row in score["power"]]
    power.plot([row["ratio"] for row in score["power"]], wrong, "x--", color=_ORANGE, label="wrong")
    power.set(xscale="log", ylim=(-0.03, 1.03), ylabel="share of single effects")
    power.set_xlabel("stage's residual, with the effect over without")
    power.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    power.minorticks_off()
    power.legend(frameon=False)
    bins = score["probabilities"]["bins"]
    _points(reliability, [row["told"] for row in bins], bins, _BLUE, "")
    reliability.plot([0, 1], [0, 1], color="black", linewidth=0.8, linestyle=(0, (1, 1)))
    reliability.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
    reliability.set(xlabel="probability told", ylabel="share that is true")
    for axes in (power, reliability):
        axes.grid(alpha=0.25)
    return figure


def _points(axes: Any, at: list[float], rows: list[dict[str, Any]], color: str, label: str) -> None:
    shares = np.array([row["share"] for row in rows])
    below = shares - np.array([row["low"] for row in rows])
    above = np.array([row["high"] for row in rows]) - shares
    axes.errorbar(at, shares, [below, above], fmt="o-", color=color, capsize=3, label=label)
