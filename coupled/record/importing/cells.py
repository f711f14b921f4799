"""Cells of a log that are no plain numbers: a list in a cell, a date, a sign kept in a bit."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, time, timedelta

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.importing.mapping import Channel

Floats = NDArray[np.float64]
Line = Callable[[int], int]
ISO = "iso"
_DAY_us = 86_400_000_000
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def element(column: pl.Series, number: int, file: object, name: str, line: Line) -> pl.Series:
    """Return one element, counted from 1, of each cell's list: `[0.1, 0.2]`, `0.1;0.2`.

    An empty cell stays empty. Raises InputError where a list is too short, or is none.
    """
    if column.dtype == pl.String:
        plain = column.str.strip_chars().str.strip_chars("[](){}").str.strip_chars()
        plain = plain.str.replace_all(r"\s*[;,]\s*|\s+", ",")
        lists = plain.replace("", None).str.split(",")
    elif isinstance(column.dtype, (pl.List, pl.Array)):
        lists = column.cast(pl.List(pl.Float64), strict=False)
    else:
        raise InputError(file, name, "holds plain numbers, no lists: leave element out")
    lengths = lists.list.len().fill_null(number)
    short = (lengths < number).to_numpy()
    if short.any():
        row = int(np.argmax(short))
        problem = f"row {line(row)} holds {lengths[row]} numbers; the map asks for element {number}"
        raise InputError(file, name, problem)
    return lists.list.get(number - 1, null_on_oob=True)


def signed(raw: Floats, channel: Channel, file: object, line: Line) -> Floats:
    """Return raw integers with the sign that the map says they hold, NaN where empty.

    `sign_bit` n: a set bit n means minus, the bits below it are the magnitude. `wraps_at` N:
    numbers from N/2 on stand for themselves less N (two's complement, read as unsigned).
    """
    if channel.sign_bit is None and channel.wraps_at is None:
        return raw
    half = 2.0**channel.sign_bit if channel.sign_bit is not None else (channel.wraps_at or 0) / 2.0
    there = np.isfinite(raw)
    wrong = there & ((raw < 0.0) | (raw >= 2.0 * half) | (raw != np.floor(raw)))
    if wrong.any():
        row = int(np.argmax(wrong))
        key = "sign_bit" if channel.sign_bit is not None else "wraps_at"
        problem = f"row {line(row)} is {raw[row]:g}, not 0 to {2 * half - 1:.0f} as the map's {key}"
        raise InputError(file, channel.source, f"{problem} says")
    minus = there & (raw >= half)
    if channel.sign_bit is not None:
        return np.where(minus, half - raw, raw)
    return np.where(minus, raw - 2.0 * half, raw)


def moments(column: pl.Series, pattern: str, file: object, name: str, line: Line) -> pl.Series:
    """Return dates or times of day as whole microseconds, shape (rows,).

    `pattern` is `iso` (2026-03-01 12:00:00.5, 12:00:00.5, with or without T and time zone) or a
    pattern of strptime's (`%d.%m.%Y %H:%M:%S.%f`). Times of day run on past midnight.
    """
    if column.dtype != pl.String:
        raise InputError(file, name, "holds numbers, no dates: leave clock.date out")
    counts: list[int] = []
    days = 0
    for row, cell in enumerate(column.to_list()):
        try:
            moment = _moment(str(cell or "").strip(), pattern)
        except ValueError:
            problem = f"row {line(row)}: {str(cell)[:40]!r} is no date of the pattern {pattern!r}"
            raise InputError(file, name, problem) from None
        if isinstance(moment, time):
            count = (moment.hour * 60 + moment.minute) * 60 + moment.second
            count = count * 1_000_000 + moment.microsecond + days * _DAY_us
            if counts and count < counts[-1] - _DAY_us // 2:
                days += 1
                count += _DAY_us
        else:
            count = (moment - _EPOCH) // timedelta(microseconds=1)
        counts.append(count)
    return pl.Series(name, counts, dtype=pl.Int64)


def _moment(text: str, pattern: str) -> datetime | time:
    if pattern != ISO:
        found = datetime.strptime(text, pattern)
        if "%Y" not in pattern and "%y" not in pattern:
            return found.time()
    elif "-" not in text and ":" in text:
        return time.fromisoformat(text)
    else:
        found = datetime.fromisoformat(text)
    return found if found.tzinfo is not None else found.replace(tzinfo=UTC)
