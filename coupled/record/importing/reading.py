"""The columns of a log by name, in any format; a fault names the line.

Columns of a log need not be numbers: only those in the map are parsed.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError, nearest, shown
from coupled.files import read_bytes
from coupled.record.csvfile import check_numeric, first_line, numbers
from coupled.record.importing.cells import (
    Place,
    continued,
    element,
    labels_of,
    moments,
    signed,
    truths,
)
from coupled.record.importing.formats.columns import Found, named_apart
from coupled.record.importing.jsonlog import read_json
from coupled.record.importing.mapping import Channel, Layout, Stamped, known_unit
from coupled.record.importing.separate import read_parquet_separately, read_separately
from coupled.units import parse_unit

Floats = NDArray[np.float64]
Lines = NDArray[np.int64]
FORMATS = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".dat", ".asc", ".log"), "csv"),
    **{".parquet": "parquet", ".mat": "mat", ".h5": "hdf5", ".hdf5": "hdf5", ".hdf": "hdf5"},
    **{".mf4": "mdf", ".mdf": "mdf", ".tdms": "tdms", ".mcap": "mcap"},
    **dict.fromkeys((".ulg", ".ulog"), "ulog"),
    **dict.fromkeys((".json", ".jsonl", ".ndjson"), "json"),
}
_QUOTED_COMMA = re.compile(r'"\s*[-+]?\d*,\d')
_MINUS = r"(^|[eE])\u2212([\d.,])"  # the mathematical sign, as of Swedish and Norwegian settings
LATEST_ns = 1e19  # a clock in ns since 1970 is larger than any quantity of a record


@dataclass(frozen=True)
class Log:
    """A log's columns, as in the file. `lines` has the line of each row of a CSV.

    If a format samples groups of columns by clocks of their own, `stamps` names each one's column
    of times, and `groups` the group; `refused` is the reason why a column is not read, `unscaled` a
    scaling in the file that is not applied. `part` is the group of a log that is a part of another.
    Columns of one name are called `name#1`, `name#2`, …, and `doubled` has {name: those}. `decimal`
    is the mark in numbers that are text. `notes` are lines for the user: warnings of the reader's
    library, rows left out.
    """

    file: Path
    columns: Mapping[str, pl.Series]
    units: Mapping[str, str] = field(default_factory=dict)
    doubled: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    lines: Lines | None = None
    groups: Mapping[str, str] = field(default_factory=dict)
    stamps: Mapping[str, str] = field(default_factory=dict)
    refused: Mapping[str, str] = field(default_factory=dict)
    unscaled: Mapping[str, str] = field(default_factory=dict)
    part: str = ""
    decimal: Literal[".", ","] = "."
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The name of its file, with its part."""
        return f"{self.file.name}: {self.part}" if self.part else self.file.name

    def line(self, row: int) -> int:
        """Return the line in the file, counted from 1, of a row counted from 0."""
        return row + 1 if self.lines is None else int(self.lines[row])

    def find(self, name: str, map_file: Path, key: str) -> pl.Series:
        """Return the column of a name that the map has under `key`."""
        if name in self.doubled:
            raise InputError(self.file, name, _which(self.doubled[name]))
        if name in self.refused:
            raise InputError(self.file, name, self.refused[name])
        if name not in self.columns:
            hint = nearest(name, self.columns)
            if len(self.columns) == 1 and self.lines is not None:
                hint = f"its only column is {next(iter(self.columns))!r}: another log.delimiter?"
            raise InputError(map_file, key, f"{self.file.name} has no {name!r}; {hint}")
        return self.columns[name]

    def values(self, channel: Channel, map_file: Path, key: str) -> Floats:
        """Return a channel's column as doubles, signed, NaN if a cell is empty: (rows,)."""
        name = channel.source
        column = self._pointed(name, self.find(name, map_file, f"{key}.from"))
        if column.dtype == pl.Boolean and not channel.own:
            problem = (
                "holds true and false, no quantity; own = true reads it for a channel of yours"
            )
            raise InputError(self.file, name, problem)
        if channel.own:
            column = truths(column)
        if channel.element is not None:
            names = labels_of(name, column, self.columns)
            where = Place(self.file, name, self.line)
            column = element(column, channel.element, names, where)
        raw = numbers(self.file, name, column, gaps=True, line=self.line)
        return signed(raw, channel, self.file, self.line)

    def point(self, column: pl.Series) -> pl.Series:
        """Return a column with decimal points, if its numbers are text."""
        if self.decimal == "." or column.dtype != pl.String:
            return column
        return column.str.replace_all(",", ".", literal=True)

    def _pointed(self, name: str, column: pl.Series) -> pl.Series:
        """Return `point` of a column; refuse a point beside a decimal comma.

        It may be a decimal point or a thousands separator.
        """
        if self.decimal == "," and column.dtype == pl.String:
            points = column.str.contains(".", literal=True).fill_null(value=False).to_numpy()
            if points.any():
                row = int(np.argmax(points))
                problem = f"row {self.line(row)} holds {shown(str(column[row]), 40)!r}; log.decimal"
                problem += " is a comma: the point may be a decimal one, or set thousands apart"
                raise InputError(self.file, name, problem)
        return self.point(column)

    def times(self, clock: Stamped, map_file: Path, key: str) -> Stamps:
        """Return the time of each row.

        The first time is subtracted before the conversion to doubles, so that a clock in ns since
        1970 keeps all its digits. A counter is unwrapped.
        """
        name = clock.source
        column = self.find(name, map_file, f"{key}.from")
        if clock.date:
            column = moments(column, clock.date, self.file, name, self.line)
            return _counted(column, 1_000_000)
        if column.dtype == pl.Date:
            raise InputError(self.file, name, "holds days, without a time of day")
        if column.dtype == pl.Time:
            return _counted(continued(column.to_physical() // 1000), 1_000_000)
        if column.dtype.is_temporal():
            unit = getattr(column.dtype, "time_unit", None)
            return _counted(column.to_physical(), {"ms": 10**3, "us": 10**6}.get(str(unit), 10**9))
        column = self._pointed(name, column)
        check_numeric(self.file, name, column)
        values = numbers(self.file, name, column, True, self.line, LATEST_ns)
        scaling = self.unscaled.get(name)
        if scaling and not clock.unit:
            problem = (
                f"the file gives {scaling}, and whether its numbers still need that is not known:"
            )
            problem += f' give {key}.unit, the unit of its numbers as they are, as "ms"'
            raise InputError(self.file, name, problem)
        unit = clock.unit or self._time_unit(name, f"{key}.unit")
        factor = known_unit(unit, map_file, f"{key}.unit").factor
        exact = Fraction(factor).limit_denominator(10**12)  # 1/1000, not the double next to it
        if column.dtype.is_integer() and column.len() and column[0] is not None:
            whole = column.cast(pl.Int128)
            steps = (whole - whole.head(1)).cast(pl.Float64).to_numpy().astype(np.float64)
            steps = self._unwrapped(steps, clock, map_file, key)
            return Stamps(Fraction(int(column[0])) * exact, steps * factor)
        first = float(values[0]) if values.size and np.isfinite(values[0]) else 0.0
        steps = self._unwrapped(values - first, clock, map_file, key)
        return Stamps(Fraction(first) * exact, steps * factor)

    def _unwrapped(self, count: Floats, clock: Stamped, map_file: Path, key: str) -> Floats:
        """Return a counter, less its first number, unwrapped."""
        if clock.wraps_at is None or not np.isfinite(count).any():
            return count
        span = float(np.nanmax(count) - np.nanmin(count))
        if span > clock.wraps_at:
            problem = f"is {clock.wraps_at:g}, and {clock.source} spans {span:.6g}: larger"
            raise InputError(map_file, f"{key}.wraps_at", problem)
        there = np.isfinite(count)
        count[there] = np.unwrap(count[there], period=clock.wraps_at)
        return count

    def _time_unit(self, name: str, key: str) -> str:
        """Return the log's unit of time for a column; s if it gives none."""
        text = self.units.get(name, "").strip(" -[]()")
        stated, second = parse_unit(text), parse_unit("s")
        if stated is not None and second is not None and stated.dimension == second.dimension:
            return text
        if text:
            problem = f'the log states {shown(text, 40)!r}, no unit of time; give {key}, as "ms"'
            raise InputError(self.file, name, problem)
        return "s"


@dataclass(frozen=True)
class Stamps:
    """The times of a log's rows: the first one exactly, in s, and all relative to it, in s."""

    first_s: Fraction
    from_first_s: Floats


def _counted(count: pl.Series, per_s: int) -> Stamps:
    first = count.drop_nulls().head(1)
    origin = int(first[0]) if first.len() else 0
    steps = (count - origin).cast(pl.Float64).to_numpy().astype(np.float64)
    return Stamps(Fraction(origin, per_s), steps / per_s)


def format_of(path: Path) -> str:
    """Return the format of a log by its extension. Raises InputError if that is unknown."""
    kind = FORMATS.get(path.suffix.lower())
    if kind is None:
        problem = f"its format is not known; export it as one of {', '.join(FORMATS)}, or give"
        raise InputError(path, "", f"{problem} log.format in the map")
    return kind


def read_log(path: Path, layout: Layout) -> Log:
    """Return the columns of a log in the format of the map or of the file's extension."""
    kind = layout.format or format_of(path)
    content = read_bytes(path)
    if kind == "csv":
        return _read_csv(path, content, layout)
    if kind == "json":
        columns, lines, doubled = read_json(path, text_of(path, content, layout.encoding))
        numbered = np.array(lines, dtype=np.int64)
        return Log(path, columns, doubled=doubled, lines=numbered, decimal=layout.decimal)
    if kind == "parquet":
        columns, notes = read_parquet_separately(path, content)
        return Log(path, columns, notes=notes)
    found, notes = read_separately(path, content, kind, layout)
    return replace(_log(path, found), notes=notes)


def _log(path: Path, found: list[Found]) -> Log:
    names, doubled = named_apart([column.name for column in found])
    found = [replace(column, name=name) for column, name in zip(found, names, strict=True)]
    return Log(
        path,
        {c.name: pl.Series(c.name, c.values) for c in found if not c.refused},
        {c.name: c.unit for c in found if c.unit},
        doubled,
        groups={c.name: c.group for c in found if c.group},
        stamps={c.name: c.stamps for c in found if c.stamps},
        refused={c.name: c.refused for c in found if c.refused},
        unscaled={c.name: c.unscaled for c in found if c.unscaled},
    )


def _which(names: Sequence[str]) -> str:
    count = {2: "two", 3: "three"}.get(len(names), str(len(names)))
    those = " or ".join(f'"{shown(name)}"' for name in names[:4])
    return f"{count} columns have this name; give from = {those}, counted from the first column"


def _read_csv(path: Path, content: bytes, layout: Layout) -> Log:
    text = text_of(path, content, layout.encoding)
    kept, lines = _rows(text, layout)
    if not kept:
        raise InputError(path, "", "is empty")
    delimiter = layout.delimiter
    if path.suffix.lower() == ".tsv" and delimiter == ",":
        delimiter = "\t"
    if delimiter == layout.decimal == "," and not any(_QUOTED_COMMA.search(line) for line in kept):
        problem = "log.delimiter is the decimal comma as well, and no number is quoted"
        raise InputError(path, "", f'{problem}; give the delimiter, as ";"')
    if delimiter == " ":  # any white space
        kept = ["\t".join(line.split()) for line in kept]
        delimiter = "\t"
    table = _table(path, kept, lines, delimiter)
    heads = 1 if layout.header else 0
    under = heads + (1 if layout.units_row else 0)
    if table.height <= under:
        raise InputError(path, "", "has a header and no row of numbers")
    names = [str(i + 1) for i in range(table.width)]
    if layout.header:
        names = [(cell or "").strip() for cell in table.row(0)]
    names, doubled = named_apart(names)
    units = dict(zip(names, table.row(heads), strict=True)) if layout.units_row else {}
    columns = {}
    for name, column in zip(names, table.slice(under).get_columns(), strict=True):
        columns[name] = _cells(column, layout)
    found = np.array(lines[under:], dtype=np.int64)
    whole = found if len(found) == table.height - under else None  # a cell contained a line end
    return Log(
        path,
        columns,
        {name: unit for name, unit in units.items() if unit},
        doubled,
        whole,
        decimal=layout.decimal,
    )


def _table(path: Path, kept: list[str], lines: Sequence[int], delimiter: str) -> pl.DataFrame:
    """Return the cells of a CSV's lines as text.

    Lines may end in more delimiters than the first one. Raises InputError for further cells.
    """
    text = io.BytesIO("\n".join(kept).encode())
    try:
        return pl.read_csv(text, has_header=False, infer_schema=False, separator=delimiter)
    except (pl.exceptions.PolarsError, OSError, ValueError) as error:
        try:
            width, *others = (len(row) for row in csv.reader(kept, delimiter=delimiter))
        except csv.Error:
            row = next((k for k, line in enumerate(kept) if line.count('"') % 2), 0)
            raise InputError(path, "", f"row {lines[row]} has a quote that none closes") from None
        long = next((row for row, cells in enumerate(others, 1) if cells > width), None)
        if long is None or len(others) + 1 != len(kept):  # a cell contained a line end
            raise InputError(path, "", f"is not a table: {first_line(error)}") from None
    plain = [kept[0], *(line.rstrip().rstrip(delimiter) for line in kept[1:])]
    if all(len(row) <= width for row in csv.reader(plain, delimiter=delimiter)):
        return _table(path, plain, lines, delimiter)
    problem = f"row {lines[long]} has {others[long - 1]} cells, the first row {width}:"
    problem += " another log.delimiter, or log.skip_rows = lines before the header?"
    raise InputError(path, "", problem)


def text_of(path: Path, content: bytes, encoding: str) -> str:
    """Return a log's text. UTF-16 may lack its byte order mark if the first character is ASCII."""
    codec = "utf-8-sig" if encoding == "utf-8" else encoding
    if encoding == "utf-16" and b"\0" in content[:2]:
        codec = "utf-16-be" if content[:1] == b"\0" else "utf-16-le"
    try:
        text = content.decode(codec)
    except UnicodeError:
        known = "utf-8, latin-1 or utf-16"
        problem = f"is not text in {encoding.upper()}; set log.encoding to {known}"
        raise InputError(path, "", problem) from None
    if "\0" in text:
        problem = 'holds bytes that are no text: log.encoding = "utf-16", or another format?'
        raise InputError(path, "", problem)
    return text


def _rows(text: str, layout: Layout) -> tuple[list[str], list[int]]:
    """Return the lines that are rows, and their numbers in the file."""
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    kept, where = [], []
    for number, line in enumerate(lines[layout.skip_rows :], layout.skip_rows + 1):
        if not line.strip() or (layout.comment and line.lstrip().startswith(layout.comment)):
            continue
        kept.append(line)
        where.append(number)
    return kept, where


def _cells(column: pl.Series, layout: Layout) -> pl.Series:
    cells = column.str.strip_chars().str.replace_all(_MINUS, "$1-$2")
    if layout.missing:
        cells = cells.set(cells.is_in(layout.missing).fill_null(False), None)
    return cells
