"""The fitted curves of a diagnosis, with intervals and the range of the data."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coupled.display import System, in_system, split_unit
from coupled.gap.findings.curves import Curve
from coupled.gap.findings.summary import plain
from coupled.plots.gapview import FAINT, RIGHT, View


def draw_curves(view: View) -> Figure:
    """Draw one panel per fitted curve."""
    curves = view.diagnosis.curves
    figure = Figure(figsize=(1.0 + 4.6 * len(curves), 4.0), layout="constrained")
    panels = figure.subplots(1, max(len(curves), 1), squeeze=False)[0]
    for axes, curve in zip(panels, curves, strict=True):
        _draw(axes, curve, view.system)
    return figure


def _draw(axes: Any, curve: Curve, system: System) -> None:
    stem, of = split_unit(curve.of)
    across, up = in_system(of, system), in_system(curve.unit, system)
    at = across.factor * np.array(curve.nodes)
    values, low, high = (up.factor * np.array(v) for v in (curve.values, curve.low, curve.high))
    axes.fill_between(at, low, high, color=RIGHT, alpha=0.25, label="95 % interval")
    axes.plot(at, values, "o-", color=RIGHT, markersize=4.0, label=f"{100 * curve.closed:.0f} %")
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    axes.set_xlabel(f"{plain(stem)}, {across.unit}")
    axes.set_ylabel(f"{plain(curve.key.rpartition('.')[2])}, {up.unit}")
    like = f", like {curve.like}" if curve.like else ""
    axes.set_title(f"{curve.stage}{like}", fontsize=10)
    axes.grid(alpha=0.25)
    axes.legend(title="of the gap closed on held-out data", fontsize=8, title_fontsize=8)
