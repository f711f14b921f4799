"""MCAP, as robots and test benches log, by mcap: messages in JSON, ROS 2's CDR or protobuf.

The columns are `topic.field`. ROS 1's messages are left out: their decoder makes a program of what
the file says and runs it.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

from coupled.errors import InputError
from coupled.record.importing.formats.columns import MOST_COLUMNS, Found, as_numbers

DEEPEST = 6  # messages within messages
LONGEST = 64  # elements of an array that become columns
STAMPS = "log_time"
TIMES = ({"sec", "nanosec"}, {"seconds", "nanos"}, {"sec", "nsec"})


class _Json(DecoderFactory):
    """Decodes messages in JSON, which need no schema."""

    def decoder_for(
        self, message_encoding: str, schema: Schema | None
    ) -> Callable[[bytes], Any] | None:
        del schema
        return json.loads if message_encoding == "json" else None


def read_mcap(path: Path, content: bytes) -> list[Found]:
    """Return the fields of numbers, and each topic's `log_time` and `publish_time`, in ns.

    An array's elements are `field[0]`, `field[1]`, …; a field that holds s and ns is one column.
    """
    reader = make_reader(io.BytesIO(content))
    summary = reader.get_summary()
    encodings = {c.message_encoding for c in summary.channels.values()} if summary else set()
    factories = [_Json(), Ros2(), Protobuf()]
    topics: dict[str, list[dict[str, float]]] = {}
    undecoded: set[str] = set()
    for schema, channel, message in reader.iter_messages():
        decode = next(
            filter(None, (f.decoder_for(channel.message_encoding, schema) for f in factories)), None
        )
        if decode is None:
            undecoded.add(channel.message_encoding)
            continue
        row = dict(_numbers(decode(message.data), "", 0))
        row |= {STAMPS: message.log_time, "publish_time": message.publish_time}
        topics.setdefault(channel.topic, []).append(row)
    columns = [each for topic, rows in topics.items() for each in _columns(topic, rows)]
    if not columns:
        kinds = ", ".join(sorted(undecoded | encodings)) or "none"
        problem = f"holds no message with numbers in json, cdr (ROS 2) or protobuf, but: {kinds}"
        raise InputError(path, "", problem)
    return columns[:MOST_COLUMNS]


def _columns(topic: str, rows: list[dict[str, float]]) -> list[Found]:
    names = list(dict.fromkeys(name for row in rows for name in row))[:MOST_COLUMNS]
    stamps = f"{topic}.{STAMPS}"
    columns = []
    for name in names:
        values = as_numbers([row.get(name, np.nan) for row in rows])
        unit = "ns" if name in (STAMPS, "publish_time") or name.endswith(".stamp") else ""
        if values is not None:
            columns.append(Found(f"{topic}.{name}", values, unit, topic, stamps))
    return columns


def _numbers(value: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a decoded message, by their names in it."""
    if isinstance(value, (bool, int, float)):
        yield name, value
        return
    if depth > DEEPEST or isinstance(value, (str, bytes)):
        return
    if (fields := _fields(value)) is not None:
        if set(fields) in TIMES:
            s, ns = (int(fields[key]) for key in sorted(fields, key=len))
            yield name, 1_000_000_000 * s + ns
            return
        for key, inner in fields.items():
            yield from _numbers(inner, f"{name}.{key}" if name else key, depth + 1)
    elif hasattr(value, "__len__") and len(value) <= LONGEST:
        for place, inner in enumerate(value):
            yield from _numbers(inner, f"{name}[{place}]", depth + 1)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message: of JSON, of protobuf, or of ROS 2."""
    if isinstance(value, dict):
        return value
    if hasattr(value, "DESCRIPTOR"):
        return {field.name: getattr(value, field.name) for field in value.DESCRIPTOR.fields}
    slots = getattr(value, "__slots__", None)
    if slots:
        return {name.lstrip("_"): getattr(value, name) for name in slots if hasattr(value, name)}
    return vars(value) if hasattr(value, "__dict__") else None
