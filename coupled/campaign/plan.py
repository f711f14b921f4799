"""A sweep file: the run, its varied keys, and the results kept of each flight.

Every value is checked on the run's files before the first flight. A combination that cannot be
flown becomes a row with the reason.
"""

from __future__ import annotations

import copy
import hashlib
import json
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import numpy as np

from coupled.campaign.entry import Columns
from coupled.campaign.points import points
from coupled.campaign.sweepfile import SweepFile, Vary, flight_count, read_sections
from coupled.errors import InputError, collected, nearest, together
from coupled.files import sha256
from coupled.flight.loop import make_airframe
from coupled.flight.manifest import input_files
from coupled.flight.manoeuvre import Configuration, Manoeuvre
from coupled.flight.pilot import Pilot
from coupled.flight.pilot.own import check_pickled
from coupled.flight.runfile import manoeuvres_from_table
from coupled.record.channels import ControlName
from coupled.resources import find_named, shipped_runs
from coupled.rig.rigfile import change
from coupled.schema import load_toml

# Tables whose keys are names in the aircraft's model.
_OF_MODEL = ("flight.properties.", "flight.terms.")


@dataclass(frozen=True)
class PlannedFlight:
    """One flight of a sweep: its number, its changes, and the run's noise seed if it has one.

    `configuration` is empty for the rig as filed.
    """

    number: int
    changes: Mapping[str, Any]
    configuration: Configuration | Literal[""]
    seed: int | None


@dataclass(frozen=True)
class SweepPlan:
    """A sweep ready to fly: `table` are the run's tables, `files` all input files.

    `own` are pilots in place of the run's, which no file describes.
    """

    sweep: SweepFile
    file: Path
    run_file: Path
    table: Mapping[str, Any]
    identity: str
    files: frozenset[Path] = frozenset()
    own: Mapping[ControlName, Pilot] = field(default_factory=dict)

    @property
    def keys(self) -> list[str]:
        """The varied keys, one for each parameter."""
        return [vary.key for vary in self.sweep.vary]

    @property
    def columns(self) -> Columns:
        """The columns of the sweep's journal and table."""
        sweep = self.sweep
        figures = (*sweep.keep, *extreme_names(sweep.extremes))
        return Columns(tuple(self.keys), figures, bool(sweep.survive), flight_count(sweep))

    def scenario(self, changes: Mapping[str, Any]) -> Manoeuvre:
        """Return the run's case with changed values, by their dotted keys."""
        found = _changed(self.table, self.run_file, self.sweep.case, changes)
        return replace(found, pilots={**found.pilots, **self.own}) if self.own else found

    def flown_by(self, own: Mapping[ControlName, Pilot]) -> SweepPlan:
        """Return the sweep with pilots in place of the run's, each of which can be pickled."""
        if not own:
            return self
        check_pickled(own, "coupled.sweep")
        sweep = replace(self, own=own)
        sweep.scenario({})  # refuses a control that the rig lacks
        digest = hashlib.sha256(self.identity.encode() + pickle.dumps(dict(own)))
        return replace(sweep, identity=digest.hexdigest())


def read_plan(file: Path) -> SweepPlan:
    """Return the sweep of a file, with every value checked; faults of the run name the run."""
    return plan_from_table(load_toml(file), file)


def plan_from_table(given: Mapping[str, Any], file: Path) -> SweepPlan:
    """Return the sweep of a file's tables; `file` is named in faults.

    A run given by a relative path is first searched beside the file.
    """
    sweep = read_sections(given, file)
    run_file = find_named(file, "run", sweep.run, shipped_runs(), "run")
    run_table = load_toml(run_file)
    try_changes = partial(_changed, run_table, run_file, sweep.case)
    if sweep.case is not None:
        labels = [scenario.label for scenario in manoeuvres_from_table(dict(run_table), run_file)]
        if sweep.case not in labels:
            raise InputError(file, "case", f"no {sweep.case!r}; {nearest(sweep.case, labels)}")
    base = try_changes({})
    files, faults = set(input_files(base)), list[InputError]()
    with collected(faults):
        files |= _check_keys(sweep, file, try_changes)
    named = [("extremes", channel) for channel in sweep.extremes]
    named += [(f"survive[{i}].channel", each.channel) for i, each in enumerate(sweep.survive)]
    for key, channel in named:
        if channel not in base.channels:
            hint = nearest(channel, base.channels)
            faults.append(InputError(file, key, f"no channel {channel!r}; {hint}"))
    if faults:
        raise together(faults)
    return SweepPlan(sweep, file, run_file, run_table, _identity(sweep, files), frozenset(files))


def planned_flights(plan: SweepPlan) -> list[PlannedFlight]:
    """Return every flight of a sweep, reproducible from its file."""
    sweep, found = plan.sweep, list[PlannedFlight]()
    configurations: list[Any] = list(sweep.configurations) or [""]
    for i, values in enumerate(points(sweep)):
        changes = {
            key: value
            for vary, value in zip(sweep.vary, values, strict=True)
            for key in (vary.key, *vary.also)
        }
        seed = int(np.random.default_rng([sweep.seed, i]).integers(2**31)) if sweep.reseed else None
        for configuration in configurations:
            found.append(PlannedFlight(len(found), changes, configuration, seed))
    return found


def _changed(
    table: Mapping[str, Any], file: Path, label: str | None, changes: Mapping[str, Any]
) -> Manoeuvre:
    tables = copy.deepcopy(dict(table))
    tables.pop("expect", None)
    listed = tables.get("case", []) or [{"label": str(tables.get("name", "run"))}]
    if not (isinstance(listed, list) and all(isinstance(case, dict) for case in listed)):
        return manoeuvres_from_table(tables, file)[0]  # which refuses it
    chosen = [c for c in listed if label in (None, c.get("label"))]
    case = chosen[0] if chosen else listed[0]
    for key, value in changes.items():
        head, _, rest = key.partition(".")
        event, known = rest.partition(".")[0], tables.get("event", {})
        if head == "event" and isinstance(known, dict) and event not in known:
            near = nearest(event, known) if known else "it has none"
            raise InputError(file, key, f"the run has no event {event!r}; {near}")
        if head in ("rig", "pilot") and rest:
            case.setdefault(head, {})[rest] = value
        elif not change(tables, key, value):
            raise InputError(file, key, "names a key within a value, not a table")
    tables["case"] = [case]
    return manoeuvres_from_table(tables, file)[0]


def extreme_names(channels: Sequence[str]) -> list[str]:
    """Return the names of the figures for the extremes of channels."""
    return [f"{which}_{name}" for name in channels for which in ("least", "greatest")]


def _check_keys(
    sweep: SweepFile, file: Path, try_changes: Callable[[dict[str, Any]], Manoeuvre]
) -> set[Path]:
    """Check every value alone, and return the files that its flight would read.

    Raises the first fault of each parameter, together.
    """
    files, faults = set[Path](), list[InputError]()
    for i, vary in enumerate(sweep.vary):
        values = vary.values if vary.values is not None else [vary.low, vary.high]
        for value in values:
            try:
                scenario = try_changes(dict.fromkeys((vary.key, *vary.also), value))
                if value is values[0] and any(table in vary.key for table in _OF_MODEL):
                    _check_name(scenario, vary.key)
            except InputError as error:
                faults.append(_named_error(vary, i, value, error, file, try_changes))
                break
            files |= set(input_files(scenario))
    if faults:
        raise together(faults)
    return files


def _named_error(
    vary: Vary,
    index: int,
    value: Any,
    error: InputError,
    file: Path,
    try_changes: Callable[[dict[str, Any]], Manoeuvre],
) -> InputError:
    """Return the fault of a value, with the key that does not accept it."""
    key = next((k for k in (vary.key, *vary.also) if error.key.endswith(k)), "")
    if not key and vary.also:
        for each in (vary.key, *vary.also):
            try:
                try_changes({each: value})
            except InputError as own:
                key, error = each, own
                break
    key = key or vary.key
    where = error.key.removeprefix("case[0].")
    named = "" if where == "" or where.endswith(key) else f"{where}: "
    place = f"vary[{index}]" if key == vary.key else f"vary[{index}].also"
    return InputError(file, place, f"{key} = {value!r}: {named}{error.problem}")


def _check_name(scenario: Manoeuvre, key: str) -> None:
    """Refuse a name that the aircraft's model lacks; a failure to trim is a row of the table."""
    try:
        make_airframe(scenario)
    except InputError as error:
        if error.key.endswith(key):
            raise


def _identity(sweep: SweepFile, files: set[Path]) -> str:
    """Return the hash of a sweep's inputs: its keys, its files, the versions."""
    content = {
        "sweep": sweep.model_dump(exclude={"name"}),
        "files": sorted(sha256(path) for path in files if path.is_file()),
        "versions": {name: version(name) for name in ("coupled", "jsbsim", "numpy", "scipy")},
    }
    text = json.dumps(content, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()
