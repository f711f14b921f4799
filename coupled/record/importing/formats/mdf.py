"""MDF of version 4, the format of measurement systems of cars and test benches, by asammdf.

A group of channels has its own clock, in s from the start of the measurement. asammdf converts raw
numbers to physical ones, except by formulas, since it would execute them.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
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

FORMULA = 3  # a conversion by a formula in text
TIME = 1  # type of a master channel in s; others are angles, lengths and rows
DEEPEST = 16  # nested conversions
RUN = "is converted by a formula, which is not run: save it as plain numbers"
MASTER = "time"  # name of a group's clock without a name


def read_mdf(path: Path, content: bytes, missing: Sequence[str] = ()) -> list[Found]:
    """Return the channels of numbers: `name`, or `group.name` if two groups have one.

    Values are physical. A channel with texts as values is refused, except for the texts `missing`,
    which mean an empty cell.
    """
    if content[:8] != b"MDF     " or content[8:9] != b"4":
        raise InputError(path, "", "is no MDF of version 4; its program, or asammdf, converts it")
    columns: list[Found] = []
    with MDF(io.BytesIO(content)) as mdf:
        for place, group in enumerate(mdf.groups):
            columns += _group(mdf, place, group, missing)
            if len(columns) > MOST_COLUMNS:
                break
    if not columns:
        raise InputError(path, "", "holds no channel of numbers")
    return by_their_groups(columns)


def _group(mdf: Any, place: int, group: Any, missing: Sequence[str]) -> list[Found]:
    label = str(getattr(group.channel_group, "acq_name", "") or "").strip() or str(place + 1)
    conversions = [channel.conversion for channel in group.channels]
    formulas = [_has_formula(conversion) for conversion in conversions]
    for channel, formula in zip(group.channels, formulas, strict=True):
        if formula:  # asammdf would execute it
            channel.conversion = None
    master = mdf.masters_db.get(place)
    stamps, refused, unit = MASTER, "", "s"
    if master is not None:
        stamps, refused = str(group.channels[master].name), RUN if formulas[master] else ""
        if group.channels[master].sync_type not in (0, TIME):
            unit = str(group.channels[master].unit or "").strip()[:40]
    time_s = np.asarray(mdf.get_master(place), dtype=np.float64)
    columns = [Found(stamps, time_s[:0] if refused else time_s, unit, label, stamps, refused)]
    for index, channel in enumerate(group.channels):
        if index == master:
            continue
        signal = mdf.get(group=place, index=index, raw=True, ignore_invalidation_bits=True)
        raw = as_numbers(signal.samples)
        if raw is None:
            continue
        name, unit = str(channel.name), str(signal.unit or "").strip()[:40]
        values, refused = raw, RUN if formulas[index] else ""
        if not refused and conversions[index] is not None:
            values, refused = _physical(raw, conversions[index], missing)
        if refused:
            values = raw[:0]
        elif signal.invalidation_bits is not None:
            values = np.where(np.asarray(signal.invalidation_bits), np.nan, values)
        columns.append(Found(name, values, unit, label, stamps, refused))
    return columns


def _has_formula(conversion: Any, depth: int = 0) -> bool:
    """Tell whether a conversion, or one that it refers to, is a formula."""
    if conversion is None or isinstance(conversion, bytes):
        return False
    if conversion.conversion_type == FORMULA or depth > DEEPEST:
        return True
    others = (conversion.referenced_blocks or {}).values()
    return any(_has_formula(other, depth + 1) for other in others)


def _physical(raw: Numbers, conversion: Any, missing: Sequence[str]) -> tuple[Numbers, str]:
    """Return asammdf's physical values, NaN for the texts `missing`, or why there are none."""
    physical = np.asarray(conversion.convert(raw, as_object=True))
    numbers = as_numbers(physical)
    if numbers is not None:
        return numbers, ""
    cells = [_cell(each, missing) for each in physical.ravel()]
    for row, cell in enumerate(cells):
        if isinstance(cell, str):
            word = json.dumps(cell[:40], ensure_ascii=False)
            problem = f"row {row + 1} is the text {word}, by its conversion; where that means no"
            return raw[:0], f"{problem} value, log.missing = [{word}] makes the cell empty"
    return np.array(cells, dtype=np.float64), ""


def _cell(value: Any, missing: Sequence[str]) -> float | str:
    """Return a physical value as a number, NaN for a text in `missing`, or the text."""
    if isinstance(value, (bytes, str)):
        text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        text = text.strip("\0 ")
        return np.nan if text in missing else text
    return float(value)
