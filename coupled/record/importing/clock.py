"""A log's clock, and the record's even frames over its rows.

Rows with stamps that are even but for rounding (or 2 % of a frame) are used unchanged. Others are
interpolated by PCHIP, which passes through every sample without overshoot. A cubic spline would
oscillate at a step or a stop, and a straight line would cut corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from coupled.errors import InputError
from coupled.record.importing.account import ClockAccount
from coupled.record.importing.mapping import Clock, LogMap, Stamped
from coupled.record.importing.reading import Log, Stamps
from coupled.record.importing.rows import check_order, check_steps, row_count, stamps_in_file

Floats = NDArray[np.float64]
Rows = NDArray[np.int64]
EVEN_frames = 0.02  # largest deviation of even stamps
MARGIN_rows = 3.0  # kept beyond the cut, for the interpolation
MOST_UPSAMPLED = 10.0  # largest number of frames for each row
MOST_FRAMES = 20_000_000
LEAST_RATE_Hz, MOST_RATE_Hz = 1.0, 1e5  # of rows, where the map gives no frame rate


@dataclass(frozen=True)
class Grid:
    """The record's frames over a log's rows.

    `kept` are the rows used; `time_s` is the time of each, from frame 0 on, shape (rows kept,);
    `frame` is the frame of each if `even`, and otherwise unused.
    """

    kept: slice
    rows: int
    time_s: Floats
    frame: Rows
    even: bool
    frame_rate_Hz: float
    frames: int
    account: ClockAccount

    @property
    def frame_time_s(self) -> Floats:
        """The times of the record's frames, shape (frames,)."""
        times: Floats = np.arange(self.frames) / self.frame_rate_Hz
        return times

    def inside(self) -> NDArray[np.bool_]:
        """Return the mask of the kept rows within the record."""
        end_s = (self.frames - 1) / self.frame_rate_Hz
        slack = 0.5 / self.frame_rate_Hz
        chosen: NDArray[np.bool_] = (self.time_s > -slack) & (self.time_s < end_s + slack)
        return chosen


def lay_grid(
    log: Log,
    log_map: LogMap,
    map_file: Path,
    frame_rate_Hz: float | None,
    span_s: tuple[float, float] = (0.0, np.inf),
) -> Grid:
    """Return the frames of the record, at the rate of the map, of `frame_rate_Hz` or of the log.

    `span_s` is the time common to all logs, in s from the first row of this one.
    """
    clock = log_map.clock
    begin_s = max(clock.start, span_s[0])
    end_s = min(np.inf if clock.end is None else clock.end, span_s[1])
    used = [channel.source for channel in log_map.channels.values()]
    stamps_s = stamps_of(log, clock, used, map_file).from_first_s
    delay_s = max(channel.delay for channel in log_map.channels.values())
    kept = _cut(log, stamps_s, clock.source, (begin_s, end_s + delay_s))
    time_s = stamps_s[kept]
    check_steps(log, time_s, kept.start, clock, "clock", clock.longest_gap)
    first = int(np.searchsorted(time_s, begin_s - 1e-9))
    if first == time_s.size:
        raise InputError(map_file, "clock.start_s", f"the log ends at {time_s[-1]:.6g} s")
    start_s = float(time_s[first])
    rounding_s = _rounding(time_s)
    rate, median_s = (time_s.size - 1) / float(np.ptp(time_s)), float(np.median(np.diff(time_s)))
    if not clock.frame_rate:
        key = f"clock.{'unit' if clock.source else 'rate_Hz'}"
        check_rate(log, clock, median_s, key, "give clock.frame_rate_Hz")
    wished = clock.frame_rate or frame_rate_Hz
    even = _frames_at(time_s - start_s, wished, rounding_s) if wished else None
    if wished is None:
        wished, even = _own_rate(log, time_s - start_s, (rate, 1.0 / median_s), rounding_s)
    if wished * median_s > MOST_UPSAMPLED:
        problem = f"{wished:g} Hz from rows at {1.0 / median_s:.4g} Hz would be invented"
        raise InputError(map_file, "clock.frame_rate_Hz", problem)
    on_grid = time_s - start_s if even is None else even / wished
    last_s = min(on_grid[-1] - delay_s, end_s - start_s)
    frames = int(np.floor(last_s * wished + 1e-6)) + 1
    if not 2 <= frames <= MOST_FRAMES:
        raise InputError(log.file, "", f"would make a record of {max(frames, 0)} frames")
    steps_s = np.diff(time_s)
    bridged = np.maximum(np.rint(steps_s / median_s) - 1.0, 0.0)
    account = ClockAccount(
        log_rows=len(stamps_s),
        rows_used=int(time_s.size),
        log_rate_Hz=1.0 / median_s if bridged.any() else rate,
        least_step_s=float(steps_s.min()),
        greatest_step_s=float(steps_s.max()),
        stamp_rounding_s=rounding_s,
        start_s=start_s,
        frame_rate_Hz=wished,
        frames=frames,
        method="rows as they are" if even is not None else "pchip",
        missing_rows=int(bridged.sum()),
    )
    frame = np.zeros(time_s.size, dtype=np.int64) if even is None else even
    rows = len(stamps_s)
    return Grid(kept, rows, on_grid, frame, even is not None, wished, frames, account)


def stamps_of(
    log: Log, clock: Stamped, used: Sequence[str], map_file: Path, key: str = "clock"
) -> Stamps:
    """Return the time of every row, from the first one on, in s.

    A clock without a column has as many rows as the first of the columns `used`. Raises
    InputError if time goes back.
    """
    if isinstance(clock, Clock) and clock.rate is not None:
        rows = row_count(log, clock, used, map_file, key)
        return Stamps(Fraction(0), np.arange(rows) / clock.rate)
    stamps = stamps_in_file(log, clock, map_file, key)
    check_order(log, stamps.from_first_s, clock, key)
    return stamps


def beside(
    grid: Grid,
    stamps_s: Floats,
    delay_s: float,
    log: Log,
    clock: Stamped,
    key: str,
    longest_gap: int,
) -> Grid:
    """Return the same frames over the rows of another log, with stamps from frame 0 on, in s.

    Its channels are interpolated.
    """
    end_s = (grid.frames - 1) / grid.frame_rate_Hz
    kept = _cut(log, stamps_s, clock.source, (0.0, end_s + delay_s))
    check_steps(log, stamps_s[kept], kept.start, clock, key, longest_gap)
    nowhere = np.zeros(0, dtype=np.int64)
    rows = len(stamps_s)
    return replace(grid, kept=kept, rows=rows, time_s=stamps_s[kept], frame=nowhere, even=False)


def _cut(log: Log, stamps_s: Floats, source: str, span_s: tuple[float, float]) -> slice:
    if stamps_s.size < 2:
        raise InputError(log.file, "", "has fewer than two rows")
    margin_s = MARGIN_rows * float(np.median(np.abs(np.diff(stamps_s))))
    wanted = (stamps_s >= span_s[0] - margin_s) & (stamps_s <= span_s[1] + margin_s)
    rows = np.flatnonzero(wanted)
    if rows.size < 2:
        problem = (
            f"has no rows between the map's start_s and end_s; it ends at {stamps_s[-1]:.6g} s"
        )
        raise InputError(log.file, source, problem)
    return slice(int(rows[0]), int(rows[-1]) + 1)


def _rounding(time_s: Floats) -> float:
    """Return the decimal to which all stamps are rounded, in s, or 0."""
    for place_s in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        counts = time_s / place_s
        if np.all(np.abs(counts - np.rint(counts)) < 1e-4):
            return place_s
    return 0.0


def _frames_at(time_s: Floats, rate: float, rounding_s: float) -> Rows | None:
    """Return the frame of each row at a rate, or None if the stamps are not even."""
    frame = np.rint(time_s * rate)
    stray_s = float(np.ptp(time_s - frame / rate))
    if np.any(np.diff(frame) < 1.0) or stray_s > max(EVEN_frames / rate, 1.01 * rounding_s):
        return None
    return frame.astype(np.int64)


def check_rate(log: Log, clock: Stamped, step_s: float, key: str, remedy: str) -> None:
    """Refuse an implausible interval of rows, which shows a wrong unit of time in `key`."""
    rate = 1.0 / step_s
    if LEAST_RATE_Hz <= rate <= MOST_RATE_Hz:
        return
    problem = f"its rows come at {rate:.3g} Hz, outside {LEAST_RATE_Hz:g} to {MOST_RATE_Hz:g} Hz"
    raise InputError(log.file, clock.source, f"{problem}: is {key} right? If so, {remedy}")


def _own_rate(
    log: Log, time_s: Floats, guesses: tuple[float, ...], rounding_s: float
) -> tuple[float, Rows]:
    """Return the log's own rate, the roundest that its stamps allow, and the rows' frames."""
    for guess in guesses:
        for digits in (0, 1, 2, 3, 9):
            rate = round(guess, digits)
            frame = _frames_at(time_s, rate, rounding_s) if rate > 0.0 else None
            # One frame a row, except for missing rows; multiples of the rate would fit as well.
            if frame is not None and np.median(np.diff(frame)) == 1.0:
                return rate, frame
    steps_ms = 1e3 * np.diff(time_s)
    problem = f"its rows are unevenly spaced, {steps_ms.min():.4g} to {steps_ms.max():.4g} ms apart"
    near = f"; give the record's rate, as clock.frame_rate_Hz = {guesses[0]:.4g}"
    raise InputError(log.file, "", problem + near)


def on_frames(grid: Grid, values: Floats, delay_s: float, held: bool = False) -> Floats:
    """Return a channel on the record's frames, shape (frames,).

    `values` are those of the kept rows, NaN if a cell is empty. A `held` channel keeps its value
    until the next row instead of being interpolated.
    """
    valid = np.isfinite(values)
    asked_s = grid.frame_time_s + delay_s
    time_s, given = grid.time_s[valid], values[valid]
    if held:
        place = np.searchsorted(time_s, asked_s + 1e-9, side="right") - 1
        return np.asarray(given[np.maximum(place, 0)], dtype=np.float64)
    inside_s = np.clip(asked_s, time_s[0], time_s[-1])
    result = np.asarray(PchipInterpolator(time_s, given)(inside_s), dtype=np.float64)
    if grid.even and delay_s == 0.0:
        # Measured values are not changed in any bit.
        there = valid & (grid.frame >= 0) & (grid.frame < grid.frames)
        result[grid.frame[there]] = values[there]
    return result
