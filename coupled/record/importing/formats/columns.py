"""The result of a format's reader: columns, each with its unit and its group of rows."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError, shown

Numbers = NDArray[np.float64] | NDArray[np.int64] | NDArray[np.bool_]
MOST_COLUMNS = 20_000
TIMES = ("time", "t", "timestamp")  # names of a struct's stamps
MATRIX = "log.matrix"
TEXT = "holds text or objects, no numbers"
WORDS = ("name", "unit", "group", "stamps", "refused", "unscaled")
# Words in the names of attributes that scale numbers, and the value that changes nothing: of NWB
# (conversion, offset), HDF4 (scale, slope, intercept), netCDF (scale_factor) and LabVIEW (gain).
SCALING = {
    **dict.fromkeys(("scale", "gain", "conversion", "slope"), 1.0),
    **dict.fromkeys(("offset", "intercept"), 0.0),
}


@dataclass(frozen=True)
class Found:
    """A column of a log: `values`, shape (rows,), as in the file.

    `unit` is that of the file, or "". Columns of one `group` were sampled together, at the times in
    the column `stamps`; both are "" if the file does not give them. `refused` is the reason why an
    existing column is not read, `unscaled` a scaling that the file gives and that is not applied.
    """

    name: str
    values: Numbers
    unit: str = ""
    group: str = ""
    stamps: str = ""
    refused: str = ""
    unscaled: str = ""


def scaling_in(attributes: Mapping[str, Any], applied: Sequence[str] = ()) -> str:
    """Return the attributes of a column that scale it, as text, except for those `applied`."""
    found = []
    for name, value in attributes.items():
        words = re.findall("[A-Z]?[a-z]+|[A-Z]+", str(name))
        neutral = next((SCALING[w.lower()] for w in words if w.lower() in SCALING), None)
        number = np.ravel(np.asarray(value))
        if neutral is None or name in applied or number.dtype.kind not in "iuf":
            continue
        if number.size and not np.all(number == neutral):
            found.append(f"{name} = {', '.join(f'{each:.6g}' for each in number[:3])}")
    return shown(", ".join(found), 80)


def as_numbers(values: object) -> Numbers | None:
    """Return a column's values as integers, doubles or booleans, or None if they are others."""
    array = np.asarray(values)
    if array.ndim != 1 or array.dtype.kind not in "biuf":
        return None
    if array.dtype.kind == "b":
        return array
    if array.dtype.kind == "f":
        return array.astype(np.float64)
    if array.dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
        return array.astype(np.float64)
    return array.astype(np.int64)


def columns_of_matrix(
    path: Path, matrix: str, table: Any, names: list[str] | str, words: list[str]
) -> dict[str, Numbers]:
    """Return the columns of the variable `matrix`, shape (rows, columns), named by `words`.

    `names` is the map's own `log.names`. Raises InputError where they do not fit together.
    """
    if not isinstance(table, np.ndarray) or table.ndim != 2 or table.dtype.kind not in "biuf":
        raise InputError(path, matrix, "is no matrix of numbers; log.matrix names one")
    if not words:
        problem = "holds no names; log.names is a list of them or the variable that holds them"
        raise InputError(path, str(names), problem)
    if len(words) != table.shape[1]:
        problem = f"has {table.shape[1]} columns, and {len(words)} names"
        raise InputError(path, matrix, problem)
    if len(set(words)) < len(words):
        raise InputError(path, matrix, "two of its columns have one name")
    return {word: table[:, i].astype(np.float64) for i, word in enumerate(words)}


def unread(name: str, values: Any) -> Found | None:
    """Return the refused column of an array that is no vector of real numbers; None of one cell."""
    if np.size(values) < 2:
        return None
    why = TEXT
    if values.dtype.kind == "c":
        why = "holds complex numbers; save their parts"
    elif values.dtype.kind in "biuf":
        why = f"holds an array of {' x '.join(map(str, np.shape(values)))} numbers, no vector: of a"
        why += f" matrix, {MATRIX} and log.names in a map give the columns"
    return Found(name, np.zeros(0), refused=why)


def check_vectors(path: Path, columns: Sequence[Found]) -> None:
    """Refuse a file without a vector of numbers, and name its first matrix, which may hold them."""
    if not all(column.refused for column in columns):
        return
    matrix = next((c for c in columns if MATRIX in c.refused), None)
    if matrix is not None:
        raise InputError(path, matrix.name, matrix.refused)
    raise InputError(path, "", "holds no vector of numbers")


def by_their_groups(columns: Sequence[Found]) -> list[Found]:
    """Return columns named `group.name` if two groups have one of the name, else `name`."""
    times = Counter(column.name for column in columns)

    def full(group: str, name: str) -> str:
        return f"{group}.{name}" if times[name] > 1 and group else name

    return [
        replace(
            column,
            name=full(column.group, column.name),
            stamps=full(column.group, column.stamps) if column.stamps else "",
        )
        for column in columns
    ]


def by_their_times(columns: Sequence[Found]) -> list[Found]:
    """Return columns with the stamps of the struct or group that holds them, if stamps differ.

    Those are its vector `time`, or that of the structs around it, of as many rows.
    """
    times: dict[str, Found] = {}
    for column in columns:
        struct, _, field = column.name.rpartition(".")
        times_like = field.casefold() in TIMES and column.values.size
        if times_like and np.all(np.diff(column.values.astype(np.float64)) >= 0):
            times.setdefault(struct, column)
    owners = [_struct_with_time(column, times) for column in columns]
    used = [times[struct].values for struct in times if struct in owners]
    if all(np.array_equal(each, used[0]) for each in used):
        return list(columns)
    return [
        replace(column, group=struct or "variables", stamps=times[struct].name)
        if struct is not None
        else column
        for column, struct in zip(columns, owners, strict=True)
    ]


def _struct_with_time(column: Found, times: Mapping[str, Found]) -> str | None:
    """Return the innermost struct around a column with times of as many rows, "" for the file."""
    struct = column.name
    while struct:
        struct = struct.rpartition(".")[0]
        if struct in times and times[struct].values.size == column.values.size > 0:
            return struct
    return None


def named_apart(names: Sequence[str]) -> tuple[list[str], dict[str, tuple[str, ...]]]:
    """Return unique names, and {duplicate name: its unique names}."""
    times = Counter(names)
    doubled: dict[str, list[str]] = {name: [] for name, count in times.items() if count > 1}
    unique = []
    for name in names:
        own = name
        if name in doubled:
            own = f"{name}#{len(doubled[name]) + 1}"
            while own in times:  # another column has this name
                own = own.replace("#", "##", 1)
            doubled[name].append(own)
        unique.append(own)
    return unique, {name: tuple(own) for name, own in doubled.items()}


def pack(columns: Sequence[Found]) -> pl.DataFrame:
    """Return columns as a table for another process, one row for each column."""
    words = {key: [getattr(c, key) for c in columns] for key in WORDS}
    whole = [c.values.dtype.kind != "f" for c in columns]
    floats = [pl.Series([] if w else c.values) for c, w in zip(columns, whole, strict=True)]
    counts = [
        pl.Series(c.values.astype(np.int64) if w else [])
        for c, w in zip(columns, whole, strict=True)
    ]
    return pl.DataFrame(
        {
            **words,
            "is_whole": whole,
            "is_switch": [c.values.dtype.kind == "b" for c in columns],
            "doubles": pl.Series(floats, dtype=pl.List(pl.Float64)),
            "whole": pl.Series(counts, dtype=pl.List(pl.Int64)),
        }
    )


def unpack(table: pl.DataFrame) -> list[Found]:
    """Return the columns of `pack`."""
    words = table.select(WORDS).rows(named=True)
    columns = []
    for row, (is_whole, is_switch) in enumerate(table.select("is_whole", "is_switch").rows()):
        values = table["whole" if is_whole else "doubles"][row].to_numpy()
        columns.append(Found(values=values.astype(bool) if is_switch else values, **words[row]))
    return columns
