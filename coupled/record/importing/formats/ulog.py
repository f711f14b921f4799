"""ULog, as PX4's autopilots write it, by pyulog: `topic.field`, stamped in µs since the start."""

from __future__ import annotations

import io
from pathlib import Path

from pyulog import ULog

from coupled.errors import InputError
from coupled.record.importing.formats.columns import MOST_COLUMNS, Found, as_numbers

STAMPS = "timestamp"


def read_ulog(path: Path, content: bytes) -> list[Found]:
    """Return the fields of numbers; a topic's second source is `topic[1]`, as PX4 numbers them."""
    if content[:7] != b"ULog\x01\x12\x35":
        raise InputError(path, "", "is no ULog file")
    columns: list[Found] = []
    for data in ULog(io.BytesIO(content)).data_list:
        topic = f"{data.name}[{data.multi_id}]" if data.multi_id else str(data.name)
        for field, values in data.data.items():
            numbers = as_numbers(values)
            if numbers is not None and len(columns) < MOST_COLUMNS:
                unit = "us" if field == STAMPS else ""
                stamps = f"{topic}.{STAMPS}"
                columns.append(Found(f"{topic}.{field}", numbers, unit, topic, stamps))
    if not columns:
        raise InputError(path, "", "holds no topic with numbers")
    return columns
