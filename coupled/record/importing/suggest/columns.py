"""The columns of a log with the properties from which channels are guessed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError, shown
from coupled.record.importing.cells import lists_in
from coupled.record.importing.mapping import Stamped
from coupled.record.importing.reading import LATEST_ns, Log
from coupled.record.importing.suggest.dates import CLOCK, read_dates
from coupled.record.importing.suggest.dialect import is_number, units_in
from coupled.record.importing.suggest.names import Reading, in_brackets, read_name
from coupled.record.importing.suggest.sizes import USUAL, forward_steps, sentinels
from coupled.units import parse_unit, usual_unit

Floats = NDArray[np.float64]
MOST_HEADS = 10  # rows between the header and the numbers
FEW = 0.1  # share of a column's cells that may be empty or not numbers


@dataclass(frozen=True)
class Column:
    """A column: the content of its name and of its cells.

    `values` are its numbers, NaN if empty, shape (rows,); for a column of lists, their first
    elements, and `length` is the number of elements. Dates are in s from the first, in the pattern
    `date`, which is "?" if it is unknown. The rows `untimed`, above the first and below the last
    time, are left out. `doubt` is the reason why the log's own text does not determine the unit,
    `unscaled` a scaling in the log that is not applied.
    """

    log: str
    name: str
    reading: Reading
    kind: Literal["numbers", "lists", "dates", "text"]
    values: Floats
    length: int = 0
    date: str = ""
    untimed: tuple[str, ...] = ()
    doubt: str = ""
    unscaled: str = ""

    @property
    def moves(self) -> bool:
        """Whether it is not constant."""
        there = self.values[np.isfinite(self.values)]
        return there.size > 1 and bool(there.max() > there.min())

    @property
    def rises(self) -> bool:
        """Whether it is a column of numbers that rise by a usual step from row to row."""
        steps = np.diff(self.values)
        if self.kind != "numbers" or steps.size < 2 or not np.all(steps > 0.0):
            return False
        return bool(np.all(np.abs(steps / np.median(steps) - 1.0) < USUAL))

    @property
    def is_clock(self) -> bool:
        """Whether it can be the time of the rows: by its name, or by its cells."""
        if self.reading.channel != "time" or self.kind == "lists":
            return False
        steps = np.diff(self.values[np.isfinite(self.values)])
        back = steps.size - forward_steps(self.values).size - np.count_nonzero(steps == 0.0)
        orderly = self.reading.sure or bool(back <= FEW * np.count_nonzero(steps))
        return self.date == "?" or (self.moves and orderly)


def columns_of(log: Log) -> list[Column]:
    """Return a log's columns in their order, including those without numbers."""
    units = {**_units_above(log), **log.units}
    columns = [_column(log, name, units.get(name, "")) for name in log.columns]
    clock = next((c for c in columns if c.is_clock and c.moves), None)
    if clock is None:
        return columns
    rows, timed = clock.values.size, np.flatnonzero(np.isfinite(clock.values))
    first, last = int(timed[0]), int(timed[-1])
    if first + rows - 1 - last > FEW * rows:
        return columns
    untimed = (*_lines(log, 0, first), *_lines(log, last + 1, rows))
    return [
        replace(c, values=c.values[: last + 1], untimed=untimed) if c.values.size == rows else c
        for c in columns
    ]


def _lines(log: Log, first: int, end: int) -> list[str]:
    """Return the rows of a log from `first` to before `end`, as `drop_rows` names them."""
    if first == end:
        return []
    return ["-".join(dict.fromkeys(str(log.line(row)) for row in (first, end - 1)))]


def _units_above(log: Log) -> dict[str, str]:
    """Return the cells of the row with most units between header and numbers, by column."""
    cells = {name: each for name, each in log.columns.items() if each.dtype == pl.String}
    found: dict[str, str] = {}
    for row in range(min([MOST_HEADS, *(each.len() for each in cells.values())])):
        words = {name: str(each[row] or "") for name, each in cells.items()}
        if any(map(is_number, words.values())):
            break
        if units_in(words.values()) > units_in(found.values()):
            found = words
    return found


def _column(log: Log, name: str, unit: str) -> Column:
    own = next((plain for plain, each in log.doubled.items() if name in each), name)
    column = _read(log, name, read_name(own, unit, log.file.stem))
    # The bracket of a topic's field is an element.
    stated = unit or ("" if name in log.groups else in_brackets(own))
    doubt = _doubt(stated, read_name(own).unit)
    return replace(column, doubt=doubt, unscaled=log.unscaled.get(name, ""))


def _doubt(stated: str, named: str) -> str:
    """Return why the unit that a log states is unclear, beside the one in the column's name."""
    known, other = parse_unit(usual_unit(stated)), parse_unit(named)
    if known is None:
        unknown = bool(re.search("[^\\W\\d_]", stated)) and not named
        return f"the log states {shown(stated, 40)!r}, no known unit" if unknown else ""
    if other is None or other.dimension != known.dimension or other == known:
        return ""
    return f"the log states {shown(stated, 40)!r}, the name {named}"


def _read(log: Log, name: str, reading: Reading) -> Column:
    cells = log.columns[name]
    if cells.dtype == pl.String:
        there = cells.drop_nulls()  # in the middle: the first may be a further row of the header
        text = str(there[there.len() // 2]) if there.len() else ""
        if text[:1] in "[({" and text:
            return _lists(log, name, reading, cells)
        stamped = reading.channel == "time" and reading.sure and not is_number(text)
        if re.search(CLOCK, text) or (stamped and re.search(r"\d", text)):
            return _dates(log, name, reading)
    elif isinstance(cells.dtype, (pl.List, pl.Array)):
        return _lists(log, name, reading, cells)
    elif cells.dtype.is_temporal():
        with suppress(InputError):  # days
            times = log.times(Stamped(source=name), log.file, "clock")
            reading = replace(reading, channel="time")
            return Column(log.file.name, name, reading, "dates", times.from_first_s)
    values = _doubles(log.point(cells))
    kind: Literal["numbers", "text"] = "numbers"
    if values.size == 0 or np.mean(np.isnan(values)) > FEW or np.isnan(values).all():
        filled = cells.is_not_null().to_numpy() & np.isnan(values)
        kind = "text" if filled.any() or np.isnan(values).all() else "numbers"
    return Column(log.file.name, name, reading, kind, values)


def _doubles(cells: pl.Series) -> Floats:
    if not (cells.dtype.is_numeric() or cells.dtype == pl.String):
        return np.full(cells.len(), np.nan)
    values = cells.cast(pl.Float64, strict=False).to_numpy().astype(np.float64)
    return np.where(np.abs(values) <= LATEST_ns, values, np.nan)


def _lists(log: Log, name: str, reading: Reading, cells: pl.Series) -> Column:
    lists = lists_in(log.point(cells))
    if lists is None:  # of words, or of lists
        nothing = np.full(cells.len(), np.nan)
        return Column(log.file.name, name, reading, "text", nothing)
    lengths = lists.list.len().drop_nulls()
    values = _doubles(lists.list.get(0, null_on_oob=True))
    length = int(lengths.to_numpy().min()) if lengths.len() else 0
    return Column(log.file.name, name, reading, "lists", values, length)


def _dates(log: Log, name: str, reading: Reading) -> Column:
    found = read_dates(log, name)
    if found is not None:
        reading = replace(reading, channel="time")
        return Column(log.file.name, name, reading, "dates", found[1], date=found[0])
    nothing = np.full(log.columns[name].len(), np.nan)
    varies = reading.channel == "time" and log.columns[name].n_unique() > 1
    date = "?" if varies else ""
    return Column(log.file.name, name, reading, "text", nothing, date=date)


def missing_in(log: Log, columns: Sequence[Column]) -> set[str]:
    """Return the texts of the log's cells that stand for an empty cell in all their columns."""
    columns = [c for c in columns if c.log == log.file.name and not c.is_clock]
    cells = [
        (log.columns[c.name].head(c.values.size), pl.Series(c.values).is_in(sentinels(c.values)))
        for c in columns
        if log.columns[c.name].dtype == pl.String and c.kind == "numbers"
    ]
    found = {text for each, far in cells for text in each.filter(far).to_list()}
    return found.difference(*(each.filter(~far).to_list() for each, far in cells))
