"""Figures of flights and their comparison."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from coupled.authority.figures import corrects_nothing, named, remarks
from coupled.authority.held import true_deflection
from coupled.display import Shown, System, in_system, parameter_label
from coupled.plots.histories import legend_above, plain
from coupled.plots.pages import scale
from coupled.record.channels import RATE, channel
from coupled.rig.equations import specified_force
from coupled.rig.packing import COMMAND_SIGN
from coupled.units import DEGREE_rad

if TYPE_CHECKING:
    from coupled.authority.compare import Flight

_STYLE = {
    "rigid": ("black", (0, (1, 1)), 2.2),
    "uncompensated": ("#d55e00", "solid", 1.6),
    "deflection only": ("#0072b2", "dashed", 1.6),
    "gradient only": ("#cc79a7", "dashed", 1.6),
    "compensated": ("#009e73", "solid", 1.6),
    "calibrated low": ("#e69f00", "dashdot", 1.6),
}
_IN_A_ROW, _WIDE = 6, 18  # names in a row of the legend, and letters of one that need more room
_FELT = 0.01  # of the force: a step below that is felt by no hand
_SHORT = ("rigid", "uncomp.", "defl. only", "grad. only", "comp.", "cal. low")


def draw_comparison(flights: Sequence[Flight], system: System = "si") -> Figure:
    """Draw a comparison: a column a case; surface, motion, force, and what is lost.

    Deflections and forces are in the units of a system.

    Where each case is flown in one configuration only, and the hand feels the modifying force
    step, draw a panel a case, of these steps.
    """
    cases = [list(group) for _, group in groupby(flights, key=lambda f: f.outcome.case)]
    if len(cases) > 1 and all(len(case) == 1 for case in cases) and _steps_are_felt(flights):
        return _draw_step_panels(cases, system)
    flown = flights[0].manoeuvre.rig.flight is not None
    force = partial(_draw_force, system=system)
    rows: list[Callable[[Any, Sequence[Flight]], None]]
    rows = [_draw_surface, *([_draw_motion] if flown else []), force, _draw_loss]
    columns, height = (len(cases), len(rows)) if len(cases) > 1 else (2, 2)
    figure = Figure(figsize=(1.2 + 3.9 * columns, 0.9 + 2.6 * height), layout="constrained")
    grid = figure.subplots(height, columns, squeeze=False)
    if len(cases) == 1:
        for axes in list(grid.flat)[len(rows) :]:
            axes.set_visible(False)
        grid = np.reshape(list(grid.flat)[: len(rows)], (len(rows), 1))
    for i, case in enumerate(cases):
        for axes, draw in zip(grid[:, i], rows, strict=True):
            draw(axes, case)
            axes.grid(alpha=0.25)
            if i:
                axes.set_ylabel("")
        if len(cases) > 1:
            grid[0, i].set_title(_wrapped(case[0].outcome.case), fontsize=10)
    _share_limits(grid[-1])
    said = [
        line
        for each in remarks(flights, system)
        for line in _wrapped(each, 65 * columns).split("\n")
    ]
    figure.suptitle("\n".join([_title(flights[0]), *said]), fontsize=9 if said else 12)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    wide = max(map(len, labels)) > _WIDE or len(labels) > _IN_A_ROW
    ncols = _IN_A_ROW // 2 if wide else _IN_A_ROW
    figure.legend(handles, labels, loc="outside lower center", ncols=ncols, fontsize=9)
    return figure


def _steps_are_felt(flights: Sequence[Flight]) -> bool:
    """Tell whether the modifying force steps anywhere by more than a hundredth of the force."""
    return any(f.outcome.force_step_N > _FELT * f.outcome.force_N for f in flights)


def _draw_step_panels(cases: Sequence[Sequence[Flight]], system: System) -> Figure:
    unit = in_system("N", system)
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    figure = Figure(figsize=(1.0 + 3.4 * columns, 0.7 + 2.7 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, case in zip(grid.flat, cases, strict=False):
        _draw_steps(axes, case, unit)
        axes.grid(alpha=0.25)
        axes.set_title(_wrapped(case[0].outcome.case), fontsize=10)
        axes.label_outer()
    for axes in list(grid.flat)[len(cases) :]:
        axes.set_visible(False)
    figure.supylabel(f"step of the modifying force at each frame, {unit.unit}", fontsize=10)
    figure.suptitle(_title(cases[0][0]), fontsize=12)
    return figure


def _title(flight: Flight) -> str:
    flown = flight.manoeuvre.rig.flight
    where = f"{flown.model} behind the {flight.manoeuvre.rig.name} rig" if flown else "on the bench"
    return f"{flight.manoeuvre.name}: {where}"


def _wrapped(text: str, width: int = 42) -> str:
    return "\n".join(textwrap.wrap(plain(text), width))


def _share_limits(row: Sequence[Any]) -> None:
    low = min(axes.get_ylim()[0] for axes in row)
    high = max(axes.get_ylim()[1] for axes in row)
    for axes in row:
        axes.set_ylim(low, high)


def _line(flight: Flight) -> dict[str, Any]:
    color, style, width = _STYLE[flight.configuration]
    return {"color": color, "linestyle": style, "linewidth": width, "label": named(flight)}


def _show_from_the_pull(axes: Any, case: Sequence[Flight]) -> None:
    """Begin a time axis 3 s before the control moves, where it does so in the second half."""
    record, control = case[0].record, case[0].manoeuvre.control
    deflection = np.abs(record[channel(control, "deflection")])
    moves, end = record.time_s[np.argmax(deflection > 0.01 * np.max(deflection))], record.time_s[-1]
    if moves > 0.5 * end:
        axes.set_xlim(moves - 3.0, end)


def _draw_surface(axes: Any, case: Sequence[Flight]) -> None:
    """Surface command about trim, against what the pilot's deflection asks for, and its stop."""
    control = case[0].manoeuvre.control
    data = case[0].manoeuvre.rig.controls[control]
    sign = COMMAND_SIGN[data.surface]
    for flight in case:
        record = flight.record
        moved = 100.0 * sign * record[channel(control, "surface_norm")]
        axes.plot(record.time_s, moved, **_line(flight))
    record = case[-1].record
    deflection = true_deflection(case[-1].manoeuvre.rig, control, record)
    asked = 100.0 * np.clip(deflection / data.travel, -1.0, 1.0)
    axes.plot(record.time_s, asked, color="0.65", linewidth=3.5, zorder=0, label="asked, specified")
    stop = next((s for f in case if (s := f.outcome.surface_stop_norm) is not None), None)
    if stop is not None:
        label = f"{data.surface} at its stop"
        axes.axhline(100.0 * sign * stop, color="#cc0000", linestyle="dotted", label=label)
    axes.set_xlabel("time, s")
    _show_from_the_pull(axes, case)
    axes.set_ylabel(f"{data.surface} command, % of travel")


def _draw_motion(axes: Any, case: Sequence[Flight]) -> None:
    """Pitch, roll or yaw rate, or the channel that the run wants drawn."""
    drawn = case[0].manoeuvre.measure.drawn
    if drawn is not None:
        for flight in case:
            axes.plot(flight.record.time_s, flight.record[drawn], **_line(flight))
        axes.set_xlabel("time, s")
        axes.set_ylabel(parameter_label(drawn))
        return
    name = RATE[case[0].manoeuvre.control]
    for flight in case:
        rate = flight.record[name] / DEGREE_rad
        axes.plot(flight.record.time_s, rate, **_line(flight))
    axes.set_xlabel("time, s")
    _show_from_the_pull(axes, case)
    axes.set_ylabel(f"{name.removesuffix('_rad_per_s').replace('_', ' ')}, °/s")


def _draw_force(axes: Any, case: Sequence[Flight], system: System) -> None:
    """Force against true deflection, with what was specified."""
    control = case[0].manoeuvre.control
    (size, unit), newtons = scale(control, system), in_system("N", system)
    for flight in case:
        deflection = true_deflection(flight.manoeuvre.rig, control, flight.record)
        force = flight.record[channel(control, "hand_force")]
        axes.plot(size * deflection, newtons.factor * force, **_line(flight))
    record = case[0].record
    deflection = true_deflection(case[0].manoeuvre.rig, control, record)
    peak = int(np.argmax(np.abs(deflection)))
    line = np.linspace(0.0, deflection[peak], 50)
    pressure = float(record["dynamic_pressure_Pa"][peak])
    wanted = specified_force(case[0].manoeuvre.rig, control, pressure, line)
    axes.plot(size * line, newtons.factor * wanted, color="0.65", linewidth=4.5, zorder=0)
    axes.set_xlabel(f"true deflection of the {control}, {unit}")
    axes.set_ylabel(f"pilot's force, {newtons.unit}")


def _draw_loss(axes: Any, case: Sequence[Flight]) -> None:
    """Draw authority lost and felt force missing in each configuration."""
    outcomes = [flight.outcome for flight in case]
    places = np.arange(len(outcomes))
    lost = [100.0 * o.loss for o in outcomes]
    soft = [100.0 * (1.0 - o.felt_ratio) for o in outcomes]
    axes.bar(places - 0.2, lost, 0.38, color="#d55e00", label="authority lost")
    axes.bar(places + 0.2, soft, 0.38, color="#56b4e9", label="force missing")
    for place, value in [
        *zip(places - 0.2, lost, strict=True),
        *zip(places + 0.2, soft, strict=True),
    ]:
        if np.isfinite(value):
            axes.annotate(
                f"{abs(value) if abs(value) < 0.05 else value:.1f}",
                (place, max(value, 0.0)),
                textcoords="offset points",
                xytext=(0, 2),
                ha="center",
                fontsize=7,
            )
    names = [_SHORT[list(_STYLE).index(o.configuration)] for o in outcomes]
    names = [
        f"{name}\nK̂ = 0" if corrects_nothing(flight) else name
        for name, flight in zip(names, case, strict=True)
    ]
    if all(o.loader_rests for o in outcomes):
        axes.text(0.5, 0.5, "the loader does not move", ha="center", transform=axes.transAxes)
        axes.set_xlim(-0.5, len(outcomes) - 0.5)
    axes.set_xticks(places, names, fontsize=8)
    axes.margins(y=0.18)
    axes.set_ylim(bottom=min(0.0, *lost, *soft))
    axes.set_ylabel("%")
    legend_above(axes, 2)


def _draw_steps(axes: Any, case: Sequence[Flight], unit: Shown) -> None:
    """Jumps of the modifying force from frame to frame, which the hand feels."""
    flight = case[0]
    step = unit.factor * flight.record[channel(flight.manoeuvre.control, "force_step")]
    axes.vlines(flight.record.time_s, 0.0, step, color="#d55e00", linewidth=0.8)
    axes.annotate(
        f"largest {unit.factor * flight.outcome.force_step_N:.2f} {unit.unit}",
        (0.97, 0.95),
        xycoords="axes fraction",
        ha="right",
        va="top",
        fontsize=9,
    )
    axes.set_xlabel("time, s")
