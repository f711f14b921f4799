"""A rig file with some of its numbers replaced; its comments, order and layout are kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import tomlkit

from coupled.record.channels import unit_of
from coupled.rig.rigdata import RigData
from coupled.rig.rigwrite import rig_table, rig_text
from coupled.schema import Section, file_keys, loads_toml


def edited(text: str, changes: Mapping[tuple[str, ...], Any], remark: str = "") -> str:
    """Return a rig file's text with values replaced, {the parts of a key: value}, or added.

    A remark is put at its head. The text must be valid TOML.
    """
    document: Any = tomlkit.parse(text)
    new: list[Any] = []
    for parts, value in changes.items():
        table = document
        for part in parts[:-1]:
            if part not in table:
                table[part] = tomlkit.table()
                new.append(table[part])
            table = table[part]
        table[parts[-1]] = value
    for table in new:
        table.add(tomlkit.nl())  # between it and the table that follows
    head = "".join(f"# {line}".rstrip() + "\n" for line in remark.splitlines())
    return head + tomlkit.dumps(document).rstrip("\n") + "\n"


def updated(text: str, rig: RigData, filed: Path, folder: Path | None = None) -> str:
    """Return a rig file's text with the values of another rig: read again, it gives that rig.

    `text` is that of the file `filed`. Values that are the same stay as they are written; a key
    that the rig lacks is left out, and one that differs from its default is added. A folder of
    models stays relative if the text is written to `folder` and it is the same from there.
    """
    document: Any = tomlkit.parse(text)
    whole = rig_table(rig)
    models = document.get("flight", {}).get("model_folder")
    if models and folder is not None and rig.flight is not None:
        there = str((folder / str(models)).resolve())
        if there == whole["flight"]["model_folder"]:
            whole["flight"]["model_folder"] = models
    _update(document, whole, loads_toml(rig_text(rig), filed))
    return tomlkit.dumps(document)


def _update(table: Any, whole: Mapping[str, Any], needed: Mapping[str, Any]) -> None:
    """Give a table of a document the values of `whole`; add what is `needed` and not there."""
    for key in list(table):
        if key not in whole:
            del table[key]
        elif isinstance(whole[key], dict):
            _update(table[key], whole[key], needed.get(key, {}))
        elif table[key] != whole[key]:
            table[key] = whole[key]
    for key, value in needed.items():
        if key not in table:
            table[key] = value


def differences(old: RigData, new: RigData) -> dict[tuple[str, ...], Any]:
    """Return the values that differ between two rigs of the same controls, by their keys.

    A number that differs is no longer a guess.
    """
    found = dict(_within((), old, new, "m"))
    if old.flight is not None and new.flight is not None:
        found |= _within(("flight",), old.flight, new.flight, "m")
        if new.flight.folder:  # an absolute path, since the new file may be in another folder
            found["flight", "model_folder"] = new.flight.folder
    for name, control in new.controls.items():
        d = unit_of(name)
        path = ("controls", str(name))
        found |= _within(path, old.controls[name], control, d)
        added = old.controls[name].loader.servo_frequency == 0.0 < control.loader.servo_frequency
        if added:  # a file has both numbers of a servo, or none
            ratio = control.loader.servo_damping_ratio
            found[(*path, "loader", "servo_damping_ratio")] = ratio
        settled = [".".join(key[2:]) for key in found if key[:2] == path]
        kept = [key for key in control.guesses if key not in settled]
        if kept != old.controls[name].guesses:
            found[(*path, "guesses")] = kept
    return found


def _within(
    path: tuple[str, ...], old: Section, new: Section, d: str
) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Yield the values that differ in a section, with those of its own sections."""
    for key, field in file_keys(type(new), d).items():
        before, after = getattr(old, field), getattr(new, field)
        if isinstance(after, Section) and isinstance(before, Section):
            if field != "flight":
                yield from _within((*path, key), before, after, d)
        elif isinstance(after, dict) and field != "controls":
            for name, value in after.items():
                if before.get(name) != value:
                    yield (*path, key, name), value
        elif isinstance(after, (bool, int, float, str, list)) and before != after:
            yield (*path, key), after
