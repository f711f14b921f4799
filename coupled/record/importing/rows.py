"""The rows of a log that are used, and their order, by the clock of the map.

`drop_rows` comes first, then `sort`, then `drop_duplicates`. Each change is noted; rows are never
dropped or moved without a key of the map.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.importing.mapping import Stamped, dropped_rows
from coupled.record.importing.reading import Log, Stamps

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
# Largest number of pieces, by time, into which other rows may split a run of rows of the log. Late
# rows split a run once or twice, two recordings of the same time at every row.
MOST_PIECES = 4
HOUR_s = 3600.0  # by which daylight saving sets local time
_WITHOUT_SUMMER_TIME = (
    "export the time in UTC or with its zone, or where rows are even give clock.rate_Hz and no from"
)
COARSE = 0.1  # share of repeated stamps from which the stamps are coarse, not rows duplicate


def use_rows(log: Log, clock: Stamped, used: Sequence[str], map_file: Path, key: str) -> Log:
    """Return the log with the rows that the map's clock selects, in that order.

    `used` are the log's columns in the map: rows with equal stamp and equal `used` are duplicates.
    Raises InputError for a missing row, and for rows of two times.
    """
    log = _drop(log, clock, row_count(log, clock, used, map_file, key), map_file, key)
    if clock.sort:
        log = _sort(log, clock, map_file, key)
    if clock.drop_duplicates:
        log = _drop_duplicates(log, clock, used, map_file, key)
    return log


def row_count(log: Log, clock: Stamped, used: Sequence[str], map_file: Path, key: str) -> int:
    """Return the number of rows of the clock's column, or else of the first column of `used`."""
    if clock.source:
        return log.find(clock.source, map_file, f"{key}.from").len()
    return next((log.columns[name].len() for name in used if name in log.columns), 0)


def stamps_in_file(log: Log, clock: Stamped, map_file: Path, key: str) -> Stamps:
    """Return the time of each row, in the rows' order."""
    stamps = log.times(clock, map_file, key)
    if stamps.from_first_s.size < 2:
        raise InputError(log.file, clock.source, "has fewer than two rows")
    lacking = np.isnan(stamps.from_first_s)
    if lacking.any():
        line = log.line(int(np.argmax(lacking)))
        problem = f"row {line} has no time; {key}.drop_rows = [{line}] leaves it out"
        raise InputError(log.file, clock.source, problem)
    return stamps


def check_order(log: Log, time_s: Floats, clock: Stamped, key: str) -> None:
    """Refuse times that go back in the log, with the keys of the map that allow them."""
    steps_s = np.diff(time_s)
    back = np.flatnonzero(steps_s < 0.0)
    if not back.size:
        return
    row = int(back[0])
    line = log.line(row + 1)
    if row == 0 and back.size == 1 and steps_s.size > 1:
        line = log.line(0)
        problem = f"row {line}: the first stamp is {-steps_s[0]:.6g} s later than the next one, as"
        problem += f" a stale one of an earlier run is: {key}.drop_rows = [{line}] leaves it out"
        raise InputError(log.file, clock.source, problem)
    if back.size == 1 and _summer_time(log, time_s, row, clock):
        problem = f"row {line}: time goes back by an hour, as local time does when daylight saving"
        raise InputError(log.file, clock.source, f"{problem} ends: {_WITHOUT_SUMMER_TIME}")
    back_s = f"time goes back from {time_s[row]:.6f} to {time_s[row + 1]:.6f} s"
    ahead = np.flatnonzero(time_s[row + 1 :] > time_s[row])
    last = row + int(ahead[0]) if ahead.size else time_s.size - 1
    dropped = f"[{line}] for a wrong stamp"
    if last > row + 1:
        until = "until it goes on" if ahead.size else "of the other run or clock"
        dropped = f'["{line}-{log.line(last)}"] for the rows {until}'
    # Without a later row of the first run, sorted rows would have a gap, or mix two runs.
    set_back = back.size == 1 and not ahead.size and last > row + 1
    remedies = [] if clock.sort or set_back else ["sort = true for rows out of order"]
    if not clock.date:
        remedies.append("wraps_at = N for a counter that starts again after N")
    remedies.append(f"drop_rows = {dropped}")
    problem = f"row {line}: {back_s} after the first row; {key} may have {', or '.join(remedies)}"
    raise InputError(log.file, clock.source, problem)


def check_steps(
    log: Log, time_s: Floats, first: int, clock: Stamped, key: str, longest_gap: int
) -> None:
    """Refuse repeated stamps, and gaps of more rows than `longest_gap`, from row `first` on."""
    steps_s = np.diff(time_s)
    if (steps_s == 0.0).any():
        row = int(np.argmax(steps_s == 0.0))
        line = log.line(first + row + 1)
        problem = f"row {line} repeats the time of the row before, {time_s[row]:.6f} s after the"
        problem += " first row; "
        if np.mean(steps_s == 0.0) > COARSE and not _all_repeat(log, time_s, first, clock):
            problem += "stamps are coarse: where rows are even, give clock.rate_Hz and no from"
        elif clock.drop_duplicates:
            problem += f"the two rows differ: {key}.drop_rows = [{line}] leaves this one out"
        else:
            problem += f"{key}.drop_duplicates = true leaves it out where all else is the same"
        raise InputError(log.file, clock.source, problem)
    median_s = float(np.median(steps_s))
    gaps = np.flatnonzero(steps_s > (longest_gap + 1.5) * median_s)
    if not gaps.size:
        return
    row = int(gaps[0])
    if first + row == 0 and gaps.size == 1 and steps_s.size > 1:
        line = log.line(0)
        problem = f"row {line}: the first stamp is {steps_s[0]:.6g} s before the next one, as a"
        problem += f" stale one is: {key}.drop_rows = [{line}] leaves it out"
        raise InputError(log.file, clock.source, problem)
    if gaps.size == 1 and _summer_time(log, time_s, row, clock):
        problem = f"row {log.line(first + row + 1)}: time goes on by an hour, as local time does"
        problem += f" when daylight saving begins: {_WITHOUT_SUMMER_TIME}"
        raise InputError(log.file, clock.source, problem)
    lost = round(steps_s[row] / median_s) - 1
    problem = f"row {log.line(first + row + 1)}: {lost} rows are missing after {time_s[row]:.6f} s;"
    problem += f" longest_gap_rows = {longest_gap} allows no more; cut by start_s or end_s"
    raise InputError(log.file, clock.source, problem)


def _summer_time(log: Log, time_s: Floats, row: int, clock: Stamped) -> bool:
    """Tell whether a clock of dates or times of day is set by an hour after a row."""
    if not (clock.date or log.columns[clock.source].dtype.is_temporal()):
        return False
    steps_s = np.diff(time_s)
    median_s = float(np.median(steps_s))
    return bool(abs(abs(steps_s[row] - median_s) - HOUR_s) < median_s)


def _all_repeat(log: Log, time_s: Floats, first: int, clock: Stamped) -> bool:
    """Tell whether each row with the stamp of the row before equals that row."""
    rows = log.columns[clock.source].len()
    cells = [each for each in log.columns.values() if each.len() == rows]
    again = np.flatnonzero(np.diff(time_s) == 0.0) + first + 1
    return all(bool(_repeats(each)[again].all()) for each in cells)


def _drop(log: Log, clock: Stamped, rows: int, map_file: Path, key: str) -> Log:
    ranges = dropped_rows(clock, map_file, key)
    if not ranges:
        return log
    lines = _lines(log, rows)
    dropped = np.zeros(rows, dtype=bool)
    for first, last in ranges:
        hit = (lines >= first) & (lines <= last)
        if not hit.any():
            span = f"its rows are {lines[0]} to {lines[-1]}" if rows else "it has no rows"
            problem = f"{first} is no row of {log.file.name}; {span}"
            raise InputError(map_file, f"{key}.drop_rows", problem)
        dropped |= hit
    note = f"{int(dropped.sum())} of {rows} rows dropped, by {key}.drop_rows"
    return _take(log, np.flatnonzero(~dropped), rows, note)


def _sort(log: Log, clock: Stamped, map_file: Path, key: str) -> Log:
    time_s = stamps_in_file(log, clock, map_file, key).from_first_s
    order = np.argsort(time_s, kind="stable")
    steps_s = np.diff(time_s)
    if not (steps_s < 0.0).any():
        return log
    run = np.concatenate(([0], np.cumsum(steps_s < 0.0)))  # rows between two backward steps
    by_time = run[order]
    pieces = np.bincount(by_time[np.concatenate(([True], np.diff(by_time) != 0))])
    mixed = np.flatnonzero(pieces > MOST_PIECES)
    if mixed.size:
        first, last = (int(row) for row in np.flatnonzero(run == mixed[-1])[[0, -1]])
        problem = (
            f"row {log.line(first)}: the rows from here on lie between others, one by one: two"
        )
        problem += " recordings, which sort would mix; leave one out, as by"
        problem += f' {key}.drop_rows = ["{log.line(first)}-{log.line(last)}"]'
        raise InputError(log.file, clock.source, problem)
    moved = int(np.count_nonzero(order != np.arange(order.size)))
    return _take(log, order, time_s.size, f"{moved} of {time_s.size} rows moved, by {key}.sort")


def _drop_duplicates(
    log: Log, clock: Stamped, used: Sequence[str], map_file: Path, key: str
) -> Log:
    time_s = stamps_in_file(log, clock, map_file, key).from_first_s
    same = np.concatenate(([False], np.diff(time_s) == 0.0))
    for name in used:
        column = log.columns.get(name)
        if column is not None and column.len() == same.size:
            same &= _repeats(column)
    if not same.any():
        return log
    note = f"{int(same.sum())} duplicate rows dropped, by {key}.drop_duplicates"
    return _take(log, np.flatnonzero(~same), same.size, note)


def _lines(log: Log, rows: int) -> Rows:
    """Return the line of each row in the file, counted from 1."""
    return log.lines if log.lines is not None else np.arange(1, rows + 1, dtype=np.int64)


def _repeats(column: pl.Series) -> NDArray[np.bool_]:
    """Return which cells equal the one before; empty cells are equal."""
    if column.dtype.is_nested():
        cells = column.to_list()
        repeats = [False, *(a == b for a, b in pairwise(cells))]
        return np.array(repeats[: len(cells)], dtype=bool)
    same = column.eq_missing(column.shift(1)).to_numpy()
    same[:1] = False
    return np.asarray(same, dtype=bool)


def _take(log: Log, order: Rows, rows: int, note: str) -> Log:
    """Return the log with these rows in all columns of the clock's length."""
    if not order.size:
        raise InputError(log.file, "", "has no rows left: clock.drop_rows names them all")
    columns = {
        name: column.gather(order) if column.len() == rows else column
        for name, column in log.columns.items()
    }
    lines = _lines(log, rows)[order]
    return replace(log, columns=columns, lines=lines, notes=(*log.notes, note))
