"""The columns of a log with the properties from which channels are guessed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.importing.cells import ISO, lists_in, moments
from coupled.record.importing.reading import LATEST_ns, Log
from coupled.record.importing.suggest.names import Reading, read_name

Floats = NDArray[np.float64]
FEW = 0.1  # share of a column's cells that may be empty or not numbers


@dataclass(frozen=True)
class Column:
    """A column: the content of its name and of its cells.

    `values` are its numbers, NaN if empty, shape (rows,); for a column of lists, their first
    elements, and `length` is the number of elements. Dates are in s from the first.
    """

    log: str
    name: str
    reading: Reading
    kind: Literal["numbers", "lists", "dates", "text"]
    values: Floats
    length: int = 0

    @property
    def moves(self) -> bool:
        """Whether it is not constant."""
        there = self.values[np.isfinite(self.values)]
        return there.size > 1 and bool(there.max() > there.min())


def columns_of(log: Log) -> list[Column]:
    """Return a log's columns in their order, including those without numbers."""
    return [_column(log, name) for name in log.columns]


def _column(log: Log, name: str) -> Column:
    cells = log.columns[name]
    unit = log.units.get(name, "")
    own = next((plain for plain, each in log.doubled.items() if name in each), name)
    reading = read_name(own, unit, log.file.stem)
    if cells.dtype == pl.String:
        first = cells.drop_nulls().head(1)
        text = str(first[0]) if first.len() else ""
        if text[:1] in "[({" and text:
            return _lists(log, name, reading, cells)
        if reading.channel == "time" and (":" in text or text.count("-") == 2):
            return _dates(log, name, reading, cells)
    elif isinstance(cells.dtype, (pl.List, pl.Array)):
        return _lists(log, name, reading, cells)
    elif cells.dtype.is_temporal():
        counts = cells.to_physical().cast(pl.Float64).to_numpy().astype(np.float64)
        return Column(log.file.name, name, reading, "dates", counts - counts[:1])
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


def _dates(log: Log, name: str, reading: Reading, cells: pl.Series) -> Column:
    try:
        counts = moments(cells, ISO, log.file, name, log.line)
    except InputError:
        return Column(log.file.name, name, reading, "text", np.full(cells.len(), np.nan))
    times = counts.cast(pl.Float64).to_numpy().astype(np.float64)
    return Column(log.file.name, name, reading, "dates", 1e-6 * (times - times[0]))
