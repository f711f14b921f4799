"""Time histories of channels. `Record.plot` uses this module, so it does not import `Record`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from coupled.display import drawn, unit_in
from coupled.errors import InputError, nearest
from coupled.record.channels import CONTROL_NAMES, RATE, channel, control_channels, unit_of
from coupled.units import DEGREE_rad

__all__ = ["Figure", "Histories", "draw_channels", "draw_record", "plain"]

STILL = 1e-3  # of the largest line in a panel: smaller lines are not drawn
Line = tuple[str, str, float]  # channel, name in the legend, factor to the drawn unit


class Histories(Protocol):
    """Channels over time."""

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of the channels."""

    @property
    def time_s(self) -> NDArray[np.float64]:
        """The time of each row."""

    def __getitem__(self, channel: str, /) -> NDArray[np.float64]: ...


_DEGREES = 1.0 / DEGREE_rad


def draw_channels(record: Histories, channels: Sequence[str], title: str = "") -> Figure:
    """Draw channels one below the other, in the units of figures: cm, °, kPa."""
    for name in channels:
        if name not in record.channels:
            raise InputError("record", name, f"no such channel; {nearest(name, record.channels)}")
    panels = []
    for name in channels:
        shown = drawn(name)
        label = shown.labelled(name.removesuffix(f"_{unit_in(name)}").replace("_", " "))
        panels.append((label, [(name, label, shown.factor)]))
    return _drawn(record, panels, title, 1)


def draw_record(record: Histories, title: str = "") -> Figure:
    """Draw a record: force and deflections of each control that moves, surfaces, and motion.

    Constant channels are listed and not drawn, unless all channels are constant.
    """
    panels: list[tuple[str, list[Line]]] = []
    controls = [name for name in CONTROL_NAMES if control_channels(name)[0] in record.channels]
    resting = [name for name in controls if not _moves(record, name)]
    for control in controls:
        if control not in resting or resting == controls:
            panels += _control_panels(control)
    rates = [(name, name.split("_")[0], _DEGREES) for name in RATE.values()]
    panels += [
        ("surfaces, °", [(f"{s}_rad", s, _DEGREES) for s in ("elevator", "aileron", "rudder")]),
        ("rates, °/s", rates),
        (
            "angles, °",
            [(f"{a}_rad", a, _DEGREES) for a in ("pitch", "alpha", "roll", "sideslip")],
        ),
        ("load factor", [("load_factor", "load factor", 1.0)]),
        ("dynamic pressure, kPa", [("dynamic_pressure_Pa", "dynamic pressure", 1e-3)]),
        ("true airspeed, m/s", [("true_airspeed_m_per_s", "speed", 1.0)]),
    ]
    shown = []
    for label, lines in panels:
        present = [line for line in lines if line[0] in record.channels]
        spans = [float(np.ptp(record[name])) for name, _, _ in present]
        least = STILL * max(spans, default=0.0)
        present = [line for line, span in zip(present, spans, strict=True) if span >= least]
        if present:
            shown.append((label, present))
    if not shown:
        problem = f"has no channel of a record; it has {record.channels[:5]}"
        raise InputError(title or "record", "", problem)
    figure = _drawn(record, shown, title, 2)
    if resting and resting != controls:
        figure.supxlabel("at rest, not drawn: " + ", ".join(resting), fontsize=8)
    return figure


def _moves(record: Histories, control: str) -> bool:
    """Return whether a control has a nonzero force or deflection."""
    names = [control_channels(control)[0], channel(control, "deflection")]
    return any(np.any(record[name]) for name in names if name in record.channels)


def _control_panels(control: str) -> list[tuple[str, list[Line]]]:
    """Return the panels of a control: force in N, deflection in cm or degrees."""
    d = unit_of(control)
    shown = drawn(f"deflection_{d}")
    named = {"hand_force": "hand", "force": "as read", "modifying_force": "modifying"}
    forces = [(f"{control}_{name}_N", short, 1.0) for name, short in named.items()]
    names = ("deflection", "estimate", "computed")
    deflections = [(f"{control}_{n}_{d}", n, shown.factor) for n in names]
    return [(f"{control} force, N", forces), (shown.labelled(f"{control} deflection"), deflections)]


def _drawn(
    record: Histories, panels: Sequence[tuple[str, Sequence[Line]]], title: str, columns: int
) -> Figure:
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(11, 1.0 + 1.9 * rows), layout="constrained")
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for axes, (label, lines) in zip(grid.T.flat, panels, strict=False):
        for name, short, scale in lines:
            axes.plot(record.time_s, scale * record[name], linewidth=1.1, label=short)
        axes.set_ylabel(label, fontsize=9)
        axes.grid(alpha=0.25)
        if len(lines) > 1 or lines[0][1] not in label:
            legend_above(axes, len(lines))
    for axes in list(grid.T.flat)[len(panels) :]:
        axes.set_visible(False)
    for column in range(columns):
        visible = [axes for axes in grid[:, column] if axes.get_visible()]
        if visible:
            visible[-1].set_xlabel("time, s")
            visible[-1].tick_params(labelbottom=True)
    if title:
        figure.suptitle(plain(title), fontsize=12)
    return figure


def plain(text: str) -> str:
    """Return a user's text with dollar signs escaped, since matplotlib reads them as formulas."""
    return text.replace("$", r"\$")


def legend_above(axes: Any, columns: int, fontsize: float = 7.0) -> None:
    """Put a legend above a panel that has no title, where it covers no curve."""
    axes.legend(
        loc="lower right",
        bbox_to_anchor=(1.0, 0.99),
        ncols=columns,
        fontsize=fontsize,
        frameon=False,
        borderaxespad=0.0,
    )
