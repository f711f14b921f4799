"""Numbers of a rig that are guesses, and not measurements: what a table or a figure says of them.

A rig file lists them by their keys in `guesses` of each control, as `"loader.mass_kg"`. A key
leaves the list where the package writes another value for it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from coupled.errors import InputError, joined
from coupled.record.channels import ControlName, unit_of
from coupled.rig.parameters import Control
from coupled.schema import Section, file_keys

_NAMED = 3  # guesses of a control that a sentence names, the weightiest first
_WORDS = {
    "loader.bend": "K",
    "schedule.total_gradient": "the gradients",
    "schedule.force": "the forces",
    "travel": "travel",
    "loader.breakout": "breakout",
    "loader.friction": "friction",
    "loader.mass": "mass",
    "loader.damping": "damping",
    "loader.servo_frequency": "the servo",
}


def guess_note(
    controls: Mapping[ControlName, Control],
    only: Collection[str] = (),
    varied: Collection[str] = (),
) -> str:
    """Return which numbers of a rig's controls are guesses, as one sentence; "" where none is.

    Of the controls named in `only`, or of all. The keys `varied`, as `controls.wheel.travel_rad`,
    are no guesses there, since a sweep flies many values of them.
    """
    said: dict[str, list[str]] = {}
    for name, control in controls.items():
        if name not in (only or controls):
            continue
        path = f"controls.{name}."
        names = _names(control, unit_of(name), [k.removeprefix(path) for k in varied])
        if names:
            said.setdefault(_in_a_row(names), []).append(name)
    if not said:
        return ""
    each = (f"{names} of the {_in_a_row(which)}" for names, which in said.items())
    return f"Guesses, not measurements: {'; '.join(each)}."


def _in_a_row(names: Sequence[str]) -> str:
    """Return the first of some names and how many more there are."""
    if len(names) > _NAMED + 1:
        names = [*names[:_NAMED], f"{len(names) - _NAMED} more"]
    return joined(names)


def _names(control: Control, d: str, varied: Collection[str]) -> list[str]:
    """Return what a control's guesses are called, the weightiest first."""
    given = [_field(control, key, d) for key in control.guesses if key not in varied]
    known = [word for field, word in _WORDS.items() if field in given]
    rest = [field for field in given if field not in _WORDS]
    return known + [field.rpartition(".")[2].replace("_", " ") for field in rest]


def _field(control: Control, key: str, d: str) -> str:
    """Return the field that a key of a control means, as `loader.mass`; "" where there is none."""
    holder: Any = control
    names = []
    for part in key.split("."):
        if not isinstance(holder, Section):
            return ""
        name = file_keys(type(holder), d).get(part, "")
        if not name:
            return ""
        names.append(name)
        holder = getattr(holder, name)
    return ".".join(names) if isinstance(holder, (float, list)) else ""


def check_guesses(control: Control, file: object, path: str, d: str) -> None:
    """Raise InputError for a guess that names no number of the control."""
    for key in control.guesses:
        if not _field(control, key, d):
            problem = f'{key!r} is no number of the control; give its key, as "loader.mass_kg"'
            raise InputError(file, f"{path}.guesses", problem)


def without_guesses(
    controls: Mapping[ControlName, Control], settled: Collection[str]
) -> dict[str, list[str]]:
    """Return the lists of guesses without some numbers: {whole dotted key of a list: its keys}.

    `settled` are whole dotted keys too, as `controls.wheel.travel_rad`.
    """
    return {
        f"controls.{name}.guesses": [
            key for key in control.guesses if f"controls.{name}.{key}" not in settled
        ]
        for name, control in controls.items()
        if control.guesses
    }
