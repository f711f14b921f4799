"""A rig: its gradient over dynamic pressure, and the share lost by structural compliance.

With a specified curve: the force over deflection, specified and felt, at the lowest and highest q̄.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from coupled.flight.manoeuvre import configure
from coupled.plots.pages import BLUE, ORANGE, plain
from coupled.record.channels import ControlName, unit_of
from coupled.rig.equations import specified_gradient, uncompensated_loss
from coupled.rig.statics import static_line

if TYPE_CHECKING:
    from coupled.rig.rig import Rig

_POINTS = 200


def draw_rig(rig: Rig) -> Figure:
    """Draw G_T of each control over q̄, and the share lost to compliance without a correction."""
    rig.check_controlled(rig.file)
    rows, curves = (
        len(rig.controls),
        [name for name in rig.controls if rig.controls[name].schedule.curved],
    )
    figure = Figure(figsize=(8.2, 0.7 + 2.2 * rows), layout="constrained")
    grid = figure.subplots(rows, 2, squeeze=False, sharex=not curves)
    highest = max(max(control.schedule.dynamic_pressure) for control in rig.controls.values())
    pressure = np.linspace(0.0, highest, _POINTS)
    for (left, right), (name, control) in zip(grid, rig.controls.items(), strict=True):
        if name in curves:
            _draw_curve(left, right, rig, name)
            continue
        gradient = specified_gradient(control.schedule, pressure)
        left.plot(pressure / 1000.0, gradient, color=BLUE)
        left.set_ylabel(f"{name}: G_T, N/{unit_of(name)}")
        lost = 100.0 * uncompensated_loss(control.loader.bend, gradient)
        right.plot(pressure / 1000.0, lost, color=ORANGE)
        right.set_ylabel("lost uncorrected, %")
        for axes in (left, right):
            axes.set_ylim(bottom=0.0)
            axes.grid(alpha=0.25)
    straight = [grid[k] for k, name in enumerate(rig.controls) if name not in curves]
    for axes in np.ravel(straight if curves else grid[-1]):
        axes.set_xlabel("q̄, kPa")
        axes.set_xlim(0.0, highest / 1000.0)
    figure.suptitle(plain(f"{rig.name}: gradient, and loss to compliance", 60), fontsize=12)
    return figure


def _draw_curve(left: Any, right: Any, rig: Rig, name: ControlName) -> None:
    """Draw the specified and the felt curve, and the share lost without a correction."""
    control, d = rig.controls[name], unit_of(name)
    uncorrected = configure(rig, "uncompensated")
    computed = control.travel * np.linspace(-1.0, 1.0, _POINTS)
    pressures = control.schedule.dynamic_pressure
    for pressure, color in zip(sorted({pressures[0], pressures[-1]}), (BLUE, ORANGE), strict=False):
        felt = static_line(rig, name, pressure, computed)
        bare = static_line(uncorrected, name, pressure, computed)
        label = f"{pressure / 1000.0:.3g} kPa"
        left.plot(felt.deflection, felt.specified, color="0.65", linewidth=4.0, zorder=0)
        left.plot(felt.deflection, felt.force, color=color, label=f"felt at {label}")
        lost = 100.0 * (1.0 - bare.estimate / bare.deflection)
        right.plot(bare.deflection, lost, color=color, label=label)
    left.plot([], [], color="0.65", linewidth=4.0, label="specified")
    left.set_ylabel(f"{name}: F, N")
    right.set_ylabel("lost uncorrected, %")
    for axes in (left, right):
        axes.set_xlabel(f"δ, {d}")
        axes.grid(alpha=0.25)
        axes.legend(fontsize=8)
