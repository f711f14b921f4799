"""TDMS, the format of LabVIEW, by npTDMS: a channel's waveform properties are its clock."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import TdmsFile

from coupled.errors import InputError
from coupled.record.importing.formats.columns import (
    MOST_COLUMNS,
    TEXT,
    Found,
    Numbers,
    as_numbers,
    by_their_groups,
    scaling_in,
)
from coupled.record.importing.formats.warned import kept_warnings

MASTER = "time"  # the column from a waveform's start and step, in s


def read_tdms(path: Path, content: bytes) -> list[Found]:
    """Return the channels of numbers: `name`, or `group.name` if two groups have one.

    For waveforms, `time` is the time of the rows, in s from the first start in the file, or from
    their own first row if no start is given.
    """
    file = TdmsFile.read(io.BytesIO(content))
    channels = [each for group in file.groups() for each in group.channels()]
    starts = [each.properties["wf_start_time"] for each in channels if _starts(each)]
    columns: list[Found] = []
    clocks: dict[tuple[Any, ...], str] = {}
    for channel in channels[:MOST_COLUMNS]:
        notes: list[str] = []
        own = ""
        with kept_warnings(notes):
            try:
                values, own = _numbers(channel)
            except (ValueError, LookupError, TypeError, ArithmeticError) as error:
                values = np.zeros(0)
                notes.append(f"its scale cannot be computed ({type(error).__name__})")
        if values is None:
            columns.append(Found(str(channel.name), np.zeros(0), refused=TEXT))
            continue
        label, stamps = str(channel.group_name), ""
        time_s = _waveform(channel, len(values), min(starts, default=None))
        if time_s is not None:
            clock = (label, len(values), time_s[0], time_s[-1])
            others = sum(key[0] == label for key in clocks)
            stamps = clocks.get(clock, f"{MASTER}{others + 1}" if others else MASTER)
            if clock not in clocks:
                clocks[clock] = stamps
                columns.append(Found(stamps, time_s, "s", _own(label, stamps), stamps))
        unit = own or str(channel.properties.get("unit_string", "")).strip()[:40]
        refused = f"npTDMS does not know what its numbers are: {notes[0]}" if notes else ""
        values = values[:0] if refused else values
        own_scaling = scaling_in(
            {k: v for k, v in channel.properties.items() if not k.startswith(("NI_", "wf_"))}
        )
        name, group = str(channel.name), _own(label, stamps)
        columns.append(Found(name, values, unit, group, stamps, refused, own_scaling))
    if all(column.refused == TEXT for column in columns):
        raise InputError(path, "", "holds no channel of numbers")
    return by_their_groups(columns)


def _own(label: str, stamps: str) -> str:
    """Return the name of the part of a group with one clock."""
    return f"{label}{stamps.removeprefix(MASTER)}"


def _starts(channel: Any) -> bool:
    return isinstance(channel.properties.get("wf_start_time"), np.datetime64)


def _waveform(channel: Any, rows: int, first: Any) -> np.ndarray[Any, Any] | None:
    step_s = channel.properties.get("wf_increment")
    if not isinstance(step_s, (int, float)) or step_s <= 0.0 or rows < 2:
        return None
    start_s = float(channel.properties.get("wf_start_offset", 0.0))
    if _starts(channel):
        since = channel.properties["wf_start_time"] - first
        start_s += float(since / np.timedelta64(1, "us")) * 1e-6
    return start_s + np.arange(rows) * float(step_s)


def _numbers(channel: Any) -> tuple[Numbers | None, str]:
    """Return a channel's numbers, and their unit where its type gives it."""
    values = np.asarray(channel[:])
    if values.dtype.kind == "M":  # of a clock: since 1970
        return values.astype("datetime64[ns]").astype(np.int64), "ns"
    return as_numbers(values), ""
