"""A rig file with some of its numbers replaced; its comments, order and layout are kept."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import tomlkit

from coupled.record.channels import unit_of
from coupled.rig.rig import Rig
from coupled.schema import Section, file_keys


def edited(text: str, changes: Mapping[tuple[str, ...], Any], remark: str = "") -> str:
    """Return a rig file's text with values replaced, {the parts of a key: value}, or added.

    A remark is put at its head. The text must be valid TOML.
    """
    document: Any = tomlkit.parse(text)
    for parts, value in changes.items():
        table = document
        for part in parts[:-1]:
            if part not in table:
                table[part] = tomlkit.table()
            table = table[part]
        table[parts[-1]] = value
    head = "".join(f"# {line}".rstrip() + "\n" for line in remark.splitlines())
    return head + tomlkit.dumps(document)


def differences(old: Rig, new: Rig) -> dict[tuple[str, ...], Any]:
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
