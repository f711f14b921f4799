"""Figures of the control checks of 14 CFR Part 60, with their tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from coupled.calibration.checks import Swing, swing_of
from coupled.campaign.tolerances import TIME_SHARE, SURFACE_rad, force_band
from coupled.display import System, in_system
from coupled.plots.pages import (
    BLUE,
    ORANGE,
    case_panels,
    deflection_shown,
    leg_names,
    pressure,
    title,
    with_legend,
)
from coupled.units import DEGREE_rad

if TYPE_CHECKING:
    from coupled.calibration.documentation import Documentation
    from coupled.calibration.sweeps import Release


def draw_static_checks(found: Documentation, system: System = "si") -> Figure:
    """Draw the static control check: force and surface position, with their tolerance bands."""
    shown, newtons = deflection_shown(found.control, system), in_system("N", system)
    factor = shown.factor
    data = found.rig.controls[found.control]
    rows = 1 if found.surface_rad is None else 2
    figure, grid = case_panels(rows, len(found.conditions), 3.0)
    for i, condition in enumerate(found.conditions):
        axes = grid[0, i]
        for leg, name in zip(condition.specified, ("tolerance", "", "", ""), strict=True):
            x, f = factor * leg.deflection, leg.force
            f, allowed = newtons.factor * f, newtons.factor * force_band(found.control, f)
            axes.fill_between(
                x, f - allowed, f + allowed, color="0.85", linewidth=0, label=name or None
            )
        response = condition.felt
        x = factor * response.deflection
        axes.plot(x, newtons.factor * response.hand_force, color=BLUE, linewidth=1.2, label="rig")
        for leg, name in zip(condition.specified, leg_names(condition), strict=True):
            x = factor * leg.deflection
            style = "k." if leg.read else "k:"
            axes.plot(x, newtons.factor * leg.force, style, linewidth=1.0, label=name or None)
        said = _verdict(found, condition.pressure_Pa, ("breakout", "force"), system)
        axes.set_title(said, fontsize=9)
        if found.surface_rad is not None:
            degrees = found.surface_rad / DEGREE_rad * np.array([-1.0, 0.0, 1.0])
            below = grid[1, i]
            wide = SURFACE_rad[data.surface] / DEGREE_rad
            x = factor * np.array([-data.push, 0.0, data.pull])
            below.fill_between(x, degrees - wide, degrees + wide, color="0.85", linewidth=0)
            side = np.sign(np.dot(response.surface, response.deflection))
            moved = side * response.surface * found.surface_rad / DEGREE_rad
            below.plot(factor * response.deflection, moved, color=BLUE, linewidth=1.2)
            below.plot(x, degrees, "k:", linewidth=1.0)
            said = _verdict(found, condition.pressure_Pa, ("surface",), system)
            below.set_title(said, fontsize=9)
        for panel in grid[:, i]:
            panel.grid(alpha=0.25)
        for panel in grid[:, i] if len(found.conditions) == 1 else grid[-1:, i]:
            panel.set_xlabel(shown.labelled("true deflection δ"))
    grid[0, 0].set_ylabel(newtons.labelled("force at the grip F"))
    if rows > 1:
        grid[1, 0].set_ylabel(f"{data.surface} from trim, °")
    what = "static control check, 14 CFR Part 60, 2.a"
    figure.suptitle(title(found, what), fontsize=12)
    with_legend(figure, grid[0, 0], 3)
    return figure


def _verdict(found: Documentation, pressure_Pa: float, kinds: Sequence[str], system: System) -> str:
    """Return q̄, whether all checks of these kinds pass at it, and the smallest margin."""
    ours = [
        check
        for check in found.checks
        if check.pressure_Pa == pressure_Pa and check.name.split(",")[0].split(" ")[0] in kinds
    ]
    if not ours:
        return f"{pressure(pressure_Pa, system)}: not judged"
    worst = min(ours, key=lambda check: check.margin)
    word = "pass" if worst.passed else "FAIL"
    margin = f"{100 * worst.margin:.{0 if abs(worst.margin) >= 0.01 else 1}f}".replace("-", "−")
    return f"{pressure(pressure_Pa, system)}: {word}, least margin {margin} %"


def draw_releases(found: Documentation, system: System = "si") -> Figure:
    """Draw the dynamic control check: releases, with the tolerances of crossings and overshoots."""
    figure, grid = case_panels(2, len(found.conditions), 2.7)
    for i, condition in enumerate(found.conditions):
        for axes, (side, both) in zip(grid[:, i], condition.releases.items(), strict=True):
            now, wanted = both.felt, both.specified
            swing = swing_of(wanted)
            for one, style in (
                (wanted, {"color": "black", "linestyle": "dotted", "label": "specified"}),
                (now, {"color": BLUE, "label": "rig"}),
            ):
                share = 100.0 * one.deflection / one.start
                from_90 = one.time_s - swing_of(one).begin_s  # as in the rule
                axes.plot(from_90, share, linewidth=1.3, **style)
            _draw_tolerance(axes, wanted, swing)
            axes.grid(alpha=0.25)
            kinds = [c for c in found.checks if c.pressure_Pa == condition.pressure_Pa]
            kinds = [c for c in kinds if c.name.endswith(side) and c.unit in ("s", "%", "")]
            worst = min(kinds, key=lambda check: check.margin)
            word = "pass" if worst.passed else f"FAIL: {worst.name.removesuffix(', ' + side)}"
            place = pressure(condition.pressure_Pa, system)
            axes.set_title(f"{place}, {side}: {word}", fontsize=9)
            axes.set_xlim(-swing.begin_s, _span(wanted, swing))
        for axes in grid[:, i] if len(found.conditions) == 1 else grid[-1:, i]:
            axes.set_xlabel("time from 90 % of the displacement, s")
    for axes in grid[:, 0]:
        axes.set_ylabel("δ, % of displacement")
    what = "release, 14 CFR Part 60, 2.b"
    figure.suptitle(title(found, what), fontsize=12)
    with_legend(figure, grid[0, 0], 4)
    return figure


def _span(wanted: Release, swing: Swing) -> float:
    last = swing.crossings[min(len(swing.crossings), 5) - 1] if swing.crossings.size else 0.0
    fall = swing.fall_s if np.isfinite(swing.fall_s) else wanted.time_s[-1] / 2.0
    return float(min(max(1.5 * last, 3.0 * fall), wanted.time_s[-1]))


def _draw_tolerance(axes: Any, wanted: Release, swing: Swing) -> None:
    """Draw the tolerances of the 10 % crossing, the zero crossings and the overshoots."""
    share, time = wanted.deflection / wanted.start, wanted.time_s - swing.begin_s
    style = {"color": ORANGE, "linewidth": 5.0, "alpha": 0.55, "solid_capstyle": "butt"}
    if not swing.peaks.size:
        low, high = (swing.fall_s * (1.0 + s * TIME_SHARE) for s in (-1.0, 1.0))
        axes.plot([low, high], [10.0, 10.0], label="tolerance", **style)
        return
    crossings = swing.crossings[: len(swing.peaks) + 1 : 2]  # one period apart
    wide = 0.0
    for n, (crossing, before) in enumerate(zip(crossings, [0.0, *crossings], strict=False)):
        wide += TIME_SHARE * (n + 1) * (crossing - before)
        axes.plot(
            [crossing - wide, crossing + wide],
            [0.0, 0.0],
            label=None if n else "tolerance",
            **style,
        )
    starts = np.append(swing.crossings, np.inf)
    for n in range(len(swing.peaks)):
        inside = (time >= starts[n]) & (time < starts[n + 1])
        at = int(np.argmax(np.where(inside, np.abs(share), -1.0)))
        top, wide = 100.0 * share[at], 10.0 * swing.peaks[0]
        axes.plot([time[at]] * 2, [top - wide, top + wide], **style)
