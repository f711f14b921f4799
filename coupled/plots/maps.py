"""Figures of the authority maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, QhullError

from coupled.display import Shown, System, in_system
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
    name: str,
    maps: Mapping[ControlName, Sequence[LossMap]],
    flown: Mapping[ControlName, Floats],
    system: System = "si",
) -> Figure:
    """Draw the loss of each control (rows) in each configuration (columns)."""
    figure, grid = panels(len(maps), 4, 2.9)
    pressure = _pressure(system)
    for row, (control, of_control) in zip(grid, maps.items(), strict=True):
        factor, unit = scale(control, system)
        losses = np.concatenate([m.loss[np.isfinite(m.loss)] for m in of_control])
        least = float(np.min(losses, initial=0.0))
        most = 100.0 * max(0.01, float(np.max(losses, initial=0.0)), -least)
        for axes, loss_map in zip(row, of_control, strict=True):
            mesh = axes.pcolormesh(
                pressure.factor * loss_map.pressure_Pa,
                factor * loss_map.deflection,
                100.0 * loss_map.loss.T,
                cmap="RdBu_r" if least < -0.005 else "Reds",
                vmin=-most if least < -0.005 else 0.0,
                vmax=most,
                shading="gouraud",
            )
            _outline(axes, flown[control], (pressure.factor, factor))
            axes.set_facecolor(GRAY)  # no loss: the loader rests, or the grip does not go so far
            axes.set_ylim(0.0, factor * loss_map.deflection[-1])
            axes.set_title(f"{control}, {loss_map.configuration}", fontsize=10)
            axes.set_xlabel(f"dynamic pressure q̄, {pressure.unit}")
        row[0].set_ylabel(f"true deflection δ, {unit}")
        figure.colorbar(mesh, ax=list(row), label="loss, % of δ")
    outlined = "; line: what was flown" if any(f.size for f in flown.values()) else ""
    within = _grey(maps)
    note = f" ({(within + outlined).removeprefix('; ')})" if within or outlined else ""
    figure.suptitle(f"{name}: deflection lost on the way to the surface{note}", fontsize=12)
    return figure


def _grey(maps: Mapping[ControlName, Sequence[LossMap]]) -> str:
    """Return what is drawn grey: what has no loss near neutral, and what has none far out."""
    rests = [bool(np.isnan(m.loss[:, 0]).any()) for each in maps.values() for m in each]
    held = [
        bool((np.isnan(m.loss[:, -1]) & ~np.isnan(m.loss).all(axis=1)).any())
        for each in maps.values()
        for m in each
    ]
    where = ["within the breakout"] if any(rests) else []
    where += ["beyond where the grip can go"] if any(held) else []
    return f"grey: {' and '.join(where)}" if where else ""


def _pressure(system: System) -> Shown:
    """Return what q̄ is drawn in."""
    return Shown("kPa", 1e-3) if system == "si" else in_system("Pa", system)


def _outline(axes: Axes, flown: Floats, factors: tuple[float, float]) -> None:
    """Draw the hull of what was flown, where it is more than a line."""
    points = np.stack((factors[0] * flown[0], factors[1] * flown[1]), axis=1)
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return
    closed = np.vstack((corners, corners[:1]))
    axes.plot(closed[:, 0], closed[:, 1], color="black", linewidth=1.2)


def draw_feel(name: str, feel: Feel, system: System = "si") -> Figure:
    """Draw the column's force per g and per knot against q̄."""
    figure, grid = panels(1, 2, 3.6)
    pressure, force = _pressure(system), in_system("N", system)
    rows = (
        (f"force per g, {force.unit}", feel.per_g_N),
        (f"pull per knot slower, {force.unit}", feel.per_knot_N),
    )
    for axes, (label, forces) in zip(grid[0], rows, strict=True):
        for configuration, values in forces.items():
            word, color, style, width = _STYLES[configuration]
            x, y = pressure.factor * feel.pressure_Pa, force.factor * np.asarray(values)
            axes.plot(x, y, color=color, linestyle=style, linewidth=width, label=word)
        axes.set_xlabel(f"dynamic pressure q̄, {pressure.unit}")
        axes.set_ylabel(label)
        axes.grid(alpha=0.25)
    # 14 CFR 25.173: at least 1 lbf per 6 kt
    least = force.factor * POUND_N / 6.0
    grid[0, 1].axhline(least, color=BLUE, linewidth=1.0, label="14 CFR 25.173: 1 lbf in 6 kt")
    ends = feel.calibrated_airspeed_m_per_s[[0, -1]] / KNOT_m_per_s
    figure.suptitle(
        f"{name}: column, level trims of {ends[0]:.0f} to {ends[1]:.0f} kt", fontsize=12
    )
    with_legend(figure, grid[0, 1], 4)
    return figure
