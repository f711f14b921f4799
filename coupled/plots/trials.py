"""The score of blind trials: power against effect size, and reliability of the probabilities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coupled.blind.trials.result import Score, Share
from coupled.plots.histories import legend_above

_BLUE, _ORANGE = "#0072b2", "#d55e00"


def draw_score(score: Score) -> Figure:
    """Draw the share identified against the size of the effect, and a reliability diagram.

    Bars are 95 % intervals after Clopper and Pearson.
    """
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    power, reliability = figure.subplots(1, 2)
    ratios = [row.ratio for row in score.power]
    _points(power, ratios, [row.named for row in score.power], _BLUE, "named")
    wrong = [row.wrong / row.named.of for row in score.power]
    power.plot(ratios, wrong, "x--", color=_ORANGE, label="wrong")
    power.set(xscale="log", ylim=(-0.03, 1.03), ylabel="share of single effects")
    power.set_xlabel("residual with the effect over without (logarithmic)")
    power.set_xticks([1, 2, 5, 10, 20], ["1", "2", "5", "10", "20"])
    power.minorticks_off()
    legend_above(power, 2, 9.0)
    bins = score.probabilities.bins
    _points(reliability, [row.stated for row in bins], [row.true for row in bins], _BLUE, "")
    reliability.plot([0, 1], [0, 1], color="black", linewidth=0.8, linestyle=(0, (1, 1)))
    reliability.set(xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
    reliability.set(xlabel="stated probability", ylabel="observed frequency")
    for axes in (power, reliability):
        axes.grid(alpha=0.25)
    return figure


def _points(axes: Axes, at: list[float], rows: Sequence[Share], color: str, label: str) -> None:
    shares, low, high = (
        np.array([(row.share, row.low, row.high) for row in rows], dtype=float).reshape(-1, 3).T
    )
    axes.plot(at, shares, "o-", color=color, label=label)
    axes.vlines(at, low, high, color=color)
