"""A rig as the text of a rig file, which `rigfile` reads back.

Values at their defaults are left out, except for those that a file must give together; floats are
written so that they read back the same.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from coupled.record.channels import unit_of
from coupled.rig.curves import Curve
from coupled.rig.rigdata import RigData
from coupled.schema import Section, file_keys


def rig_text(rig: RigData, remark: str = "") -> str:
    """Return a rig file's text, with a remark at its head."""
    lines = [f"# {line}".rstrip() for line in remark.splitlines()]
    lines += _values(rig, "m")
    if rig.flight is not None:
        lines += ["", "[flight]", *_values(rig.flight, "m")]
        lines += _mapping("flight.properties", rig.flight.properties)
        lines += _mapping("flight.terms", rig.flight.terms)
    lines += _mapping("noise", rig.noise)
    lines += _table("structure", rig.structure, "m")
    for name, control in rig.controls.items():
        lines += _table(f"controls.{name}", control, unit_of(name))
        lines += _mapping(f"controls.{name}.tolerance", control.tolerance)
    return "\n".join(lines).lstrip("\n") + "\n"


def rig_table(rig: RigData) -> dict[str, Any]:
    """Return a rig as the tables of a rig file, every key with its unit, defaults included.

    Parts that the rig lacks, such as a flight on a bench, are left out: the tables read back as the
    rig.
    """
    table = section_table(rig, "m")
    controls = {name: section_table(each, unit_of(name)) for name, each in rig.controls.items()}
    return table | {"controls": controls}


def section_table(section: Section, d: str) -> dict[str, Any]:
    """Return a section's values by their keys in a file, for deflections in unit `d`."""
    found = {}
    for key, field in file_keys(type(section), d).items():
        value = getattr(section, field)
        if value is not None and not (isinstance(value, Curve) and not value.nodes):
            found[key] = section_table(value, d) if isinstance(value, Section) else value
    return found


def _table(path: str, section: Section, d: str) -> Iterator[str]:
    """Yield a section's table, then those within it."""
    values = list(_values(section, d))
    if values:
        yield from ("", f"[{path}]", *values)
    for key, field in file_keys(type(section), d).items():
        inner = getattr(section, field)
        if isinstance(inner, Section):
            yield from _table(f"{path}.{key}", inner, d)


def _values(section: Section, d: str) -> Iterator[str]:
    """Yield the lines of a section's plain values."""
    for key, field in file_keys(type(section), d).items():
        value = getattr(section, field)
        plain = isinstance(value, (bool, int, float, str, list))
        known = type(section).model_fields[field]
        marks = known.json_schema_extra
        always = isinstance(marks, dict) and marks.get("written") is True
        if plain and (always or value != known.default):
            yield f"{key} = {_shown(value)}"


def _mapping(path: str, values: dict[str, float]) -> list[str]:
    lines = [f"{json.dumps(name)} = {_shown(value)}" for name, value in values.items()]
    return ["", f"[{path}]", *lines] if lines else []


def toml_string(text: str) -> str:
    """Return a text in quotes, with quotes and line ends in it escaped."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return toml_string(value)
    if isinstance(value, list):
        return "[" + ", ".join(_shown(item) for item in value) + "]"
    return repr(value)
