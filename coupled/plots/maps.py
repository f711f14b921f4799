"""Figures of the authority maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, QhullError

from coupled.plots.pages import BLUE, GRAY, GREEN, ORANGE, panels, scale, with_legend
from coupled.record.channels import ControlName
from coupled.units import POUND_N, KNOT_m_per_s

if TYPE_CHECKING:
    from coupled.authority.maps import Feel, Floats, LossMap

_STYLES = {
    "rigid": ("specified", GRAY, "solid", 4.5),
    "uncompensated": ("felt uncompensated", ORANGE, "solid", 1.5),
    "compensated": ("felt compensated", GREEN, "dashed", 1.5),
}


def draw_losses(
    name: str, maps: Mapping[ControlName, Sequence[LossMap]], flown: Mapping[ControlName, Floats]
) -> Figure:
    """Draw the loss of each control (rows) in each configuration (columns)."""
    figure, grid = panels(len(maps), 4, 2.9)
    for row, (control, of_control) in zip(grid, maps.items(), strict=True):
        factor, unit = scale(control)
        least = min(float(np.nanmin(m.loss)) for m in of_control)
        most = 100.0 * max(0.01, *(float(np.nanmax(m.loss)) for m in of_control), -least)
        for axes, loss_map in zip(row, of_control, strict=True):
            mesh = axes.pcolormesh(
                loss_map.pressure_Pa / 1000.0,
                factor * loss_map.deflection,
                100.0 * loss_map.loss.T,
                cmap="RdBu_r" if least < -0.005 else "Reds",
                vmin=-most if least < -0.005 else 0.0,
                vmax=most,
                shading="gouraud",
            )
            _outline(axes, flown[control], factor)
            axes.set_facecolor(GRAY)  # the loader rests in its breakout, or nothing is pulled
            axes.set_ylim(0.0, factor * loss_map.deflection[-1])
            axes.set_title(f"{control}, {loss_map.configuration}", fontsize=10)
            axes.set_xlabel("dynamic pressure q̄, kPa")
        row[0].set_ylabel(f"true deflection δ, {unit}")
        figure.colorbar(mesh, ax=list(row), label="loss, % of δ")
    outlined = "; line: what was flown" if any(f.size for f in flown.values()) else ""
    figure.suptitle(
        f"{name}: deflection lost on the way to the surface (grey: within the breakout{outlined})",
        fontsize=12,
    )
    return figure


def _outline(axes: Axes, flown: Floats, factor: float) -> None:
    """Draw the hull of what was flown, where it is more than a line."""
    points = np.stack((flown[0] / 1000.0, factor * flown[1]), axis=1)
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return
    closed = np.vstack((corners, corners[:1]))
    axes.plot(closed[:, 0], closed[:, 1], color="black", linewidth=1.2)


def draw_feel(name: str, feel: Feel) -> Figure:
    """Draw the column's force per g and per knot against q̄."""
    figure, grid = panels(1, 2, 3.6)
    rows = (("force per g, N", feel.per_g_N), ("pull per knot slower, N", feel.per_knot_N))
    for axes, (label, forces) in zip(grid[0], rows, strict=True):
        for configuration, values in forces.items():
            word, color, style, width = _STYLES[configuration]
            x = feel.pressure_Pa / 1000.0
            axes.plot(x, values, color=color, linestyle=style, linewidth=width, label=word)
        axes.set_xlabel("dynamic pressure q̄, kPa")
        axes.set_ylabel(label)
        axes.grid(alpha=0.25)
    # 14 CFR 25.173: at least 1 lbf per 6 kt
    grid[0, 1].axhline(
        POUND_N / 6.0, color=BLUE, linewidth=1.0, label="14 CFR 25.173: 1 lbf in 6 kt"
    )
    ends = feel.calibrated_airspeed_m_per_s[[0, -1]] / KNOT_m_per_s
    figure.suptitle(
        f"{name}: column, level trims of {ends[0]:.0f} to {ends[1]:.0f} kt", fontsize=12
    )
    with_legend(figure, grid[0, 1], 4)
    return figure
