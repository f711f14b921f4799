"""The pattern of a column's dates or times of day, from its cells."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.importing.cells import ISO
from coupled.record.importing.mapping import Stamped
from coupled.record.importing.reading import Log

Floats = NDArray[np.float64]
CLOCK = r"\d:\d\d"  # is in every cell with a time of day
_STAMP = re.compile(
    r"((?P<first>\d+)(?P<mark>[-./ ])(?P<middle>\d\d?|[A-Za-z]{3})(?P=mark)(?P<last>\d+)"
    r"(?P<gap>,? +|T|,))?"
    r"(?P<hour>\d\d?:)?\d\d?:\d\d(?P<fraction>[.,:]\d{1,9})?(?P<half> ?[AaPp][Mm])?"
)


def read_dates(log: Log, name: str) -> tuple[str, Floats] | None:
    """Return the pattern of a column of text, and its times in s from the first one.

    A cell without a time of day is NaN. If the order of day and month is ambiguous, the pattern
    with the shorter log is returned. None if no pattern fits all times of day.
    """
    timed = log.columns[name].str.contains(CLOCK).fill_null(value=False)
    cells = log.columns[name].filter(timed)
    found = []
    for pattern in _patterns(str(cells[0])) if cells.len() else ():
        with suppress(InputError):
            clock = Stamped(source=name, date=pattern)
            times = replace(log, columns={name: cells}, lines=None).times(clock, log.file, "clock")
            found.append((pattern, times.from_first_s))
    if not found:
        return None
    pattern, times_s = min(found, key=lambda each: float(np.ptp(each[1])))
    values = np.full(timed.len(), np.nan)
    values[timed.to_numpy()] = times_s
    return pattern, values


def _patterns(cell: str) -> Iterator[str]:
    """Yield the patterns that may read a cell."""
    yield ISO
    found = _STAMP.fullmatch(cell)
    if found is None:
        return
    part = {key: value or "" for key, value in found.groupdict().items()}
    hour = "%I:" if part["half"] else "%H:"
    clock = f"{hour if part['hour'] or part['half'] else ''}%M:%S"
    if part["fraction"]:
        clock += f"{part['fraction'][0]}%f"
    clock += part["half"][:-2] + "%p" if part["half"] else ""
    month = "%b" if part["middle"].isalpha() else "%m"
    year = "%Y" if 4 in (len(part["first"]), len(part["last"])) else "%y"
    days = [("%d", month, year), (month, "%d", year)]
    if len(part["first"]) == 4:
        days = [(year, month, "%d")]
    elif part["mark"] == "/":  # of the United States
        days.reverse()
    for day in days if part["mark"] else [()]:
        yield part["mark"].join(day) + part["gap"] + clock
