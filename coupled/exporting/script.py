"""A run as a script for JSBSim alone.

The script has the trim, the pilots' forces as tables over time, linear in between, the wind, the
gust, the turbulence and the events. A clamp is the export's own hand, moved to its position. JSBSim
has no pilot who observes the motion: the force of such a pilot in our own flight is played back,
with a note in the script.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

import numpy as np
from numpy.typing import NDArray

from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot.base import Action, Start
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.equations import specified_gradient

Floats = NDArray[np.float64]
CLOSE = 1e-4  # of a table's largest value: tolerance of its thinning
_TIME = "simulation/sim-time-sec"
_LOOKING = ("attitude", "track", "own")  # pilots who observe the motion


@dataclass(frozen=True)
class Move:
    """A property moved from its initial value: by an amount, or to a value, by shares."""

    times: Floats
    shares: Floats
    by: float | None = None
    to: float | None = None


@dataclass
class Script:
    """A script: settings before the start, at the start, and in flight.

    `led` are tables over time, `following` over a property; `moved` starts from the trimmed value.
    """

    before: dict[str, float] = field(default_factory=dict)
    started: dict[str, float | str] = field(default_factory=dict)  # a name: a property's value
    led: dict[str, tuple[Floats, Floats]] = field(default_factory=dict)  # {property: time, value}
    at: list[tuple[float, dict[str, float]]] = field(default_factory=list)
    moved: dict[str, list[Move]] = field(default_factory=dict)
    following: dict[str, tuple[str, Floats, Floats]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    trims: bool = True

    def text(self, name: str, aircraft: str, start: str, dt_s: float, end_s: float) -> str:
        """Return the script's text."""
        said = "\n".join(f"  {note}" for note in self.notes).replace("--", "- -")
        begun = {name: f"coupled/start/{name}" for name in self.moved}
        self.before |= dict.fromkeys(begun.values(), 0.0)
        lines = [
            '<?xml version="1.0"?>',
            f"<!--\n{said}\n-->",
            f"<runscript name={quoteattr(name)}>",
        ]
        lines.append(f'  <use aircraft="{aircraft}" initialize="{start}"/>')
        lines.append(f'  <run start="0" end="{end_s!r}" dt="{dt_s!r}">')
        lines += [f'    <property value="{v!r}">{p}</property>' for p, v in self.before.items()]
        # JSBSim computes all values of an event before it sets one of them. A value that depends on
        # the trim must be in an event after that of the trim.
        if self.trims:
            lines += _event("trim", [_set("simulation/do_simple_trim", 1.0)])
        kept = {start: name for name, start in begun.items()}
        lines += _event("start", [_set(p, v) for p, v in {**self.started, **kept}.items()])
        for at, values in self.at:
            shown = [_set(p, v) for p, v in values.items()]
            lines += _event(f"at {at:g} s", shown, at + 0.5 * dt_s)
        for name_, (times, values_) in self.led.items():
            lines += _led(name_, _table(times + dt_s, values_))
        for name_, moves in self.moved.items():
            lines += _led(name_, _moved(f"<p>{begun[name_]}</p>", moves, dt_s))
        for name_, (by, points, values_) in self.following.items():
            lines += _led(name_, _table(points, values_, by))
        return "\n".join([*lines, "  </run>", "</runscript>", ""])


def _set(name: str, value: float | str) -> list[str]:
    if isinstance(value, str):
        return [f'<set name="{name}"><function><p>{escape(value)}</p></function></set>']
    return [f'<set name="{name}" value="{value!r}"/>']


def _event(name: str, sets: list[list[str]], at_s: float = 0.0, continuous: str = "") -> list[str]:
    lines = [f"    <event name={quoteattr(name)}{continuous}>"]
    lines.append(f"      <condition> {_TIME} ge {at_s!r} </condition>")
    lines += [f"      {line}" for each in sets for line in each]
    return [*lines, "    </event>"]


def _table(times: Floats, values: Floats, by: str = _TIME) -> list[str]:
    """Return a table over time, or a property. In JSBSim the time of a run is that of its end."""
    rows = [f"    {t!r} {v!r}" for t, v in zip(times.tolist(), values.tolist(), strict=True)]
    lines = ["<table>", f"  <independentVar>{by}</independentVar>"]
    return [*lines, "  <tableData>", *rows, "  </tableData>", "</table>"]


def _moved(start: str, moves: Sequence[Move], dt_s: float) -> list[str]:
    lines = ["<sum>", f"  {start}"]
    for move in moves:
        way = f"<v>{move.by!r}</v>" if move.by is not None else ""
        if move.to is not None:
            way = f"<difference><v>{move.to!r}</v>{start}</difference>"
        table = _table(move.times + dt_s, move.shares)
        lines += ["  <product>", f"    {way}", *(f"    {line}" for line in table), "  </product>"]
    return [*lines, "</sum>"]


def _led(name: str, function: list[str]) -> list[str]:
    """Return the event that sets a property by a function."""
    inner = ["  <function>", *(f"    {line}" for line in function), "  </function>"]
    return _event(name, [[f'<set name="{name}">', *inner, "</set>"]], 0.0, ' continuous="true"')


def thinned(times: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return the rows of a table from which linear interpolation gives the others.

    Within `CLOSE` of the largest value at every row (Ramer-Douglas-Peucker).
    """
    allowed = CLOSE * float(np.max(np.abs(values), initial=0.0))
    kept = {0, len(times) - 1}
    waiting = [(0, len(times) - 1)]
    while waiting:
        first, last = waiting.pop()
        between = slice(first + 1, last)
        line = np.interp(times[between], times[[first, last]], values[[first, last]])
        off = np.abs(values[between] - line)
        if off.size and off.max() > allowed:
            middle = first + 1 + int(np.argmax(off))
            kept.add(middle)
            waiting += [(first, middle), (middle, last)]
    chosen = sorted(kept)
    return times[chosen], values[chosen]


def lead_pilots(script: Script, manoeuvre: Manoeuvre, record: Record) -> None:
    """Add the pilots of a manoeuvre to a script; `record` is our own flight of it."""
    rig = manoeuvre.rig
    steps = rig.flight.steps_per_frame if rig.flight is not None else 1
    times = np.arange(manoeuvre.frames * steps, dtype=float) / (rig.frame_rate * steps)
    for name, pilot in manoeuvre.pilots.items():
        if pilot.kind in _LOOKING or pilot.reach(name) > 0.0:
            force = record[channel(name, "hand_force")]
            _lead(script, f"coupled/{name}/force-N", record.time_s, force)
            script.notes.append(
                f"{name}: the force that the pilot ({pilot.kind}) gave in coupled's own flight,"
                " played back: JSBSim has no pilot who observes the motion."
            )
            continue
        pressure_Pa = float(record["dynamic_pressure_Pa"][0])
        gradient = float(specified_gradient(rig.controls[name].schedule, pressure_Pa))
        action = pilot.act(rig, name, Start(gradient, manoeuvre.seed, manoeuvre.file))
        _lead_action(script, name, action, times)


def _lead_action(script: Script, name: ControlName, action: Action, times: Floats) -> None:
    d, at = unit_of(name), f"coupled/{name}"
    if action.force is not None:
        _lead(script, f"{at}/force-N", times, action.force(times))
    if action.held is not None:
        hand = action.hand
        script.started[f"{at}/hand"] = 1.0
        gains = {"stiffness": f"N_per_{d}", "damping": f"N_s_per_{d}", "integral": f"N_per_{d}_s"}
        for gain, unit in gains.items():
            script.started[f"{at}/hand-{gain}-{unit}"] = float(getattr(hand, gain))
        _lead(script, f"{at}/hand-deflection-{d}", times, action.held(times))


def _lead(script: Script, name: str, times: Floats, values: Floats) -> None:
    if np.any(values):
        script.led[name] = thinned(times, values)
