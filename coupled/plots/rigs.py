"""A rig: the gradient that it gives over dynamic pressure, and what its bend would take."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from coupled.plots.pages import BLUE, ORANGE, plain
from coupled.record.channels import unit_of
from coupled.rig.equations import specified_gradient, uncompensated_loss

if TYPE_CHECKING:
    from coupled.rig.rig import Rig

_POINTS = 200


def draw_rig(rig: Rig) -> Figure:
    """Draw each control's G_T over q̄, and the share that its bend takes without a correction."""
    rig.check_controlled(rig.file)
    rows = len(rig.controls)
    figure = Figure(figsize=(8.2, 0.7 + 2.2 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, squeeze=False, sharex=True)
    highest = max(max(control.schedule.dynamic_pressure) for control in rig.controls.values())
    pressure = np.linspace(0.0, highest, _POINTS)
    for (left, right), (name, control) in zip(grid, rig.controls.items(), strict=True):
        gradient = specified_gradient(control.schedule, pressure)
        left.plot(pressure / 1000.0, gradient, color=BLUE)
        left.set_ylabel(f"{name}: G_T, N/{unit_of(name)}")
        lost = 100.0 * uncompensated_loss(control.loader.bend, gradient)
        right.plot(pressure / 1000.0, lost, color=ORANGE)
        right.set_ylabel("lost uncorrected, %")
        for axes in (left, right):
            axes.set_ylim(bottom=0.0)
            axes.grid(alpha=0.25)
    for axes in grid[-1]:
        axes.set_xlabel("q̄, kPa")
        axes.set_xlim(0.0, highest / 1000.0)
    figure.suptitle(plain(f"{rig.name}: gradient, and what the bend takes", 60), fontsize=12)
    return figure
