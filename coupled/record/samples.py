"""The rows of a record in time: their rate, and whether all of them are there."""

from __future__ import annotations

import numpy as np

from coupled.errors import InputError
from coupled.record.channels import TIME
from coupled.record.record import Record

FINER = {1e3: "milliseconds", 1e6: "microseconds", 1e9: "nanoseconds"}  # how many in a second
UNEVEN = 0.01  # of a step in time, from which rows are missing
SLOWEST_Hz, FASTEST_Hz = 10.0, 1e4  # a hand moves at up to some 2 Hz: five rows a period at least


def sampling_rate_of(record: Record, file: object) -> float:
    """Return the rows in a second. Raises InputError if there are too few, or time stands still."""
    steps = np.diff(record.time_s)
    if not (steps.size and float(np.median(steps)) > 0.0):
        problem = f"does not rise over {len(record)} rows; a record has one row at each time"
        raise InputError(file, TIME, problem)
    return 1.0 / float(np.median(steps))


def frame_rate_of(record: Record, file: object) -> float:
    """Return a record's rate, Hz. Raises InputError if it is too low or high for a control's."""
    rate_Hz = sampling_rate_of(record, file)
    if not SLOWEST_Hz <= rate_Hz <= FASTEST_Hz:
        finer = [unit for n, unit in FINER.items() if SLOWEST_Hz <= rate_Hz * n <= FASTEST_Hz]
        needed = f"a control is recorded at {SLOWEST_Hz:g} to {FASTEST_Hz:g} Hz"
        asked = f"is it in {finer[0]}?" if finer else needed
        raise InputError(file, TIME, f"runs at {rate_Hz:.4g} Hz: {asked}")
    span_s = float(record.time_s[-1] - record.time_s[0])
    return float(f"{(len(record) - 1) / span_s:.6g}")


def check_samples(record: Record, file: object) -> None:
    """Raise InputError if a record's time has a gap, or one of its cells holds no number."""
    time = record.time_s
    gap = np.flatnonzero(np.abs(np.diff(time) * sampling_rate_of(record, file) - 1.0) > UNEVEN)
    if gap.size:
        raise InputError(file, TIME, f"has a gap or a jump after {time[gap[0]]:.3f} s")
    for name in record.channels:
        if not np.all(np.isfinite(record[name])):
            row = int(np.argmax(~np.isfinite(record[name])))
            raise InputError(file, name, f"row {row + 2} holds no number")
