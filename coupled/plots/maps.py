"""Figures of the authority maps."""

from __future__ import annotations

import contextlib
import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, Delaunay, QhullError

from coupled.display import System, in_system, pressure_shown
from coupled.errors import joined
from coupled.plots.pages import BLUE, GRAY, GREEN, ORANGE, deflection_shown, panels, with_legend
from coupled.record.channels import ControlName
from coupled.units import POUND_N, KNOT_m_per_s

if TYPE_CHECKING:
    from coupled.authority.maps import Feel, Floats, LossMap

_NO_LOSS = 5e-4  # a share that rounds to 0.0 %
_NEUTRAL = 0.1  # share of the greatest deflection flown below which a control is near neutral
_GAINS_percent = 0.5  # least gain for which the colour scale has two signs
_LETTERS_per_inch = 13.0  # of a title
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
    """Draw the authority loss of each control (rows) in each configuration (columns).

    The colour scale of a row covers the losses within the flown range, or at all deflections if
    nothing was flown. A map without any loss is not drawn but named in the title.
    """
    drawn = {control: [m for m in of_control if _loses(m)] for control, of_control in maps.items()}
    drawn = {control: kept for control, kept in drawn.items() if kept}
    order = [m.configuration for of_control in maps.values() for m in of_control]
    there = {m.configuration for kept in drawn.values() for m in kept}
    columns = [each for each in dict.fromkeys(order) if each in there]
    figure, grid = panels(max(1, len(drawn)), max(1, len(columns)), 2.9)
    for axes in grid.flat:
        axes.set_visible(False)
    for row, (control, of_control) in zip(grid, drawn.items(), strict=False):
        places = dict(zip(columns, row, strict=True))
        ours = [(places[loss_map.configuration], loss_map) for loss_map in of_control]
        _draw_row(figure, ours, flown[control], system)
    outlined = "line: what was flown" if any(f.size for f in flown.values()) else ""
    notes = "; ".join(filter(None, (_grey_note(drawn), outlined)))
    title = f"{name}: deflection lost on the way to the surface" + (f" ({notes})" if notes else "")
    lines = [title, *_without_loss(maps)]
    letters = int(_LETTERS_per_inch * figure.get_size_inches()[0])
    said = [part for line in lines for part in textwrap.wrap(line, letters)]
    figure.suptitle("\n".join(said), fontsize=12 if len(said) == 1 else 10)
    return figure


def _loses(loss_map: LossMap) -> bool:
    """Return whether a map has any loss or gain."""
    there = loss_map.loss[np.isfinite(loss_map.loss)]
    return bool(np.any(np.abs(there) > _NO_LOSS))


def _without_loss(maps: Mapping[ControlName, Sequence[LossMap]]) -> list[str]:
    """Return sentences on the maps that are not drawn: no loss, or no motion."""
    found: dict[str, list[str]] = {}
    for control, of_control in maps.items():
        for loss_map in of_control:
            if not _loses(loss_map):
                moves = bool(np.isfinite(loss_map.loss).any())
                why = "Nothing is lost" if moves else "The loader rests within its breakout"
                found.setdefault(f"{why} on the {control}", []).append(loss_map.configuration)
    alike: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for place, configurations in found.items():
        why, _, name = place.partition(" on the ")
        alike.setdefault((why, tuple(configurations)), []).append(name)
    return [
        f"{why} on {joined(controls)}, {joined(configurations)}."
        for (why, configurations), controls in alike.items()
    ]


def _draw_row(
    figure: Figure, ours: Sequence[tuple[Axes, LossMap]], flown: Floats, system: System
) -> None:
    """Draw the maps of a control with a common colour scale."""
    pressure = pressure_shown(system)
    deflection = deflection_shown(ours[0][1].control, system)
    least, most = _range(ours, flown)
    for axes, loss_map in ours:
        axes.set_visible(True)
        mesh = axes.pcolormesh(
            pressure.factor * loss_map.pressure_Pa,
            deflection.factor * loss_map.deflection,
            100.0 * loss_map.loss.T,
            cmap="RdBu_r" if least < 0.0 else "Reds",
            vmin=least,
            vmax=most,
            shading="gouraud",
        )
        _outline(axes, flown, (pressure.factor, deflection.factor))
        axes.set_facecolor(GRAY)  # the loader rests, or the grip cannot get there
        axes.set_ylim(0.0, deflection.factor * loss_map.deflection[-1])
        axes.set_title(f"{loss_map.control}, {loss_map.configuration}", fontsize=10)
        axes.set_xlabel(pressure.labelled("dynamic pressure q̄"))
    ours[0][0].set_ylabel(deflection.labelled("true deflection δ"))
    beyond = "both" if least < 0.0 else "max"
    bar = figure.colorbar(mesh, ax=[axes for axes, _ in ours], extend=beyond)
    bar.set_label("loss, % of δ")


def _range(ours: Sequence[tuple[Axes, LossMap]], flown: Floats) -> tuple[float, float]:
    """Return the ends of the colour scale of a row, in %: the losses within the flown range.

    Deflections near neutral are excluded: a breakout is a large share of a small deflection.
    """
    found = np.concatenate([_flown_losses(loss_map, flown) for _, loss_map in ours])
    if not found.size:
        found = np.concatenate([m.loss[np.isfinite(m.loss)] for _, m in ours])
    low, high = 100.0 * float(np.min(found)), 100.0 * float(np.max(found))
    most = max(1.0, high, -low)
    return (-most if low < -_GAINS_percent else 0.0), most


def _flown_losses(loss_map: LossMap, flown: Floats) -> Floats:
    """Return the losses within the convex hull of the flown range, without those near neutral.

    Without flights, return the losses from a tenth of the travel on.
    """
    q, d = np.meshgrid(loss_map.pressure_Pa, loss_map.deflection, indexing="ij")
    sizes = np.array([[loss_map.pressure_Pa[-1]], [loss_map.deflection[-1]]])
    inside = np.ones(q.shape, dtype=bool)
    greatest = float(np.max(flown[1], initial=0.0)) or float(loss_map.deflection[-1])
    with contextlib.suppress(QhullError, ValueError):
        places = np.stack((q.ravel(), d.ravel()), axis=1) / sizes.T
        inside = Delaunay(_hull((flown / sizes).T)).find_simplex(places).reshape(q.shape) >= 0
    inside &= (d >= _NEUTRAL * greatest) & np.isfinite(loss_map.loss)
    return np.asarray(loss_map.loss[inside])


def _grey_note(maps: Mapping[ControlName, Sequence[LossMap]]) -> str:
    """Return a note on the grey areas: within the breakout, or beyond the reach of the grip."""
    rests = [bool(np.isnan(m.loss[:, 0]).any()) for each in maps.values() for m in each]
    held = [
        bool((np.isnan(m.loss[:, -1]) & ~np.isnan(m.loss).all(axis=1)).any())
        for each in maps.values()
        for m in each
    ]
    where = ["within the breakout"] if any(rests) else []
    where += ["beyond where the grip can go"] if any(held) else []
    return f"grey: {' and '.join(where)}" if where else ""


def _outline(axes: Axes, flown: Floats, factors: tuple[float, float]) -> None:
    """Draw the convex hull of the flown range, if it has an area."""
    points = np.stack((factors[0] * flown[0], factors[1] * flown[1]), axis=1)
    try:
        corners = _hull(points)
    except (QhullError, ValueError):
        return
    closed = np.vstack((corners, corners[:1]))
    axes.plot(closed[:, 0], closed[:, 1], color="black", linewidth=1.2)


def _hull(points: Floats) -> Floats:
    """Return the corners of the convex hull of points, shape (corners, 2)."""
    return np.asarray(points[ConvexHull(points).vertices])


def draw_feel(name: str, feel: Feel, system: System = "si") -> Figure:
    """Draw the column force per g and per knot against q̄."""
    figure, grid = panels(1, 2, 3.6)
    pressure, force = pressure_shown(system), in_system("N", system)
    rows = (
        (f"force per g, {force.unit}", feel.per_g_N),
        (f"pull per knot slower, {force.unit}", feel.per_knot_N),
    )
    for axes, (label, forces) in zip(grid[0], rows, strict=True):
        for configuration, values in forces.items():
            word, color, style, width = _STYLES[configuration]
            x, y = pressure.factor * feel.pressure_Pa, force.factor * np.asarray(values)
            axes.plot(x, y, color=color, linestyle=style, linewidth=width, label=word)
        axes.set_xlabel(pressure.labelled("dynamic pressure q̄"))
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
