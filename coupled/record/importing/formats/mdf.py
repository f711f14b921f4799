"""MDF of version 4, as measurement systems of cars and test benches write it, by asammdf.

A group of channels has a clock of its own, in s from the start of the measurement. Raw numbers
are converted here and not by asammdf: it would compute a formula that the file holds.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from asammdf import MDF

from coupled.errors import InputError
from coupled.record.importing.formats.columns import (
    MOST_COLUMNS,
    Found,
    Numbers,
    as_numbers,
    by_their_groups,
)

NONE, LINEAR, RATIONAL, FORMULA, BETWEEN, STEPS = range(6)  # ways to convert; the rest are texts
MASTER = "time"  # where the clock of a group has no name


def read_mdf(path: Path, content: bytes) -> list[Found]:
    """Return the channels of numbers: `name`, or `group.name` where two groups have one such."""
    if content[:8] != b"MDF     " or content[8:9] != b"4":
        raise InputError(path, "", "is no MDF of version 4; its program, or asammdf, converts it")
    columns: list[Found] = []
    with MDF(io.BytesIO(content)) as mdf:
        for place, group in enumerate(mdf.groups):
            columns += _group(mdf, place, group)
            if len(columns) > MOST_COLUMNS:
                break
    if not columns:
        raise InputError(path, "", "holds no channel of numbers")
    return by_their_groups(columns)


def _group(mdf: Any, place: int, group: Any) -> list[Found]:
    label = str(getattr(group.channel_group, "acq_name", "") or "").strip() or str(place + 1)
    conversions = [channel.conversion for channel in group.channels]
    for channel, conversion in zip(group.channels, conversions, strict=True):
        if conversion is not None and conversion.conversion_type == FORMULA:
            channel.conversion = None
    time_s = np.asarray(mdf.get_master(place), dtype=np.float64)
    master = mdf.masters_db.get(place)
    stamps = str(group.channels[master].name) if master is not None else MASTER
    columns = [Found(stamps, time_s, "s", label, stamps)]
    for index, channel in enumerate(group.channels):
        if index == master:
            continue
        signal = mdf.get(group=place, index=index, raw=True, ignore_invalidation_bits=False)
        raw = as_numbers(signal.samples)
        if raw is None:
            continue
        name, unit = str(channel.name), str(signal.unit or "").strip()[:40]
        if conversions[index] is not None and conversions[index].conversion_type == FORMULA:
            problem = "is converted by a formula, which is not run: save it as plain numbers"
            columns.append(Found(name, raw[:0], unit, label, stamps, problem))
            continue
        values = _converted(raw, conversions[index])
        if signal.invalidation_bits is not None:
            values = np.where(np.asarray(signal.invalidation_bits), np.nan, values)
        columns.append(Found(name, values, unit, label, stamps))
    return columns


def _converted(raw: Numbers, conversion: Any) -> Numbers:
    """Return physical values; those whose conversion makes texts stay raw."""
    kind = NONE if conversion is None else conversion.conversion_type
    if kind == LINEAR:
        return np.asarray(raw * float(conversion.a) + float(conversion.b), dtype=np.float64)
    if kind == RATIONAL:
        p1, p2, p3, p4, p5, p6 = (float(getattr(conversion, f"P{i}")) for i in range(1, 7))
        ratio = np.polyval([p1, p2, p3], raw) / np.polyval([p4, p5, p6], raw)
        return np.asarray(ratio, dtype=np.float64)
    if kind in (BETWEEN, STEPS):
        count = conversion.val_param_nr // 2
        places = np.array([conversion[f"raw_{i}"] for i in range(count)])
        values = np.array([conversion[f"phys_{i}"] for i in range(count)])
        if kind == BETWEEN:
            return np.asarray(np.interp(raw, places, values), dtype=np.float64)
        # The nearest, and between two of equal distance the lower.
        above = np.clip(np.searchsorted(places, raw), 1, max(count - 1, 1))
        nearer = raw - places[above - 1] <= places[above] - raw
        return np.asarray(values[np.where(nearer, above - 1, above)])
    return raw
