"""Tables of numbers in CSV and Parquet; a fault names the file, the column and the row."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.files import read_bytes, write_whole
from coupled.schema import LARGEST

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]


def read_columns(path: Path, gaps: bool = False, torn: bool = False) -> dict[str, Floats]:
    """Return a table's columns by name, as doubles.

    An empty cell is NaN if `gaps` are allowed, and otherwise a fault. A `torn` CSV file may end in
    an incomplete line, since its writer was stopped; that line is left out.
    """
    import polars as pl

    held = read_bytes(path)
    if torn:
        held = held[: held.rfind(b"\n") + 1]
    content = io.BytesIO(held)
    try:
        if path.suffix.lower() == ".parquet":
            table = pl.read_parquet(content)
        else:
            _check_commas(path, held.partition(b"\n")[0])
            table = pl.read_csv(content, infer_schema=False)
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(path, "", f"is not a table: {first_line(error)}") from None
    doubled = [name for name in table.columns if "_duplicated_" in name]
    if doubled:
        raise InputError(path, doubled[0].partition("_duplicated_")[0], "duplicate column")
    return {name: numbers(path, name, table[name], gaps) for name in table.columns}


def _check_commas(path: Path, head: bytes) -> None:
    """Refuse a table whose first line has another separator and no comma."""
    for mark, name in ((b";", "semicolons"), (b"\t", "tabs")):
        if mark in head and b"," not in head:
            problem = f"is separated by {name}; separate by commas, or read a log by coupled import"
            raise InputError(path, "", problem)


def write_table(frame: pl.DataFrame, path: Path) -> None:
    """Write a table atomically, as Parquet by the file's extension, else as CSV."""
    import polars as pl

    def write(part: Path) -> None:
        with part.open("wb") as file:
            try:
                if path.suffix.lower() == ".parquet":
                    frame.write_parquet(file)
                else:
                    frame.write_csv(file)
            except pl.exceptions.PolarsError as error:  # also raised for a full disk
                raise OSError(first_line(error)) from None

    write_whole(path, write)


def first_line(error: BaseException) -> str:
    """Return the first line of an error's text, or its class if the text is empty."""
    return (str(error).splitlines() or [type(error).__name__])[0]


def check_numeric(path: Path, name: str, column: pl.Series) -> None:
    """Refuse a column with neither numbers nor text: lists, dates, bytes, categories."""
    import polars as pl

    kind = column.dtype
    if not (kind.is_numeric() or kind in (pl.String, pl.Boolean, pl.Null)):
        raise InputError(path, name, f"holds {kind}, no numbers")


def numbers(
    path: Path,
    name: str,
    column: pl.Series,
    gaps: bool,
    line: Callable[[int], int] = lambda row: row + 2,
    largest: float = LARGEST,
) -> Floats:
    """Return a column as doubles, shape (rows,).

    Text is parsed as numbers; an empty cell is NaN if `gaps` are allowed. `line` returns the line
    in the file of a row counted from 0. No number may exceed `largest`.
    """
    import polars as pl

    check_numeric(path, name, column)
    doubles = column.cast(pl.Float64, strict=False)
    if column.dtype == pl.String and doubles.null_count() > 0:
        column = column.str.strip_chars()
        column = column.set(column == "", None)
        doubles = column.cast(pl.Float64, strict=False)
    text = np.flatnonzero(doubles.is_null().to_numpy() & column.is_not_null().to_numpy())
    if text.size:
        row = int(text[0])
        problem = f"row {line(row)} holds {column[row]!r}, which is no number"
        raise InputError(path, name, problem)
    values = doubles.to_numpy().astype(np.float64)
    bad = np.isinf(values) | (np.abs(values) > largest)
    if not gaps:
        bad |= np.isnan(values)
    if bad.any():
        row = int(np.argmax(bad))
        what = "no finite number; a table has no gaps"
        if np.isfinite(values[row]):
            what = f"{values[row]:.3g}, larger than any real one"
        raise InputError(path, name, f"row {line(row)} holds {what}")
    return values
