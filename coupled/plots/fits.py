"""A fitted nominal rig: the ratio of each fitted value to the filed value, with intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from coupled.plots.pages import BLUE, GRAY, plain

if TYPE_CHECKING:
    from coupled.gap.nominal import NominalFit


def draw_fit(found: NominalFit) -> Figure:
    """Draw fitted over filed values; a value filed as 0, or not determined, is listed as text."""
    shown = [one for one in found.numbers if one.filed != 0.0 and one.interval is not None]
    others = [one.key for one in found.numbers if one not in shown]
    figure = Figure(figsize=(8.2, 1.6 + 0.34 * max(len(shown), 2)), layout="constrained")
    axes = figure.subplots()
    for place, one in enumerate(shown):
        low, high = one.interval or (one.found, one.found)
        ratios = [value / one.filed for value in (low, one.found, high)]
        axes.plot([ratios[0], ratios[2]], [place, place], color=BLUE, linewidth=2.0)
        axes.plot(ratios[1], place, "o", color=BLUE)
    axes.axvline(1.0, color=GRAY, linewidth=1.0)
    axes.set_yticks(range(len(shown)), [one.key for one in shown], fontsize=8)
    axes.set_ylim(len(shown) - 0.5, -0.5)
    axes.set_xlabel("found / filed, with the 95 % interval")
    axes.grid(alpha=0.25, axis="x")
    if others:
        figure.supxlabel("not drawn: " + ", ".join(others), fontsize=8)
    figure.suptitle(plain(f"{found.rig.name}, {found.control}: fitted numbers", 60), fontsize=12)
    return figure
