"""ULog, the format of PX4's autopilots, by pyulog: `topic.field`, stamped in µs from the start."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

from pyulog import ULog

from coupled.errors import InputError
from coupled.record.importing.formats.columns import MOST_COLUMNS, Found, as_numbers

STAMPS = "timestamp"
HEAD_bytes = 16  # of the file, before its messages
KINDS = b"ABCDFILMOPQRS"  # types of messages of the format
BEGIN = b"ACL"  # those that end the definitions at the head of the file


def read_ulog(path: Path, content: bytes) -> list[Found]:
    """Return the fields of numbers; a topic's second instance is `topic[1]`, as in PX4."""
    if content[:7] != b"ULog\x01\x12\x35":
        raise InputError(path, "", "is no ULog file")
    columns: list[Found] = []
    place, begun = _damage(content)
    if place and not begun:  # without its definitions no data can be read, and pyulog may never end
        raise InputError(path, "", f"is damaged from byte {place} on, before its data")
    log = ULog(io.BytesIO(content))
    if place or log.file_corruption:  # pyulog skips or ends there without a warning
        where = f"from byte {place} on" if place else "in parts"
        warnings.warn(f"the file is damaged {where}, and rows are lost", stacklevel=1)
    for data in log.data_list:
        topic = f"{data.name}[{data.multi_id}]" if data.multi_id else str(data.name)
        switches = {each.field_name for each in data.field_data if each.type_str == "bool"}
        for field, values in data.data.items():
            numbers = as_numbers(values.astype(bool) if field in switches else values)
            if numbers is not None and len(columns) < MOST_COLUMNS:
                unit = "us" if field == STAMPS else ""
                stamps = f"{topic}.{STAMPS}"
                columns.append(Found(f"{topic}.{field}", numbers, unit, topic, stamps))
    if not columns:
        raise InputError(path, "", "holds no topic with numbers")
    return columns


def _damage(content: bytes) -> tuple[int, bool]:
    """Return the byte of the first invalid or incomplete message, and whether data begin before it.

    The byte is 0 in a whole file.
    """
    place, begun = HEAD_bytes, False
    while place < len(content):
        size = int.from_bytes(content[place : place + 2], "little")
        kind = content[place + 2 : place + 3]
        if not kind or kind not in KINDS or place + 3 + size > len(content):
            return place, begun
        begun |= kind in BEGIN
        place += 3 + size
    return 0, begun
