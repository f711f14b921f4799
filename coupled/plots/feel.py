"""A force-deflection sweep of an aircraft: readings, fitted curve and friction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from coupled.display import System, in_system
from coupled.plots.pages import BLUE, GRAY, ORANGE, deflection_shown, panels, plain, pressure

if TYPE_CHECKING:
    from coupled.calibration.feel import Feel

_POINTS = 400


def draw_sweep(found: Feel, control: str, source: str, system: System = "si") -> Figure:
    """Draw readings and fit over deflection, and the residual, one row for each q̄."""
    shown, newtons = deflection_shown(control, system), in_system("N", system)
    size = shown.factor
    figure, grid = panels(len(found.pressure), 2, 2.8)
    sweep = found.sweep
    for row, (q, (left, right)) in enumerate(zip(found.pressure, grid, strict=True)):
        here = sweep.pressure == q
        ends = np.min(sweep.deflection[here]), np.max(sweep.deflection[here])
        line = np.linspace(*ends, _POINTS)
        left.plot(size * line, newtons.factor * found.at(line, row, 0.0), color=GRAY, linewidth=3)
        nodes = found.deflection
        if nodes[0] == 0.0:
            nodes = np.unique(np.concatenate((-nodes, nodes)))
        nodes = nodes[(nodes >= ends[0]) & (nodes <= ends[1]) & (nodes != 0.0)]
        middle = newtons.factor * found.at(nodes, row, 0.0)
        left.plot(size * nodes, middle, "o", color="black", markersize=4, label="nodes")
        for motion, color in ((1.0, BLUE), (-1.0, ORANGE)):
            label = "δ rising" if motion > 0.0 else "δ falling"
            ours = here & (sweep.motion == motion)
            at, force = sweep.deflection[ours], sweep.force[ours]
            fitted = newtons.factor * found.at(line, row, motion)
            left.plot(size * at, newtons.factor * force, ".", color=color, markersize=3)
            left.plot(size * line, fitted, color=color, linewidth=0.9, label=label)
            ours &= found.used
            at = sweep.deflection[ours]
            rest = newtons.factor * (sweep.force[ours] - found.at(at, row, motion))
            right.plot(size * at, rest, ".", color=color, markersize=3, label=label)
        left.set_ylabel(f"F at {pressure(q, system)}, {newtons.unit}")
        right.set_ylabel(f"F − fit, {newtons.unit}")
        for axes in (left, right):
            axes.grid(alpha=0.25)
            axes.set_xlabel(f"δ, {shown.unit}")
    grid[0, 0].legend(fontsize=8)
    breakout, friction = (newtons.factor * value for value in (found.breakout_N, found.friction_N))
    text = f"{control}: breakout {breakout:.3g} {newtons.unit}, friction {friction:.3g}"
    figure.suptitle(f"{text} {newtons.unit}, from {plain(source, 40)}", fontsize=12)
    return figure
