"""A run file: the rig, the pilots, the duration, and the measurements.

A run may have several cases: the same run with some values of rig or pilot changed, each by a
dotted key. Every case and pilot is checked before anything is flown.
"""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Annotated, Any, cast

from coupled.errors import InputError, collected, nearest, together
from coupled.flight.conditions import Conditions, build_conditions
from coupled.flight.expectation import Expect, check_expectations
from coupled.flight.manoeuvre import (
    CONFIGURATIONS,
    Configuration,
    Flown,
    Manoeuvre,
    Measure,
    PressureProfile,
    Source,
)
from coupled.flight.pilot import PILOTS, ForceTable, Pilot
from coupled.record.channels import CONTROL_NAMES, ControlName, unit_of
from coupled.resources import find, find_named, shipped_rigs, shipped_runs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import change, read_rig
from coupled.schema import Section, build, file_keys, known_keys, load_toml, quantity, text_like


class Case(Section):
    """A variant of the run: dotted keys of rig and pilot, with their new values."""

    label: Annotated[
        str, text_like(r"[^\x00-\x1f\x7f]{1,120}", "should be one line of 1 to 120 characters")
    ]
    rig: dict[str, Any] = {}
    pilot: dict[str, Any] = {}


class RunFile(Flown, Conditions):
    """The tables of a run file, without its pilots."""

    card: str = quantity("", min_length=1)
    rig: str = quantity("", min_length=1)
    configurations: list[Configuration] = quantity("", list(CONFIGURATIONS), min_length=1)
    measure: Measure = Measure()
    bench: PressureProfile | None = None
    case: list[Case] = []
    expect: list[Expect] = []


def read_run(name: str) -> list[Manoeuvre]:
    """Return the cases of a run file, given by path or by the name of a shipped one."""
    file = find(name, shipped_runs(), "run")
    return manoeuvres_from_table(load_toml(file), file)


def manoeuvres_from_table(table: dict[str, Any], file: Path) -> list[Manoeuvre]:
    """Return the cases of a run from its file's tables; `file` is named in faults."""
    if "rig" not in table and ("controls" in table or "flight" in table):
        raise InputError(file, "", "is a rig file; give a run (coupled new run writes one)")
    pilots = table.pop("pilot", None)
    keys = {**file_keys(RunFile, "m"), "pilot": "pilot"}
    run = _checked_run(table, keys, pilots, file)
    if run.bench is not None:
        run.bench.check(file)
    _refuse_duplicates(run, file)
    variants = run.case or [Case(label=run.name)]
    found = [_manoeuvre(run, file, pilots, case, i) for i, case in enumerate(variants)]
    channels = {each.label: each.channels for each in found}
    check_expectations(run.expect, file, channels, run.configurations, run.duration)
    return found


def _checked_run(table: dict[str, Any], keys: dict[str, str], pilots: Any, file: Path) -> RunFile:
    """Return a run file's tables, checked; all their faults are raised together."""
    faults: list[InputError] = []
    with collected(faults):
        known_keys(table, keys, file, "")
    if "bench" in table:
        with collected(faults):
            table["bench"] = build(PressureProfile, table["bench"], file, "bench")
    with collected(faults):
        build_conditions(table, file)
    for key, each in (("case", Case), ("expect", Expect)):
        listed = table.get(key, [])
        if not isinstance(listed, list):
            faults.append(InputError(file, key, f"each is written [[{key}]]"))
            continue
        made = []
        for i, item in enumerate(listed):
            with collected(faults):
                made.append(build(each, item, file, f"{key}[{i}]"))
        table[key] = made
    if not faults:
        with collected(faults):
            return build(RunFile, table, file, "")
    else:
        sections = ("bench", "case", "expect", *Conditions.model_fields)
        plain = {key: value for key, value in table.items() if key in keys and key not in sections}
        with collected(faults):
            build(RunFile, plain, file, "")
    _add_rig_faults(table, pilots, file, faults)
    raise together(faults)


def _add_rig_faults(
    table: dict[str, Any], pilots: Any, file: Path, faults: list[InputError]
) -> None:
    """Add the faults of the rig that a run names, and of its pilots' controls."""
    named = table.get("rig")
    if isinstance(named, str) and named:  # otherwise there is a fault already
        with collected(faults):
            _pilots(pilots, read_rig(find_named(file, "rig", named, shipped_rigs(), "rig")), file)


def _manoeuvre(run: RunFile, file: Path, pilots: Any, case: Case, index: int) -> Manoeuvre:
    rig_file = find_named(file, "rig", run.rig, shipped_rigs(), "rig")
    rig = _changed_rig(rig_file, case, file, index)
    pilots = copy.deepcopy(pilots)
    for key, value in case.pilot.items():
        place = f"case[{index}].pilot.{key}"
        if not isinstance(pilots, dict) or key.split(".")[0] not in pilots or "." not in key:
            raise InputError(file, place, "no such pilot; write CONTROL.KEY of one in this run")
        if not change(pilots, key, value):
            raise InputError(file, place, "names a key within a value, not a table")
    conditions = {key: getattr(run, key) for key in Conditions.model_fields}
    try:
        return Manoeuvre(
            rig,
            _pilots(pilots, rig, file),
            run.duration,
            run.seed,
            Conditions(**conditions),
            run.bench,
            tuple(run.record_properties),
            tuple(run.configurations),
            run.measure,
            tuple(run.expect),
            run.name,
            case.label,
            run.card,
            Source(file, rig_file, case.rig),
        ).begun()
    except InputError as error:
        if error.key.removeprefix("pilot.") in case.pilot:
            raise InputError(error.file, f"case[{index}].{error.key}", error.problem) from None
        raise


def _refuse_duplicates(run: RunFile, file: Path) -> None:
    lists: dict[str, list[Any]] = {
        "record_properties": run.record_properties,
        "configurations": list(run.configurations),
        "case": [case.label for case in run.case],
    }
    for key, values in lists.items():
        for value in values:
            if values.count(value) > 1:
                raise InputError(file, key, f"duplicate {value!r}")


def _changed_rig(rig_file: Path, case: Case, file: Path, index: int) -> Rig:
    """Return the rig of a case; faults that only the case causes name the case."""
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
    """Return the pilots of a run's tables; a force table's file is beside the run."""
    rig.check_controlled(rig.file)
    if not isinstance(tables, dict) or not tables:
        raise InputError(file, "pilot", f"needs at least one of {', '.join(rig.controls)}")
    known_keys(tables, dict.fromkeys(CONTROL_NAMES), file, "pilot")
    pilots: dict[ControlName, Pilot] = {}
    for name, table in tables.items():
        control, path = cast(ControlName, name), f"pilot.{name}"
        if control not in rig.controls:
            raise InputError(file, path, f"the rig has no {name}; {nearest(name, rig.controls)}")
        if not isinstance(table, dict) or "kind" not in table:
            raise InputError(file, f"{path}.kind", f"is missing; one of {', '.join(PILOTS)}")
        kind = table["kind"]
        if not isinstance(kind, str) or kind not in PILOTS:
            raise InputError(file, f"{path}.kind", f"is {kind!r}; {nearest(str(kind), PILOTS)}")
        known_keys(table, PILOTS[kind].keys_on(control), file, path)
        pilot = build(PILOTS[kind], table, file, path, unit_of(name))
        if isinstance(pilot, ForceTable) and pilot.file:
            pilot = pilot.beside(file.parent)
        pilots[control] = pilot
    return pilots
