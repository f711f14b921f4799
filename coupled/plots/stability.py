"""The figure of the stability of a rig: simulated growth rates, and the linear limit as a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from coupled.authority.stability.limits import filed, gradient_range
from coupled.authority.stability.planes import KINDS, Kind, Plane
from coupled.plots.pages import panels
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.units import MILLISECOND_s

_FASTEST = 100.0  # 1/s, limits of the colour scale
_LINEAR = 3.0  # 1/s, within which the colour scale is linear
_ACROSS = 3
_OWN = "#00a000"
_LABELS: dict[Kind, str] = {
    "assumed": "host's K̂ over real K",
    "frame": "frame time T, ms",
    "hand": "hand's stiffness, K·k",
    "servo": "servo's frequency, Hz",
    "gauge": "gauge's bandwidth, Hz",
    "mass": "mass beyond the gauge, m_g/m",
}
_TITLES: dict[Kind, str] = {
    "assumed": "free hand, eq. (12)",
    "frame": "free hand, digital product",
    "hand": "in a hand that holds",
    "servo": "held fast",
    "gauge": "in a hand as stiff as K",
    "mass": "free hand, mass at the grip",
}


def draw_stability(rig: Rig, planes: Mapping[ControlName, Sequence[Plane]]) -> Figure:
    """Draw the stability maps of each control, three per row."""
    rows = -(-len(KINDS) // _ACROSS)
    figure, grid = panels(rows * len(planes), _ACROSS, 2.9)
    norm = SymLogNorm(_LINEAR, vmin=-_FASTEST, vmax=_FASTEST)
    for i, (name, of_control) in enumerate(planes.items()):
        ours = grid[i * rows : (i + 1) * rows]
        for axes in ours.flat[len(of_control) :]:
            axes.set_visible(False)
        for axes, plane in zip(ours.flat, of_control, strict=False):
            mesh = _panel(axes, plane, norm)
            _mark_rig_range(axes, rig, plane)
            axes.set_title(f"{name}, {_TITLES[plane.kind]}", fontsize=10)
        for axes in ours[-1]:
            axes.set_xlabel("structure's bend under the gradient, K·G_T", fontsize=9)
        scale = figure.colorbar(mesh, ax=list(ours.flat), extend="both", aspect=30)
        scale.set_label(f"growth, 1/s: red grows (logarithmic beyond ±{_LINEAR:g})")
        ticks = [-100, -30, -10, -3, 0, 3, 10, 30, 100]
        scale.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    shown: dict[str, Artist] = {}
    for axes in grid.flat:
        handles, labels = axes.get_legend_handles_labels()
        shown |= dict(zip(labels, handles, strict=True))
    figure.legend(shown.values(), list(shown), loc="outside lower center", ncols=2, fontsize=9)
    figure.suptitle(f"{rig.name}: where its loops are stable, without friction", fontsize=12)
    return figure


def _panel(axes: Axes, plane: Plane, norm: SymLogNorm) -> Any:
    factor = _factor(plane)
    y, fine_y = factor * plane.values, factor * plane.fine_values
    mesh = axes.pcolormesh(
        plane.shares,
        y,
        np.clip(plane.simulated.T, -_FASTEST, _FASTEST),
        cmap="RdBu_r",
        norm=norm,
        shading="nearest",
    )
    if np.min(plane.fine) < 0.0 < np.max(plane.fine):
        level = np.arcsinh(plane.fine.T)  # interpolates over poles of the growth rate
        axes.contour(plane.fine_shares, fine_y, level, [0.0], colors="black", linewidths=1.4)
    axes.plot([], [], color="black", linewidth=1.4, label="limit by linear theory")
    axes.plot(
        [c.share for c in plane.crossings],
        [factor * c.simulated for c in plane.crossings],
        "o",
        color="white",
        markeredgecolor="black",
        markersize=3.6,
        label="limit found in simulation",
    )
    if plane.kind != "assumed":
        axes.set_yscale("log")
    scale = "" if plane.kind == "assumed" else "\n(logarithmic)"
    axes.set_ylabel(_LABELS[plane.kind] + scale)
    return mesh


def _mark_rig_range(axes: Axes, rig: Rig, plane: Plane) -> None:
    """Draw the range of the rig itself, with an arrow at the edge if it is outside the map."""
    own = filed(rig, plane.control, plane.kind)
    low, high = (_factor(plane) * end for end in (plane.values[0], plane.values[-1]))
    axes.set_ylim(low, high)
    if own is None:
        return
    control = rig.controls[plane.control]
    ends = np.clip(np.array(gradient_range(control)) * control.loader.bend, *axes.get_xlim())
    own *= _factor(plane)
    there = [float(np.clip(own, low, high))] * 2
    label = "the rig's gradients, as filed (hand: a pilot's arm)"
    axes.plot(ends, there, color=_OWN, linewidth=3.5, label=label, clip_on=False)
    axes.plot(ends, there, "|", color=_OWN, markersize=9, markeredgewidth=2.0, clip_on=False)
    if not low <= own <= high:
        arrow, side = ("^", 8) if own > high else ("v", -12)
        axes.plot(ends.mean(), there[0], arrow, color=_OWN, markersize=9, clip_on=False)
        place = (float(ends[-1]), there[0])
        axes.annotate(
            f"{own:.3g}", place, (6, -side), textcoords="offset points", color=_OWN, fontsize=8
        )


def _factor(plane: Plane) -> float:
    """Return the factor to the unit in which the quantity of a map is drawn."""
    return 1.0 / MILLISECOND_s if plane.kind == "frame" else 1.0
