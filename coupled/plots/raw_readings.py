"""Calibration readings: v₁ and the force against the deflection."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from coupled.plots.pages import plain

if TYPE_CHECKING:
    from coupled.calibration.readings import Readings


def draw_raw_readings(readings: Readings) -> Figure:
    """Draw v₁ and the force against the deflection, one colour per gradient set."""
    figure = Figure(figsize=(8.2, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    labels = np.array(readings.label)
    for label in dict.fromkeys(readings.label):
        ours = labels == label
        name = f"set {plain(label)}"
        left.plot(readings.deflection[ours], readings.v1[ours], "o", label=name, markersize=4)
        right.plot(readings.deflection[ours], readings.force[ours], "o", markersize=4)
    left.set_ylabel("v₁, V")
    right.set_ylabel("force, N")
    for axes in (left, right):
        axes.set_xlabel("deflection, m or rad")
        axes.grid(alpha=0.25)
    figure.legend(loc="outside lower center", ncols=6, fontsize=8)
    return figure
