"""Figures of flights and their comparison."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from coupled.authority.figures import (
    cases_of,
    corrects_nothing,
    flown_once,
    guessed,
    named,
    remarks,
)
from coupled.authority.heldcontrol import true_deflection
from coupled.display import Shown, System, in_system, parameter_label
from coupled.errors import InputError, listed
from coupled.plots.histories import legend_above, plain
from coupled.plots.layout import Layout, for_print
from coupled.plots.pages import deflection_shown
from coupled.record.channels import RATE, channel
from coupled.rig.equations import specified_force
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.surface import share_of_travel
from coupled.units import DEGREE_rad

if TYPE_CHECKING:
    from coupled.authority.compare import Flight
    from coupled.flight.manoeuvre import Manoeuvre

_STYLE = {
    "rigid": ("black", (0, (1, 1)), 2.2),
    "uncompensated": ("#d55e00", "solid", 1.6),
    "deflection only": ("#0072b2", "dashed", 1.6),
    "gradient only": ("#cc79a7", "dashed", 1.6),
    "compensated": ("#009e73", "solid", 1.6),
    "calibrated low": ("#e69f00", "dashdot", 1.6),
}
_IN_A_ROW, _WIDE = 6, 18  # names in a row of the legend, and the length from which there are fewer
_ONE_LINE = 0.01  # share of a panel's span within which curves count as coincident
_MANY = 3  # least number of coincident curves that is noted
_PALER = 0.45  # opacity of the curves of later cases when overlaid
_LONGEST_END = 30  # characters of the reason of an early end
_USUAL = Layout()
_FELT = 0.01  # share of the force below which a force step cannot be felt
_POINTS = 400  # samples of a specified force, which may have corners anywhere
_SHORT = ("rigid", "uncomp.", "defl. only", "grad. only", "comp.", "cal. low")


def panels_of(manoeuvre: Manoeuvre) -> list[str]:
    """Return the names of the panels that a comparison can have."""
    flown = manoeuvre.rig.flight is not None
    return ["surface", *(["motion"] if flown else []), "force", "loss"]


def draw_comparison(
    flights: Sequence[Flight], system: System = "si", layout: Layout = _USUAL
) -> Figure:
    """Draw a comparison with one column per case: surface, motion, force and authority lost.

    Deflections and forces are in the units of `system`. `layout` may select some of `panels_of`,
    and overlay the cases in the same axes, later cases paler.

    If each case has one configuration only, and the modifying force has steps that can be felt,
    each case has one panel with these steps, unless `layout` names panels.

    Raises InputError for an unknown panel.
    """
    cases = cases_of(flights)
    if flown_once(cases) and not layout.panels and not layout.overlay and _steps_are_felt(flights):
        return for_print(_draw_step_panels(cases, system, layout), layout)
    rows: dict[str, Callable[[Any, Sequence[Flight]], None]]
    rows = {"surface": _draw_surface, "motion": _draw_motion, "loss": _draw_loss}
    rows["force"] = partial(_draw_force, system=system)
    names = layout.chosen(panels_of(flights[0].manoeuvre))
    if layout.overlay and len(cases) > 1:
        names = [name for name in names if name != "loss"]  # bars of cases hide each other
        if not names:
            raise InputError("--overlay", "", "bars of several cases hide each other")
    columns = 1 if layout.overlay else len(cases)
    grid, figure = _panels(len(names), columns, layout)
    for i, case in enumerate(cases):
        for axes, name in zip(grid[:, 0 if layout.overlay else i], names, strict=True):
            before = len(axes.lines)
            rows[name](axes, case)
            if layout.overlay and i:
                _fade(axes.lines[before:], i)
            axes.grid(alpha=0.25)
            if not layout.overlay:
                axes.set_ylabel(axes.get_ylabel() if i == 0 else "")
        if columns > 1:
            grid[0, i].set_title(_wrapped(case[0].outcome.case), fontsize=10)
    _share_limits(grid[-1])
    # In print the caption explains the figure; only the note on assumed values stays.
    printed = layout.size_in is not None
    lines = [guessed(flights)] if printed else remarks(flights, system)
    lines = [*filter(None, lines), *_coincident(cases, names)]
    if layout.overlay and len(cases) > 1:
        lines.append(f"From strong to pale: {'; '.join(case[0].outcome.case for case in cases)}.")
    width = 65 * max(columns, 2 if len(names) > 1 else 1)
    said = [line for each in lines for line in _wrapped(each, width).split("\n")]
    title = [] if printed else [_title(flights[0])]
    figure.suptitle("\n".join([*title, *said]), fontsize=9 if said else 12)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    shown = dict(zip(labels, handles, strict=True))
    if "loss" not in names[:1]:
        wide = max(map(len, shown)) > _WIDE or len(shown) > _IN_A_ROW
        ncols = _IN_A_ROW // 2 if wide else _IN_A_ROW
        figure.legend(
            list(shown.values()), list(shown), loc="outside lower center", ncols=ncols, fontsize=9
        )
    return for_print(figure, layout)


def _panels(rows: int, columns: int, layout: Layout) -> tuple[Any, Figure]:
    """Return axes by row and column, and their figure; a single column is laid out as a square."""
    across, down = (columns, rows) if columns > 1 else (min(2, rows), -(-rows // 2))
    width, height = layout.size(1.2 + 3.9 * across, 0.9 + 2.6 * down)
    if layout.size_in is not None and columns == 1 and height > width:
        across, down = 1, rows
    figure = Figure(figsize=(width, height), layout="constrained")
    grid = figure.subplots(down, across, squeeze=False)
    if columns > 1:
        return grid, figure
    for axes in list(grid.flat)[rows:]:
        axes.set_visible(False)
    return np.reshape(list(grid.flat)[:rows], (rows, 1)), figure


def _fade(lines: Sequence[Any], number: int) -> None:
    """Draw the lines of a later case paler and without a label."""
    for line in lines:
        line.set_alpha(_PALER**number)
        line.set_label("")


def _coincident(cases: Sequence[Sequence[Flight]], names: Sequence[str]) -> list[str]:
    """Return one sentence per panel that names the configurations whose curves coincide.

    Pairs are not named: the line styles show both.
    """
    said = []
    for name in names:
        found = [group for case in cases for group in _same_curves(case, name)]
        for group in dict.fromkeys(found):
            where = " in some cases" if found.count(group) < len(cases) else ""
            curves = f"{listed(group[:-1])} and {group[-1]}"
            said.append(f"{name.capitalize()}: the curves of {curves} coincide{where}.")
    return said


def _same_curves(case: Sequence[Flight], panel: str) -> list[tuple[str, ...]]:
    """Return the groups of three or more configurations whose curves coincide in a panel."""
    if panel == "loss":
        return []
    groups: list[tuple[list[str], Any]] = []
    curves = [_curve(flight, panel) for flight in case]
    spans = np.max([np.ptp(curve, axis=1) for curve in curves], axis=0)[:, None]
    for flight, curve in zip(case, curves, strict=True):
        for names, other in groups:
            alike = curve.shape == other.shape
            if alike and np.all(np.abs(curve - other) <= _ONE_LINE * spans):
                names.append(named(flight))
                break
        else:
            groups.append(([named(flight)], curve))
    return [tuple(names) for names, _ in groups if len(names) >= _MANY]


def _curve(flight: Flight, panel: str) -> Any:
    """Return the signals that a panel draws of a flight, shape (channels, rows)."""
    manoeuvre, record, control = flight.manoeuvre, flight.record, flight.manoeuvre.control
    if panel == "surface":
        return record[channel(control, "surface_norm")][None]
    if panel == "motion":
        return record[manoeuvre.measure.drawn or RATE[control]][None]
    moved = true_deflection(manoeuvre.rig, control, record)
    return np.stack((moved, record[channel(control, "hand_force")]))


def _steps_are_felt(flights: Sequence[Flight]) -> bool:
    """Return whether a step of the modifying force anywhere exceeds 1 % of the force."""
    return any(f.outcome.force_step_N > _FELT * f.outcome.force_N for f in flights)


def _draw_step_panels(cases: Sequence[Sequence[Flight]], system: System, layout: Layout) -> Figure:
    unit = in_system("N", system)
    columns = min(3, len(cases))
    rows = -(-len(cases) // columns)
    size = layout.size(1.0 + 3.4 * columns, 0.7 + 2.7 * rows)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for axes, case in zip(grid.flat, cases, strict=False):
        _draw_steps(axes, case, unit)
        axes.grid(alpha=0.25)
        axes.set_title(_wrapped(case[0].outcome.case), fontsize=10)
        axes.label_outer()
    for axes in list(grid.flat)[len(cases) :]:
        axes.set_visible(False)
    figure.supylabel(unit.labelled("step of the modifying force at each frame"), fontsize=10)
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


def _start_before_motion(axes: Any, case: Sequence[Flight]) -> None:
    """Start the time axis 3 s before the control moves, if it moves in the second half only."""
    record, control = case[0].record, case[0].manoeuvre.control
    deflection = np.abs(record[channel(control, "deflection")])
    moves, end = record.time_s[np.argmax(deflection > 0.01 * np.max(deflection))], record.time_s[-1]
    if moves > 0.5 * end:
        axes.set_xlim(moves - 3.0, end)


def _draw_surface(axes: Any, case: Sequence[Flight]) -> None:
    """Draw the surface command about trim, the command for the pilot's deflection, and the stop."""
    control = case[0].manoeuvre.control
    data = case[0].manoeuvre.rig.controls[control]
    sign = COMMAND_SIGN[data.surface]
    for flight in case:
        record = flight.record
        moved = 100.0 * sign * record[channel(control, "surface_norm")]
        axes.plot(record.time_s, moved, **_line(flight))
    record = case[-1].record
    deflection = true_deflection(case[-1].manoeuvre.rig, control, record)
    asked = 100.0 * np.clip(share_of_travel(data, deflection), -1.0, 1.0)
    axes.plot(
        record.time_s, asked, color="0.65", linewidth=3.5, zorder=0, label="commanded, specified"
    )
    stop = next((s for f in case if (s := f.outcome.surface_stop_norm) is not None), None)
    if stop is not None:
        label = f"{data.surface} at its stop"
        axes.axhline(100.0 * sign * stop, color="#cc0000", linestyle="dotted", label=label)
    axes.set_xlabel("time, s")
    _start_before_motion(axes, case)
    axes.set_ylabel(f"{data.surface} command, % of travel")


def _draw_motion(axes: Any, case: Sequence[Flight]) -> None:
    """Draw the pitch, roll or yaw rate, or the channel that the run file selects."""
    drawn = case[0].manoeuvre.measure.drawn
    if drawn is not None:
        for flight in case:
            axes.plot(flight.record.time_s, flight.record[drawn], **_line(flight))
        _mark_ends(axes, case, drawn)
        axes.set_xlabel("time, s")
        axes.set_ylabel(parameter_label(drawn))
        return
    name = RATE[case[0].manoeuvre.control]
    for flight in case:
        rate = flight.record[name] / DEGREE_rad
        axes.plot(flight.record.time_s, rate, **_line(flight))
    _mark_ends(axes, case, name, 1.0 / DEGREE_rad)
    axes.set_xlabel("time, s")
    _start_before_motion(axes, case)
    axes.set_ylabel(f"{name.removesuffix('_rad_per_s').replace('_', ' ')}, °/s")


def _mark_ends(axes: Any, case: Sequence[Flight], name: str, factor: float = 1.0) -> None:
    """Mark the early ends of flights with a cross, and write each reason once."""
    reasons: dict[str, tuple[float, float]] = {}
    for flight in case:
        if flight.ended_early:
            place = (float(flight.record.time_s[-1]), factor * float(flight.record[name][-1]))
            style = {"color": _STYLE[flight.configuration][0], "clip_on": False}
            axes.plot(*place, "x", markersize=8, markeredgewidth=2.0, **style)
            why = flight.ended_early.partition(" at ")[0].removeprefix("the aircraft ")
            reasons[why] = max(place, reasons.get(why, place))
    for why, place in reasons.items():
        text = plain(why[:_LONGEST_END])
        axes.annotate(text, place, (7, 4), textcoords="offset points", fontsize=8)


def _draw_force(axes: Any, case: Sequence[Flight], system: System) -> None:
    """Draw force against true deflection, with the specified force."""
    control = case[0].manoeuvre.control
    shown, newtons = deflection_shown(control, system), in_system("N", system)
    for flight in case:
        deflection = true_deflection(flight.manoeuvre.rig, control, flight.record)
        force = flight.record[channel(control, "hand_force")]
        axes.plot(shown.factor * deflection, newtons.factor * force, **_line(flight))
    record = case[0].record
    deflection = true_deflection(case[0].manoeuvre.rig, control, record)
    peak = int(np.argmax(np.abs(deflection)))
    line = deflection[peak] * np.append([0.0, 1e-9], np.linspace(0.0, 1.0, _POINTS)[1:])
    pressure = float(record["dynamic_pressure_Pa"][peak])
    wanted = specified_force(case[0].manoeuvre.rig, control, pressure, line)
    style = {"color": "0.65", "linewidth": 4.5, "zorder": 0, "label": "commanded, specified"}
    axes.plot(shown.factor * line, newtons.factor * wanted, **style)
    axes.set_xlabel(shown.labelled(f"true deflection of the {control}"))
    axes.set_ylabel(newtons.labelled("pilot's force"))


def _draw_loss(axes: Any, case: Sequence[Flight]) -> None:
    """Draw the authority lost and the missing force of each configuration."""
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
    """Draw the steps of the modifying force from frame to frame."""
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
