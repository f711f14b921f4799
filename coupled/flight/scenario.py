"""A run file: which rig, what the pilot does, for how long, and what is measured.

A run may have several cases: the same run with a few values of rig or pilot changed,
each named by a dotted key. Every case and pilot is checked before anything flies.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal, cast

from coupled.errors import InputError, nearest
from coupled.flight.conditions import Conditions, build_conditions
from coupled.flight.expectation import Expect, check_expectations
from coupled.flight.pilot import PILOTS, Pilot, Sweep, Table, Track, read_force_table
from coupled.record.channels import CONTROL_NAMES, ControlName, channel, record_channels, unit_of
from coupled.resources import find, shipped_rigs, shipped_runs
from coupled.rig.parameters import PLAIN_NAME
from coupled.rig.rig import Rig
from coupled.rig.rigfile import change, read_rig
from coupled.schema import Section, build, file_keys, known_keys, load_toml, quantity

Configuration = Literal["rigid", "uncompensated", "deflection only", "gradient only", "compensated"]
CONFIGURATIONS: tuple[Configuration, ...] = (
    "rigid",
    "uncompensated",
    "deflection only",
    "gradient only",
    "compensated",
)


class Measure(Section):
    """What a comparison looks at: the control, the change of attitude that is timed, a channel."""

    control: ControlName | None = None
    attitude_change: float = quantity("rad", 0.1, gt=0)
    drawn: str | None = None


class Bench(Section):
    """On a rig without aircraft: the dynamic pressure that the host is told, over time."""

    time: list[float] = quantity("s", min_length=1)
    dynamic_pressure: list[float] = quantity("Pa", min_length=1)


class Case(Section):
    """A variant of the run: dotted keys of rig and pilot, with their values here."""

    label: str = quantity("", pattern=r"^[^\x00-\x1f\x7f]{1,120}$")
    rig: dict[str, Any] = {}
    pilot: dict[str, Any] = {}


class RunFile(Conditions):
    """The tables of a run file, its pilots apart."""

    name: str = quantity("", pattern=PLAIN_NAME)
    card: str = quantity("", min_length=1)
    rig: str = quantity("", min_length=1)
    duration: float = quantity("s", gt=0, le=7200)
    seed: int = quantity("", 0, ge=0)
    record_properties: list[str] = []
    configurations: list[Configuration] = quantity("", list(CONFIGURATIONS), min_length=1)
    measure: Measure = Measure()
    bench: Bench | None = None
    case: list[Case] = []
    expect: list[Expect] = []


@dataclass(frozen=True)
class Scenario:
    """One case of a run, ready to fly: a rig, and a pilot on some of its controls."""

    run: RunFile
    file: Path
    rig: Rig
    rig_file: Path
    pilots: Mapping[ControlName, Pilot]
    label: str
    changes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def frames(self) -> int:
        """Rows of the record."""
        return max(1, round(self.run.duration * self.rig.frame_rate))

    @property
    def control(self) -> ControlName:
        """The control that a comparison looks at."""
        named = self.run.measure.control
        return next(iter(self.pilots)) if named is None else named

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of the record."""
        own = record_channels(list(self.rig.controls), self.rig.flight is not None)
        return (*own, *self.run.record_properties)

    def configured(self, configuration: Configuration) -> Scenario:
        """Return this scenario with the rig in one of the five configurations."""
        changed = copy.copy(self.__dict__)
        changed["rig"] = configure(self.rig, configuration)
        return Scenario(**changed)


def configure(rig: Rig, configuration: Configuration) -> Rig:
    """Return the rig with its structure rigid, or bending with the named corrections on.

    Rigid: K = 0 and the host believes so. Otherwise the rig's own K and K̂.
    """
    controls = {}
    for name, control in rig.controls.items():
        loader, host = control.loader, control.compensation
        if configuration == "rigid":
            loader = loader.model_copy(update={"bend": 0.0})
            host = host.model_copy(update={"bend": 0.0})
        corrections = {
            "deflection": configuration in ("deflection only", "compensated"),
            "gradient": configuration in ("gradient only", "compensated"),
        }
        host = host.model_copy(update=corrections)
        controls[name] = control.model_copy(update={"loader": loader, "compensation": host})
    return rig.model_copy(update={"controls": controls})


def read_run(name: str) -> list[Scenario]:
    """Return the cases of a run file, given by path or by the name of a shipped one."""
    file = find(name, shipped_runs(), "run")
    return scenarios_from_table(load_toml(file), file)


def scenarios_from_table(table: dict[str, Any], file: Path) -> list[Scenario]:
    """Return the cases of a run from its file's tables; `file` is named in faults."""
    pilots = table.pop("pilot", None)
    keys = {**file_keys(RunFile, "m"), "pilot": "pilot"}
    known_keys(table, keys, file, "")
    if "bench" in table:
        table["bench"] = build(Bench, table["bench"], file, "bench")
    build_conditions(table, file)
    for key, each in (("case", Case), ("expect", Expect)):
        listed = table.get(key, [])
        if not isinstance(listed, list):
            raise InputError(file, key, f"each is written [[{key}]]")
        table[key] = [build(each, item, file, f"{key}[{i}]") for i, item in enumerate(listed)]
    run = build(RunFile, table, file, "")
    if run.bench is not None:
        _check_bench(run.bench, file)
    _refuse_doubles(run, file)
    variants = run.case or [Case(label=run.name)]
    found = [_scenario(run, file, pilots, case, i) for i, case in enumerate(variants)]
    channels = {scenario.label: scenario.channels for scenario in found}
    check_expectations(run.expect, file, channels, run.configurations, run.duration)
    return found


def _scenario(run: RunFile, file: Path, pilots: Any, case: Case, index: int) -> Scenario:
    rig_file = find(run.rig, shipped_rigs(), "rig", beside=file.parent)
    rig = _changed_rig(rig_file, case, file, index)
    if rig.flight is None and run.bench is None:
        raise InputError(file, "bench", f"is missing: {rig_file.name} has no aircraft, so say q̄")
    if rig.flight is not None and run.bench is not None:
        raise InputError(file, "bench", f"{rig_file.name} has an aircraft, which gives q̄ itself")
    if rig.flight is None and run.record_properties:
        raise InputError(file, "record_properties", f"{rig_file.name} has no aircraft to ask")
    if rig.flight is None and run.given:
        raise InputError(file, run.given[0], f"{rig_file.name} has no aircraft for it")
    pilots = copy.deepcopy(pilots)
    for key, value in case.pilot.items():
        place = f"case[{index}].pilot.{key}"
        if not isinstance(pilots, dict) or key.split(".")[0] not in pilots or "." not in key:
            raise InputError(file, place, "no such pilot; write CONTROL.KEY of one in this run")
        if not change(pilots, key, value):
            raise InputError(file, place, "leads through a value, not a table")
    try:
        ready = _pilots(pilots, rig, file)
    except InputError as error:
        if error.key.removeprefix("pilot.") in case.pilot:
            raise InputError(error.file, f"case[{index}].{error.key}", error.problem) from None
        raise
    if run.measure.control is not None and run.measure.control not in rig.controls:
        raise InputError(file, "measure.control", f"{rig_file.name} has no {run.measure.control}")
    made = Scenario(run, file, rig, rig_file, ready, case.label, case.rig)
    drawn = run.measure.drawn
    if drawn is not None and drawn not in made.channels:
        raise InputError(file, "measure.drawn", f"no {drawn!r}; {nearest(drawn, made.channels)}")
    return made


def _refuse_doubles(run: RunFile, file: Path) -> None:
    lists: dict[str, list[Any]] = {
        "record_properties": run.record_properties,
        "configurations": list(run.configurations),
        "case": [case.label for case in run.case],
    }
    for key, values in lists.items():
        for value in values:
            if values.count(value) > 1:
                raise InputError(file, key, f"{value!r} stands there twice")


def _changed_rig(rig_file: Path, case: Case, file: Path, index: int) -> Rig:
    """Return the rig as a case has it; what only the case makes wrong is blamed on the case."""
    for key, value in case.rig.items():
        if isinstance(value, dict) and key in ("flight", "controls"):
            place = f"case[{index}].rig.{key}"
            raise InputError(file, place, f'put the dotted key in quotes: "{key}.…" = …')
    try:
        return read_rig(rig_file, case.rig)
    except InputError as error:
        if not case.rig:
            raise
        read_rig(rig_file)
        problem = error.problem if error.key in case.rig else f"{error.key}: {error.problem}"
        key = f".{error.key}" if error.key in case.rig else ""
        raise InputError(file, f"case[{index}].rig{key}", problem) from None


def _pilots(tables: Any, rig: Rig, file: Path) -> dict[ControlName, Pilot]:
    if not isinstance(tables, dict) or not tables:
        raise InputError(file, "pilot", f"needs at least one of {', '.join(rig.controls)}")
    known_keys(tables, dict.fromkeys(CONTROL_NAMES), file, "pilot")
    pilots: dict[ControlName, Pilot] = {}
    for name, table in tables.items():
        path = f"pilot.{name}"
        if name not in rig.controls:
            raise InputError(file, path, f"the rig has no {name}; {nearest(name, rig.controls)}")
        if not isinstance(table, dict) or "kind" not in table:
            raise InputError(file, f"{path}.kind", f"is missing; one of {', '.join(PILOTS)}")
        kind = table["kind"]
        if not isinstance(kind, str) or kind not in PILOTS:
            raise InputError(file, f"{path}.kind", f"is {kind!r}; {nearest(str(kind), PILOTS)}")
        pilot = build(PILOTS[kind], table, file, path, unit_of(name))
        if kind in ("attitude", "track") and (name != "column" or rig.flight is None):
            raise InputError(
                file, path, "only the column of a rig that flies follows pitch, path or airspeed"
            )
        if isinstance(pilot, Sweep) and max(pilot.low, pilot.high) > 0.5 * rig.frame_rate:
            problem = f"is beyond half the frame rate, {0.5 * rig.frame_rate:g} Hz"
            raise InputError(file, f"{path}.high_Hz", problem)
        if isinstance(pilot, Table):
            read_force_table(file.parent / pilot.file, channel(name, "force"))
        if isinstance(pilot, Track):
            _check_tracking(pilot, table, rig.frame_rate, file)
        _check_deflection(pilot, rig, name, file)
        pilots[cast(ControlName, name)] = pilot
    return pilots


def _check_tracking(pilot: Track, table: Any, frame_rate: float, file: Path) -> None:
    """Refuse a target in the unit of another, and sines that no frame can follow."""
    wrong = "rad" if pilot.what == "airspeed" else "m_per_s"
    for key in (f"change_{wrong}", f"sine_{wrong}"):
        if key in table:
            problem = f"is no target for {pilot.what}; give it in its own unit"
            raise InputError(file, f"pilot.column.{key}", problem)
    if any(not 0.0 < rate < frame_rate for rate in pilot.sine_rates):
        problem = f"must lie between 0 and {frame_rate:g}, the frame rate"
        raise InputError(file, "pilot.column.sine_rates_rad_per_s", problem)


def _check_deflection(pilot: Pilot, rig: Rig, name: str, file: Path) -> None:
    held = getattr(pilot, "deflection", 0.0)
    travel = rig.controls[cast(ControlName, name)].travel
    if abs(held) > travel:
        raise InputError(
            file,
            f"pilot.{name}.deflection_{unit_of(name)}",
            f"{held:g} is beyond the control's travel of ±{travel:g}",
        )


def _check_bench(bench: Bench, file: Path) -> None:
    if len(bench.time) != len(bench.dynamic_pressure):
        raise InputError(file, "bench.dynamic_pressure_Pa", "needs as many values as time_s")
    if any(b <= a for a, b in pairwise(bench.time)):
        raise InputError(file, "bench.time_s", "must rise from value to value")
    if min(bench.dynamic_pressure) < 0.0:
        raise InputError(file, "bench.dynamic_pressure_Pa", "cannot be negative")
