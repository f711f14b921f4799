"""A rig file, read and checked: every fault is one line with its key."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from coupled.errors import InputError, collected, together
from coupled.record.channels import CONTROL_NAMES, unit_of
from coupled.rig.parameters import Control, Flight
from coupled.rig.rig import Rig, checked, of_file
from coupled.schema import build, file_keys, known_keys, loads_toml, read_toml


def read_rig(path: Path, changes: Mapping[str, Any] | None = None) -> Rig:
    """Return the rig of a file, with `changes`: {dotted key: value}."""
    text = read_toml(path)
    table = loads_toml(text, path)
    for key, value in (changes or {}).items():
        if not change(table, key, value):
            raise InputError(path, key, "names a key within a value, not a table")
    rig = rig_from_table(table, path)
    for name, control in rig.controls.items():
        if control.loader.gravity_angle != 0.0 and control.loader.gravity == 0.0:
            problem = "has no effect without gravity_N; give the weight, or leave the angle out"
            raise InputError(path, f"controls.{name}.loader.gravity_angle_rad", problem)
    return of_file(rig, (path, text))


def _placed(flight: Any, file: object) -> Any:
    """Return a `flight` table with the absolute path of its folder of models, if it names one.

    In a rig file the path is relative to the file, so that both can be moved together.
    """
    given = flight.get("model_folder") if isinstance(flight, dict) else None
    if not isinstance(given, str) or not given:
        return flight
    base = file.parent if isinstance(file, Path) else Path()
    name = flight.get("model")
    wanted = f"{name}/{str(flight.get('model_file') or name).removesuffix('.xml')}.xml"
    try:
        folder = (base / given).resolve()
        there = not isinstance(name, str) or (folder / wanted).is_file()
    except (OSError, ValueError):  # not a valid name of a folder
        problem = "is no name of a folder; give the folder that contains the model's folder"
        raise InputError(file, "flight.model_folder", problem) from None
    if not there:
        problem = f"{given!r} contains no {wanted}; give the folder that contains the model's"
        raise InputError(file, "flight.model_folder", problem)
    return {**flight, "model_folder": str(folder)}


def change(table: dict[str, Any], key: str, value: Any) -> bool:
    """Set a dotted key of a table of tables in place; return false if it leads through a value."""
    *parents, last = key.split(".")
    for parent in parents:
        table = table.setdefault(parent, {})
        if not isinstance(table, dict):
            return False
    table[last] = copy.deepcopy(value)
    return True


def rig_from_table(table: Mapping[str, Any], file: object) -> Rig:
    """Return a rig from the tables of a rig file; `file` is named in faults."""
    if "rig" in table and not {"controls", "flight"} & table.keys():
        raise InputError(file, "", "is a run file; give a rig")
    known = file_keys(Rig, "m")
    values = {key: value for key, value in table.items() if key in known}
    faults: list[InputError] = []
    with collected(faults):
        known_keys(table, known, file, "")
    controls = table.get("controls", {})
    if not isinstance(controls, dict) or not (controls or "flight" in table):
        problem = f"needs at least one of {', '.join(CONTROL_NAMES)}, or the file a [flight]"
        raise together([*faults, InputError(file, "controls", problem)])
    with collected(faults):
        known_keys(controls, dict.fromkeys(CONTROL_NAMES), file, "controls")
    made: dict[str, Control] = {}
    for name in [name for name in CONTROL_NAMES if name in controls]:
        with collected(faults):
            made[name] = build(Control, controls[name], file, f"controls.{name}", unit_of(name))
    values["controls"] = made
    if "flight" in values:
        with collected(faults):
            values["flight"] = build(Flight, _placed(values.pop("flight"), file), file, "flight")
    if faults:
        with collected(faults):  # check the rest without controls
            build(Rig, {**values, "controls": {}}, file, "")
        raise together(faults)
    rig = build(Rig, values, file, "")
    return checked(rig, file)
