"""The figure of a rig's stability: simulated growth as colour, linear theory as a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import SymLogNorm
from matplotlib.figure import Figure

from coupled.authority.stability.limits import gradient_range
from coupled.authority.stability.planes import KINDS, Kind, Plane
from coupled.plots.pages import panels
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.units import MILLISECOND_s

_FASTEST = 100.0  # 1/s, the ends of the colours
_LINEAR = 3.0  # 1/s, within which they are even
_ARM_N_per_d = 500.0  # the stiffness of a pilot's arm unless a run says otherwise
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
    """Draw the planes of each control, a row each."""
    figure, grid = panels(len(planes), len(KINDS), 3.1)
    norm = SymLogNorm(_LINEAR, vmin=-_FASTEST, vmax=_FASTEST)
    for row, (name, of_control) in zip(grid, planes.items(), strict=True):
        for axes, plane in zip(row, of_control, strict=True):
            mesh = _panel(axes, plane, norm)
            _mark_own(axes, rig, plane)
            axes.set_title(f"{name}, {_TITLES[plane.kind]}", fontsize=10)
            axes.set_xlabel("structure's bend under the gradient, K·G_T", fontsize=9)
        scale = figure.colorbar(mesh, ax=list(row), extend="both")
        scale.set_label("growth, 1/s (red grows)")
        ticks = [-100, -30, -10, -3, 0, 3, 10, 30, 100]
        scale.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=9)
    figure.suptitle(f"{rig.name}: where its loops are stable, without friction", fontsize=12)
    return figure


def _panel(axes: Axes, plane: Plane, norm: SymLogNorm) -> Any:
    factor = 1.0 / MILLISECOND_s if plane.kind == "frame" else 1.0
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
        level = np.arcsinh(plane.fine.T)  # a pole of the spring is no place to interpolate over
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
    axes.set_ylabel(_LABELS[plane.kind])
    return mesh


def _mark_own(axes: Axes, rig: Rig, plane: Plane) -> None:
    """Draw what the rig itself spans."""
    control = rig.controls[plane.control]
    bend = control.loader.bend
    own = {
        "assumed": control.compensation.bend / bend,
        "frame": 1.0 / rig.frame_rate / MILLISECOND_s,
        "hand": _ARM_N_per_d * bend,
        "servo": control.loader.servo_frequency,
        "gauge": control.sensing.gauge_frequency,
        "mass": control.sensing.gauge_mass / control.loader.mass,
    }[plane.kind]
    if own == 0.0:
        return
    ends = np.array(gradient_range(control)) * bend
    label = "the rig's gradients, as filed (hand: a pilot's arm)"
    axes.plot(ends, [own, own], color="#00a000", linewidth=3.5, label=label)
    axes.plot(ends, [own, own], "|", color="#00a000", markersize=9, markeredgewidth=2.0)
