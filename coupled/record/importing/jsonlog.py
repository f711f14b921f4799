"""Logs in JSON: a list of rows, a table of columns, or one row a line (JSON Lines).

A row is an object; objects within it become columns named `outer.inner`. A cell may be a list, of
which a map takes an `element`. A row that lacks a column has an empty cell there. An object around
the one list of rows or the columns may hold other values, which are left out. Of cells of one name
the second is `name#2`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from coupled.errors import InputError, shown
from coupled.record.importing.formats.columns import named_apart

DEEPEST = 8  # objects within objects
WANTED = (
    'a list of rows as [{"t": 0, "F": 1.5}], a table as {"t": [0], "F": [1.5]}, or a row a line'
)


def read_json(
    path: Path, text: str
) -> tuple[dict[str, pl.Series], list[int], dict[str, tuple[str, ...]]]:
    """Return the columns of a JSON log by name, the line of each row, and the doubled names.

    Lines count from 1; rows of a list are numbered instead. Raises InputError, naming the line.
    """
    try:
        whole = json.loads(text, object_pairs_hook=_named_apart)
    except RecursionError:
        raise InputError(path, "", "nests too deeply to be a log") from None
    except ValueError:
        rows, lines = _by_lines(path, text)
    else:
        rows = _rows_of(path, whole)
        lines = list(range(1, len(rows) + 1))
    flat = [_flattened(path, number, row) for number, row in zip(lines, rows, strict=True)]
    names = list(dict.fromkeys(name for row in flat for name in row))
    if not names:
        raise InputError(path, "", f"holds no rows; give {WANTED}")
    columns = {name: _column(name, [row.get(name) for row in flat]) for name in names}
    return columns, lines, _doubled(names)


def _by_lines(path: Path, text: str) -> tuple[list[Any], list[int]]:
    """Return the rows of JSON Lines, and where they stand."""
    rows, lines = [], []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip():
            continue
        try:
            rows.append(json.loads(line, object_pairs_hook=_named_apart))
        except (ValueError, RecursionError):
            problem = f"line {number} is no JSON: {shown(line.strip(), 40)!r}; give {WANTED}"
            raise InputError(path, "", problem) from None
        lines.append(number)
    return rows, lines


def _rows_of(path: Path, whole: Any) -> list[Any]:
    """Return the rows of one JSON value: a list of them, a table of columns, or a single row."""
    if isinstance(whole, list):
        return whole
    if isinstance(whole, dict):
        columns = {name: cells for name, cells in whole.items() if isinstance(cells, list)}
        of_rows = [cells for cells in columns.values() if cells and isinstance(cells[0], dict)]
        if of_rows and len(columns) == 1:
            return of_rows[0]
        if not columns:
            return [whole]
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            each = ", ".join(f"{shown(name, 20)} {n}" for name, n in list(lengths.items())[:4])
            raise InputError(path, "", f"has columns of different lengths: {each}")
        rows = zip(*columns.values(), strict=True)
        return [dict(zip(columns, cells, strict=True)) for cells in rows]
    raise InputError(path, "", f"is no table; give {WANTED}")


def _flattened(
    path: Path, number: int, row: Any, before: str = "", deep: int = 0
) -> dict[str, Any]:
    """Return a row with the cells of objects within it as its own, `outer.inner`."""
    if not isinstance(row, Mapping) or deep > DEEPEST:
        raise InputError(path, "", f"row {number} is no object of columns; give {WANTED}")
    found: dict[str, Any] = {}
    for name, cell in row.items():
        if isinstance(cell, Mapping):
            inner = _flattened(path, number, cell, f"{before}{_unicode(name)}.", deep + 1)
        else:
            inner = {f"{before}{_unicode(name)}": cell}
        both = found.keys() & inner.keys()
        if both:
            problem = f"row {number} has two cells of this name: rename one"
            raise InputError(path, min(both), problem)
        found |= inner
    return found


def _doubled(names: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Return {duplicate name: its names by `_named_apart`}."""
    found: dict[str, list[str]] = {}
    for name in names:
        own, _, count = name.rpartition("#")
        if own and count.isdecimal() and own not in names:
            found.setdefault(own, []).append(name)
    return {own: tuple(each) for own, each in found.items() if len(each) > 1}


def _named_apart(cells: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object's cells by name; of cells of one name, as `name#1`, `name#2`."""
    names, _ = named_apart([name for name, _ in cells])
    return dict(zip(names, (cell for _, cell in cells), strict=True))


def _column(name: str, cells: Sequence[Any]) -> pl.Series:
    """Return cells as a column: of numbers, of lists of numbers, else of text."""
    given = [cell for cell in cells if cell is not None]
    switches = {isinstance(cell, bool) for cell in given}  # among numbers they are no numbers
    if len(switches) < 2 and all(isinstance(cell, (int, float)) for cell in given):
        if switches == {True}:
            return pl.Series(name, cells, dtype=pl.Boolean)
        whole = all(isinstance(cell, int) and abs(cell) < 2**63 for cell in given)
        if whole and given:
            return pl.Series(name, cells, dtype=pl.Int64, strict=False)
        numbers = [None if cell is None else _float(cell) for cell in cells]
        return pl.Series(name, numbers, dtype=pl.Float64)
    if all(isinstance(cell, list) and all(map(_is_number, cell)) for cell in given):
        return pl.Series(name, cells, dtype=pl.List(pl.Float64), strict=False)
    return pl.Series(name, [None if c is None else _text(c) for c in cells], dtype=pl.String)


def _is_number(cell: Any) -> bool:
    return isinstance(cell, (int, float)) and not isinstance(cell, bool)


def _float(cell: float) -> float:
    """Return a number; one with more digits than a float can have is infinite."""
    try:
        return float(cell)
    except OverflowError:
        return math.inf if cell > 0 else -math.inf


def _text(cell: Any) -> str:
    return _unicode(cell) if isinstance(cell, str) else json.dumps(cell)


def _unicode(text: str) -> str:
    r"""Return a text with "?" for each half of a character, as "\ud800" in JSON."""
    return text.encode("utf-8", "replace").decode()
