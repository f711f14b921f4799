"""Tables of a TOML file as frozen, validated data; every error is one line with its key.

A field's key in a file is its name and its unit: `travel` with unit `{d}` is `travel_m`, or
`travel_rad` for a wheel. The fields have no unit in their name, so that the code is the same for
all controls.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from coupled.errors import MISSING, InputError, collected, nearest, shown_value, together
from coupled.files import read_text, toml_tables


class Section(BaseModel):
    """A table of a file, frozen."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        allow_inf_nan=False,
        strict=True,
        protected_namespaces=(),  # pydantic 2.9 keeps all names that begin with model_
    )


class Given(Section):
    """A section that can also be created in Python, with its field names as keywords.

    Values that a file may not have are refused here too, with an InputError that names the class.
    """

    def __init__(self, *positional: Any, **values: Any) -> None:
        name, keys = f"coupled.{type(self).__name__}", file_keys(type(self), "m")
        if positional:
            needed = [key for key, info in type(self).model_fields.items() if info.is_required()]
            first = next(iter(needed or keys))
            raise TypeError(f"{name}: takes its values by name; give {first}=…")
        plain = {key: plain_value(value) for key, value in values.items()}
        known_keys(plain, keys, name, "")
        for key, value in plain.items():
            _refuse_unreal(value, name, key)
        try:
            super().__init__(**plain)
        except ValidationError as error:
            raise _first_fault(error, keys, name, "") from None


class Lenient(Section):
    """A section of a file that other programs may extend: unknown keys are ignored."""

    model_config = ConfigDict(extra="ignore")


def plain_value(value: Any) -> Any:
    """Return a numpy array or number, a tuple or a table as a value of a TOML file."""
    if isinstance(value, Mapping):
        return {key: plain_value(each) for key, each in value.items()}
    if hasattr(value, "tolist"):
        return value.tolist()
    return list(value) if isinstance(value, tuple) else value


S = TypeVar("S", bound=Section)
LARGEST = 1e12  # upper limit of all quantities of a rig or a record, in SI
SMALLEST = 1e-30  # lower limit of nonzero sizes
MOST_TOML_bytes = 2**20  # tomllib takes seconds for a MiB
MOST_FAULTS = 20  # errors of one table that are reported
MOST_DOTS = 100  # in a dotted key; tomllib's time grows with their square


def quantity(unit: str, default: Any = ..., *, written: bool = False, **bounds: Any) -> Any:
    """Declare a field with a unit; `{d}` stands for the control's unit of deflection.

    With `written`, the package writes it also at its default.
    """
    return Field(default, json_schema_extra={"unit": unit, "written": written}, **bounds)


def derived(default: Any) -> Any:
    """Declare a field that is not in files but computed from other sections."""
    return Field(default, json_schema_extra={"derived": True})


def named(key: str, default: Any = ..., **bounds: Any) -> Any:
    """Declare a field whose key in a file is reserved by Python or pydantic."""
    return Field(default, json_schema_extra={"key": key}, **bounds)


def text_like(pattern: str, wanted: str) -> AfterValidator:
    """Return a validator for texts that match a pattern; `wanted` is for the error message."""
    matches = re.compile(pattern).fullmatch

    def check(text: str) -> str:
        if matches(text) is None:
            raise ValueError(wanted)
        return text

    return AfterValidator(check)


def file_keys(section: type[Section], d: str) -> dict[str, str]:
    """Return {key in a file: field} of a section, for deflections in unit `d`."""
    return dict(_file_keys(section, d))


@cache
def _file_keys(section: type[Section], d: str) -> dict[str, str]:
    keys = {}
    for name, info in section.model_fields.items():
        extra = info.json_schema_extra
        marks = extra if isinstance(extra, dict) else {}
        unit = str(marks.get("unit", "")).format(d=d)
        if marks.get("derived"):
            continue
        key = str(marks.get("key", name))
        keys[f"{key}_{unit}" if unit else key] = name
    return keys


def load_toml(path: Path) -> dict[str, Any]:
    """Return a TOML file's tables."""
    return loads_toml(read_toml(path), path)


def read_toml(path: Path) -> str:
    """Return a TOML file's text."""
    return read_text(path, "a TOML file is wanted", MOST_TOML_bytes)


def loads_toml(text: str, file: object) -> dict[str, Any]:
    """Return the tables of a TOML text; `file` is named in faults."""
    for number, line in enumerate(text.split("\n"), 1):
        if line.count(".") > MOST_DOTS and _dots(line) > MOST_DOTS:
            raise InputError(file, f"line {number}", f"a key of more than {MOST_DOTS} parts")
    try:
        return copy.deepcopy(toml_tables(text))
    except (ValueError, RecursionError) as error:
        raise InputError(file, "", f"is not valid TOML: {error}") from None


_TOKEN = re.compile(r""""(?:[^"\\]|\\.)*"|'[^']*'|[A-Za-z0-9_-]+|[ \t]+|.""", re.DOTALL)


def _dots(line: str) -> int:
    """Return the number of dots of the longest dotted key of a line."""
    most = dots = 0
    for match in _TOKEN.finditer(line):
        token = match[0]
        if token == ".":
            dots += 1
        elif not (token[0] in "\"'-_ \t" or token[0].isalnum()):
            dots = 0
        most = max(most, dots)
    return most


def known_keys(table: Any, keys: Mapping[str, object], file: object, path: str) -> dict[str, Any]:
    """Return the table, checked to be one and to have known keys only."""
    if not isinstance(table, dict):
        raise InputError(file, path, f"should be a table, is {shown_value(table)}")
    faults = []
    for key in table:
        if key in keys:
            continue
        dotted = f"{path}.{key}" if path else key
        meant = _other_unit(key, keys)
        hint = f"unknown key; {nearest(key, keys)}"
        faults.append(
            InputError(file, dotted, f"wrong unit: give {meant} instead" if meant else hint)
        )
        if len(faults) == MOST_FAULTS:
            break
    if faults:
        raise together(faults)
    return table


def _other_unit(key: str, keys: Mapping[str, object]) -> str:
    """Return the known key with the same name and another unit, or ""."""
    if len(key) > 100:
        return ""
    for known in sorted(keys, key=len, reverse=True):
        parts = known.split("_")
        for cut in range(len(parts) - 1, 0, -1):
            stem = "_".join(parts[:cut])
            unit = parts[cut]
            looks_like_unit = unit.lower() != unit or unit in _UNITS
            if looks_like_unit and (key == stem or key.startswith(stem + "_")):
                rest = key[len(stem) + 1 :].split("_", maxsplit=1)[0]
                if rest == "" or rest in _UNITS or rest.lower() != rest:
                    return known
    return ""


_UNITS = frozenset(
    re.findall(
        r"\w+",
        "m mm cm in inch ft rad deg degrees kg g lb lbs lbf slug n kn pa psf psi s ms min h hz kt"
        " kts knots per norm v volt volts bits",
    )
)


def build(section: type[S], table: Any, file: object, path: str, d: str = "m") -> S:
    """Return a section made from its table, subsections made by their own classes.

    `path` is the dotted place of the table in `file`; `d` the unit of deflection.
    """
    keys = file_keys(section, d)
    if not isinstance(table, dict):
        known_keys(table, keys, file, path)
    faults: list[InputError] = []
    with collected(faults):
        known_keys(table, keys, file, path)
    values = {}
    for key in [key for key in table if key in keys]:
        kind = section.model_fields[keys[key]].annotation
        dotted = f"{path}.{key}" if path else key
        with collected(faults):
            value = table[key]
            if isinstance(kind, type) and issubclass(kind, Section):
                value = build(kind, value, file, dotted, d)
            else:
                _refuse_unreal(value, file, dotted)
            values[keys[key]] = value
    made: S | None = None
    try:
        made = _made(section, values)
    except ValidationError as error:
        faults += _faults(error, keys, file, path)
    if faults or made is None:
        raise together(faults)
    return made


def read_as(section: type[S], table: Any, file: object, path: str = "") -> S:
    """Return validated data of another program; `path` is the dotted place of the table in `file`.

    Raises InputError for each value that the section does not allow.
    """
    keys = file_keys(section, "m")
    if not isinstance(table, dict):
        known_keys(table, keys, file, path)
    try:
        return section(**{keys[key]: value for key, value in table.items() if key in keys})
    except ValidationError as error:
        raise _first_fault(error, keys, file, path) from None


def _made(section: type[S], values: Mapping[str, Any]) -> S:
    """Return a section from values by field; raises pydantic's ValidationError.

    A section created in Python names its class in errors; here the error is that of a file.
    """
    made = section.__new__(section)
    BaseModel.__init__(made, **values)
    return made


def faults_of(error: ValidationError, section: type[Section], name: str) -> InputError:
    """Return the errors of a section that is created in Python, by its field names."""
    return _first_fault(error, {field: field for field in section.model_fields}, name, "")


def grouped(changes: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return changes by the first part of their dotted keys; the key of a whole part is empty."""
    found: dict[str, dict[str, Any]] = {}
    for key, value in changes.items():
        first, _, rest = key.partition(".")
        found.setdefault(first, {})[rest] = value
    return found


def changed(
    section: S, changes: Mapping[str, Any], file: object, path: str = "", d: str = "m"
) -> S:
    """Return a section with some values replaced, {dotted key of a file: value}, validated.

    A value may be a whole section, or the table of one. Errors are those of a file's table.
    """
    keys = file_keys(type(section), d)
    groups = grouped(changes)
    known_keys(dict(groups), keys, file, path)
    fields = type(section).model_fields
    values = {name: getattr(section, name) for name in fields}
    for key, inner in groups.items():
        dotted = f"{path}.{key}" if path else key
        before = values[keys[key]]
        if "" in inner:
            value = inner[""]
            kind = _section_of(fields[keys[key]].annotation)
            if kind is not None and isinstance(value, Mapping):
                value = build(kind, dict(value), file, dotted, d)
            _refuse_unreal(value, file, dotted)
        elif isinstance(before, Section):
            value = changed(before, inner, file, dotted, d)
        elif isinstance(before, dict):
            value = {**before, **inner}
            _refuse_unreal(inner, file, dotted)
        else:
            raise InputError(
                file,
                f"{dotted}.{next(iter(inner))}",
                "names a key within a value, not a table",
            )
        values[keys[key]] = value
    try:
        return _made(type(section), values)
    except ValidationError as error:
        raise _first_fault(error, keys, file, path) from None


def _section_of(annotation: Any) -> type[Section] | None:
    """Return the section that a field holds, alone or optionally, if any."""
    kinds = () if get_origin(annotation) is dict else get_args(annotation) or (annotation,)
    return next((k for k in kinds if isinstance(k, type) and issubclass(k, Section)), None)


def _refuse_unreal(value: Any, file: object, key: str) -> None:
    if isinstance(value, dict):
        for name, one in value.items():
            _refuse_unreal(one, file, f"{key}.{name}")
    for number in value if isinstance(value, list) else [value]:
        if isinstance(number, list):
            _refuse_unreal(number, file, key)
        if not isinstance(number, (int, float)):
            continue
        if LARGEST < abs(number) < float("inf"):
            raise InputError(file, key, f"{shown_value(number)} is larger than any real one")
        if 0.0 < abs(number) < SMALLEST:
            raise InputError(
                file, key, f"{shown_value(number)} is smaller than any real one; give 0"
            )


# Messages that replace those of pydantic.
_WANTED = {
    **dict.fromkeys(("dict_type", "model_type", "mapping_type"), "should be a table"),
    **dict.fromkeys(("list_type", "tuple_type"), "should be a list"),
    "string_type": "should be text",
}


def _first_fault(
    error: ValidationError, keys: Mapping[str, str], file: object, path: str
) -> InputError:
    return together(_faults(error, keys, file, path))


def _faults(
    error: ValidationError, keys: Mapping[str, str], file: object, path: str
) -> list[InputError]:
    """Return each error of a section's values, with its key in the file."""
    by_field = {field: key for key, field in keys.items()}
    found: dict[str, InputError] = {}
    for fault in error.errors():
        place = [str(part) for part in fault["loc"]]
        if place:
            place[0] = by_field.get(place[0], place[0])
        dotted = ".".join(([path] if path else []) + place)
        message = _WANTED.get(fault["type"]) or fault["msg"].removeprefix("Value error, ")
        message = f"{message[0].lower()}{message[1:]}, is {shown_value(fault['input'])}"
        problem = MISSING if fault["type"] == "missing" else message
        found.setdefault(dotted, InputError(file, dotted, problem))
    return list(found.values())
