"""The folder of an export, and the runs in it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from coupled.errors import InputError
from coupled.exporting.conditions import unknown_condition
from coupled.exporting.model import Files
from coupled.exporting.write import Export, Flown
from coupled.files import check_target
from coupled.flight.altered import ALTERATIONS
from coupled.flight.manoeuvre import Manoeuvre
from coupled.outputs import Outputs
from coupled.resources import shipped_runs
from coupled.rig.rig import Rig
from coupled.schema import load_toml

MARK = "coupled-export.json"  # identifies a folder of an export, which may be overwritten


def check_folder(folder: Path) -> None:
    """Raise InputError for a folder that cannot be written, or has other files than an export."""
    if folder.is_file():
        raise InputError(folder, "", "is a file; name a folder")
    if folder.is_dir() and any(folder.iterdir()) and not (folder / MARK).is_file():
        raise InputError(folder, "", "holds files that are no export; name a new folder")
    check_target(folder / MARK, made=folder)


def write_export(made: Export, folder: Path) -> None:
    """Write an export into its folder, all files or none; files of a former one are removed."""
    before = _former(folder)
    files: Files = dict(made.files)
    with Outputs() as outputs:
        for place, text in files.items():
            outputs.at(folder / place).write_bytes(text)
        mark = {
            "rig": made.rig.name,
            "loader_steps": made.substeps,
            "left_out": list(made.left),
            "is_scripted": list(made.scripted),
            "beside": [one.as_dict() for one in made.beside],
            "files": sorted(map(str, files)),
        }
        outputs.at(folder / MARK).write_text(json.dumps(mark, indent=1), encoding="utf-8")
    for name in before - set(map(str, files)):
        if (folder / name).resolve().is_relative_to(folder.resolve()):
            (folder / name).unlink(missing_ok=True)


def _former(folder: Path) -> set[str]:
    """Return the paths of a former export's files."""
    try:
        found = json.loads((folder / MARK).read_text(encoding="utf-8"))["files"]
        return {name for name in found if isinstance(name, str)}
    except (OSError, ValueError, KeyError, TypeError):
        return set()


def runs_of(rig_name: str) -> list[str]:
    """Return the shipped runs of a shipped rig."""
    return [name for name, path in shipped_runs().items() if load_toml(path)["rig"] == rig_name]


def exportable(rig: Rig, cases: Sequence[Manoeuvre]) -> tuple[list[Flown], list[str]]:
    """Return the cases that fly with this export, and those that need another, with the reason.

    A script can set the aircraft's position, speed and levers, and the corrections; another loader,
    frame or model needs another export.
    """
    flown, others = list[Flown](), list[str]()
    for case in cases:
        if key := unknown_condition(case):
            others.append(f"{case.name}: {case.label}: {key} is not exported")
            continue
        if why := _differs(rig, case.rig):
            others.append(f"{case.name}: {case.label}: {why}; export it with --case")
            continue
        switched = [c for c in case.configurations if c != "calibrated low"]
        if len(switched) < len(case.configurations):
            others.append(
                f"{case.name}: {case.label}, calibrated low: its S₁ is another; make a rig of it"
            )
        flown.append(Flown(case, tuple(switched)))
    return flown, others


def _differs(rig: Rig, other: Rig) -> str:
    """Return why a case's rig cannot fly with another's export, or nothing."""
    if set(rig.controls) != set(other.controls) or rig.structure != other.structure:
        return "other controls"
    differs = [
        f"another {n}" for n, control in rig.controls.items() if other.controls[n] != control
    ]
    if rig.frame_rate != other.frame_rate:
        differs.append(f"frame_rate_Hz = {other.frame_rate:g}")
    if rig.flight is None or other.flight is None:
        return (
            ""
            if rig.flight is other.flight and not differs
            else (differs or ["another aircraft"])[0]
        )
    loaded = ("model", "model_file", "steps_per_frame", "terms")
    for key in (*loaded, *(a.part.name for a in ALTERATIONS)):
        if getattr(rig.flight, key) != getattr(other.flight, key):
            differs.append(f"flight.{key} = {getattr(other.flight, key)}")
    return differs[0] if differs else ""
