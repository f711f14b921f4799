"""Cells of a log that are not plain numbers: lists, dates, signs in a bit, wrapped counts."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, time, timedelta

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError, nearest, shown
from coupled.record.importing.mapping import Channel

Floats = NDArray[np.float64]
Line = Callable[[int], int]
ISO = "iso"
_DAY_us = 86_400_000_000
_HOUR_us = _DAY_us // 24
MOST_STEPS = 2.0  # step across a wrap, over the largest other step, with the right period
PERIOD = 0.002  # tolerance of a period for counts and noise, relative
FARTHEST = 0.25  # of a turn between two rows; from a half on, the direction is ambiguous
_FINER = re.compile(r"(?<=[.,:]\d{6})\d+")  # digits below 1 µs, which strptime does not read
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(frozen=True)
class Place:
    """A column's file and name, and the line of each row, counted from 0."""

    file: object
    name: str
    line: Line


def element(
    column: pl.Series, wanted: int | str, labels: Sequence[Sequence[str]] | None, where: Place
) -> pl.Series:
    """Return one element of each cell's list: `[0.1, 0.2]`, `0.1;0.2`.

    `wanted` is its index, counted from 1, or its name among `labels`, the names of the elements in
    each row. An empty cell stays empty, as does one without that name. Raises InputError if a list
    is too short or is none, and for an index whose name changes.
    """
    lists = lists_in(column)
    if lists is None:
        plain = column.dtype.is_numeric()
        what = "plain numbers" if plain else str(column.dtype)
        problem = f"holds {what}, no lists of numbers{': leave element out' if plain else ''}"
        raise InputError(where.file, where.name, problem)
    if isinstance(wanted, str):
        return _named_element(lists, wanted, labels, where)
    lengths = lists.list.len().fill_null(wanted)
    short = (lengths < wanted).to_numpy()
    if short.any():
        row = int(np.argmax(short))
        line, length = where.line(row), lengths[row]
        problem = f"row {line} holds {length} numbers; the map asks for element {wanted}"
        raise InputError(where.file, where.name, problem)
    at_place = [row[wanted - 1] for row in labels or [] if len(row) >= wanted]
    if len(set(at_place)) > 1:
        row = next(i for i, names in enumerate(labels or []) if names[wanted - 1] != at_place[0])
        first, other = shown(at_place[0], 40), shown((labels or [])[row][wanted - 1], 40)
        problem = f"element {wanted} is {first!r} in row {where.line(0)} and {other!r} in row"
        problem += f" {where.line(row)}: give its name, as element = {json.dumps(first)}"
        raise InputError(where.file, where.name, problem)
    return lists.list.get(wanted - 1, null_on_oob=True)


def truths(column: pl.Series) -> pl.Series:
    """Return a column of the words true and false as such values; any other column as it is."""
    if column.dtype != pl.String:
        return column
    words = column.str.strip_chars().str.to_lowercase()
    is_known = words.is_in(["true", "false"]).all() and len(words) > words.null_count()
    return words == "true" if is_known else column


def lists_in(column: pl.Series) -> pl.Series | None:
    """Return a column's cells as lists of text or numbers; None if they are not lists."""
    if column.dtype == pl.String:
        plain = column.str.strip_chars().str.strip_chars("[](){}").str.strip_chars()
        plain = plain.str.replace_all(r"\s*[;,]\s*|\s+", ",")
        return plain.replace("", None).str.split(",")
    if not isinstance(column.dtype, (pl.List, pl.Array)):
        return None
    inner = column.dtype.inner
    if not isinstance(inner, pl.DataType) or not (inner.is_numeric() or inner == pl.Boolean):
        return None
    return column.cast(pl.List(pl.Float64), strict=False)


def labels_of(
    name: str, column: pl.Series, columns: Mapping[str, pl.Series]
) -> list[list[str]] | None:
    """Return the names of the elements of a column's lists, row by row.

    They are from the first column with lists of words of the same length in each row. None if
    there is none.
    """
    lists = lists_in(column)
    if lists is None:
        return None
    lengths = lists.list.len().fill_null(0).to_list()
    for other, cells in columns.items():
        words = _words_in(cells) if other != name and cells.len() == column.len() else None
        if words is not None and [len(row) for row in words] == lengths:
            return words
    return None


def _words_in(cells: pl.Series) -> list[list[str]] | None:
    """Return lists of words, row by row; None if a column has none, or numbers."""
    if cells.dtype == pl.List(pl.String):
        found = [[str(word) for word in row or []] for row in cells.to_list()]
    elif cells.dtype == pl.String:
        first = cells.drop_nulls().head(1)
        if not first.len() or not str(first[0]).startswith(("[", "(", "{")):
            return None
        lists = lists_in(cells)
        assert lists is not None
        found = [[str(word).strip("'\"") for word in row or []] for row in lists.to_list()]
    else:
        return None
    first_row = next((row for row in found if row), [])
    return found if first_row and not any(_is_number(word) for word in first_row) else None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _named_element(
    lists: pl.Series, wanted: str, labels: Sequence[Sequence[str]] | None, where: Place
) -> pl.Series:
    if labels is None:
        problem = f"no column beside it names its elements: give element = 1 to {_most(lists)}"
        raise InputError(where.file, where.name, problem)
    known = dict.fromkeys(word for row in labels for word in row)
    if wanted not in known:
        problem = f"has no element {shown(wanted, 40)!r}; {nearest(wanted, known)}"
        raise InputError(where.file, where.name, problem)
    twice = next((i for i, row in enumerate(labels) if row.count(wanted) > 1), None)
    if twice is not None:
        problem = f"row {where.line(twice)} has two elements {shown(wanted, 40)!r}"
        raise InputError(where.file, where.name, problem)
    cells = [
        row[names.index(wanted)] if row is not None and wanted in names else None
        for row, names in zip(lists.to_list(), labels, strict=True)
    ]
    inner = lists.dtype.inner if isinstance(lists.dtype, pl.List) else pl.String
    return pl.Series(where.name, cells, dtype=inner)


def _most(lists: pl.Series) -> int:
    lengths = lists.list.len().drop_nulls().to_list()
    return max(lengths, default=1)


def signed(raw: Floats, channel: Channel, file: object, line: Line) -> Floats:
    """Return raw numbers with the sign by the map, NaN if empty.

    `sign_bit` n: a set bit n means minus, the bits below it are the magnitude. `wraps_at` N:
    integer counts from N/2 on are reduced by N (two's complement, read as unsigned). With `unwrap`,
    and for numbers that are not integers, the angle is unwrapped at the period N, from the turn in
    which its first number is nearest neutral: the map's offset may be that of an encoder.
    """
    if channel.sign_bit is None and channel.wraps_at is None:
        return raw
    there = np.isfinite(raw)
    fractions = there & (raw != np.floor(raw))
    if channel.wraps_at is not None:
        unwrap = bool(fractions.any()) if channel.unwrap is None else channel.unwrap
        if unwrap:
            return _unwrapped(raw, channel, file, line)
    half = 2.0**channel.sign_bit if channel.sign_bit is not None else (channel.wraps_at or 0) / 2.0
    wrong = fractions | (there & ((raw < 0.0) | (raw >= 2.0 * half)))
    if wrong.any():
        row = int(np.argmax(wrong))
        key = "sign_bit" if channel.sign_bit is not None else "wraps_at"
        problem = f"row {line(row)} is {raw[row]:g}, not 0 to {2 * half - 1:.0f} as the map's {key}"
        raise InputError(file, channel.source, f"{problem} says")
    minus = there & (raw >= half)
    if channel.sign_bit is not None:
        return np.where(minus, half - raw, raw)
    counts = np.where(minus, raw - 2.0 * half, raw)
    jumps = np.abs(np.diff(counts[there])) > half
    if channel.unwrap is None and jumps.any():
        row = int(np.flatnonzero(there)[int(np.argmax(jumps)) + 1])
        problem = f"row {line(row)} jumps by more than half of wraps_at: give unwrap = true for an"
        problem += " encoder that turns on, or unwrap = false for counts that do jump so"
        raise InputError(file, channel.source, problem)
    return counts


def _unwrapped(raw: Floats, channel: Channel, file: object, line: Line) -> Floats:
    """Return an angle unwrapped at its period, its first number within half of it of neutral."""
    period, name = channel.wraps_at or 0.0, channel.source
    there = np.isfinite(raw)
    values = raw[there]
    if not values.size:
        return raw
    span = float(np.ptp(values))
    if span > period:
        problem = f"spans {span:.6g}, more than wraps_at = {period:g}: it starts again later"
        raise InputError(file, name, problem)
    turned = np.unwrap(values, period=period)
    turned -= period * np.round((values[0] + channel.offset / channel.scale) / period)
    far = np.abs(np.diff(turned)) > FARTHEST * period
    if far.any():
        row = int(np.flatnonzero(there)[int(np.argmax(far)) + 1])
        problem = (
            f"row {line(row)} is {abs(np.diff(turned)[np.argmax(far)]) / period:.2g} of wraps_at"
        )
        problem += " from the row before: too far to tell which way it turned"
        raise InputError(file, name, problem)
    _check_period(np.flatnonzero(there), values, turned, channel, file, line)
    result = raw.copy()
    result[there] = turned
    return result


def _check_period(
    rows: NDArray[np.intp],
    values: Floats,
    turned: Floats,
    channel: Channel,
    file: object,
    line: Line,
) -> None:
    """Refuse a period if the step across it exceeds all other steps of the angle."""
    steps, period = np.abs(np.diff(turned)), channel.wraps_at or 0.0
    across = np.abs(np.diff(values) - np.diff(turned)) > 0.5 * period
    if not across.any() or across.all():
        return
    usual = float(steps[~across].max())
    least = float(steps[across].min())
    if least <= MOST_STEPS * usual + PERIOD * period:
        return
    row = int(rows[1:][across][0])
    problem = f"row {line(row)} crosses wraps_at = {period:g} by {least:.4g}, where other rows are"
    problem += f" {usual:.4g} apart at most: it starts again elsewhere, as at {np.ptp(values):.4g}?"
    raise InputError(file, channel.source, problem)


def moments(column: pl.Series, pattern: str, file: object, name: str, line: Line) -> pl.Series:
    """Return dates or times of day as integer microseconds, shape (rows,).

    `pattern` is `iso` (2026-03-01 12:00:00.5, 12:00:00.5, with or without T and time zone) or a
    pattern of strptime (`%d.%m.%Y %H:%M:%S.%f`). Times without a date continue past midnight,
    those without hours past the hour.
    """
    if column.dtype != pl.String:
        raise InputError(file, name, "holds numbers, no dates: leave clock.date out")
    counts: list[int] = []
    period = _period_us(pattern)
    past = 0
    for row, cell in enumerate(column.to_list()):
        try:
            moment = _moment(str(cell or "").strip(), pattern)
        except ValueError:
            problem = f"row {line(row)}: {str(cell)[:40]!r} is no date of the pattern {pattern!r}"
            raise InputError(file, name, problem) from None
        if isinstance(moment, time):
            count = (moment.hour * 60 + moment.minute) * 60 + moment.second
            count = count * 1_000_000 + moment.microsecond + past
            if counts and count < counts[-1] - period // 2:
                past += period
                count += period
        else:
            count = (moment - _EPOCH) // timedelta(microseconds=1)
        counts.append(count)
    return pl.Series(name, counts, dtype=pl.Int64)


def _period_us(pattern: str) -> int:
    """Return the time after which times of a pattern without a date repeat, in µs."""
    if pattern == ISO or "%H" in pattern or ("%I" in pattern and "%p" in pattern):
        return _DAY_us
    if "%I" in pattern:
        return _DAY_us // 2
    return _HOUR_us if "%M" in pattern else _HOUR_us // 60


def continued(clock_us: pl.Series) -> pl.Series:
    """Return times of day in integer microseconds, continued past midnight."""
    counts = clock_us.to_numpy().astype(np.float64)
    there = np.isfinite(counts)
    counts[there] = np.unwrap(counts[there], period=_DAY_us)
    return pl.Series(clock_us.name, counts, nan_to_null=True).cast(pl.Int64)


def _moment(text: str, pattern: str) -> datetime | time:
    if pattern != ISO:
        text = _FINER.sub("", text)
        if "%Y" not in pattern and "%y" not in pattern:
            return datetime.strptime(f"2000 {text}", f"%Y {pattern}").time()  # has a 29 February
        found = datetime.strptime(text, pattern)
    elif "-" not in text and ":" in text:
        return time.fromisoformat(text)
    else:
        found = datetime.fromisoformat(text)
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)
