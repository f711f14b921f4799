"""MCAP, the format of robots and test benches, by mcap: messages in JSON, ROS 2's CDR or protobuf.

The columns are `topic.field`. Elements of an array are `field[0]`. If the message has a list of
names of the same length, or each element has a `name` or an `id`, they are `field[name]` too, since
the order of joints may change between messages. ROS 1's messages are not read: their decoder
compiles and executes content of the file.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from mcap.decoder import DecoderFactory
from mcap.reader import make_reader
from mcap.records import Schema
from mcap_protobuf.decoder import DecoderFactory as Protobuf
from mcap_ros2.decoder import DecoderFactory as Ros2

from coupled.errors import InputError, shown
from coupled.record.importing.formats.columns import MOST_COLUMNS, Found, as_numbers

DEEPEST = 6  # messages within messages
LONGEST = 64  # elements of an array that become columns
STAMPS = "log_time"
NAMES = ("name", "names", "label", "labels", "id", "ids")  # endings of fields of names
IDENTIFIERS = ("id", "ids", "joint_id", "joint_ids")  # fields of numbers that name elements
Labels = tuple[list[str], ...]
TIMES = ({"sec", "nanosec"}, {"seconds", "nanos"}, {"sec", "nsec"})


class _Json(DecoderFactory):
    """Decodes messages in JSON, which have no schema."""

    def decoder_for(
        self, message_encoding: str, schema: Schema | None
    ) -> Callable[[bytes], Any] | None:
        del schema
        return json.loads if message_encoding == "json" else None


def read_mcap(path: Path, content: bytes) -> list[Found]:
    """Return the fields of numbers, and each topic's `log_time` and `publish_time`, in ns.

    An array's elements are `field[0]`, `field[1]`, …, and by their names `field[name]`. An index
    whose name changes is refused. A field with s and ns is one column.
    """
    reader = make_reader(io.BytesIO(content))
    summary = reader.get_summary()
    encodings = {c.message_encoding for c in summary.channels.values()} if summary else set()
    factories = [_Json(), Ros2(), Protobuf()]
    topics: dict[str, list[dict[str, _Value]]] = {}
    undecoded: set[str] = set()
    for schema, channel, message in reader.iter_messages(log_time_order=False):  # as in the file
        decode = next(
            filter(None, (f.decoder_for(channel.message_encoding, schema) for f in factories)), None
        )
        if decode is None:
            undecoded.add(channel.message_encoding)
            continue
        row = {each.name: each for each in _values(decode(message.data), "", 0, ())}
        for name, ns in ((STAMPS, message.log_time), ("publish_time", message.publish_time)):
            row[name] = _Value(name, ns, unit="ns")
        topics.setdefault(channel.topic, []).append(row)
    columns = [each for topic, rows in topics.items() for each in _columns(topic, rows)]
    if not columns:
        kinds = ", ".join(sorted(undecoded | encodings)) or "none"
        problem = f"holds no message with numbers in json, cdr (ROS 2) or protobuf, but: {kinds}"
        raise InputError(path, "", problem)
    return columns[:MOST_COLUMNS]


@dataclass(frozen=True)
class _Value:
    """A number of a message, by its name in it, and its unit if the message gives one.

    `called` is the element's name, if it has one. A `text` in a number's place has the number NaN.
    """

    name: str
    number: float
    called: str = ""
    unit: str = ""
    text: str = ""


def _columns(topic: str, rows: list[dict[str, _Value]]) -> list[Found]:
    names = list(dict.fromkeys(name for row in rows for name in row))[:MOST_COLUMNS]
    stamps = f"{topic}.{STAMPS}"
    columns = []
    for name in names:
        found = [row.get(name) for row in rows]
        if all(each is None or each.text for each in found):
            continue
        values = as_numbers([np.nan if each is None else each.number for each in found])
        if values is None:
            continue
        called = list(dict.fromkeys(each.called for each in found if each is not None))
        refused = ""
        if len(called) > 1:
            first, other = (shown(word, 40) or "without a name" for word in called[:2])
            refused = f"is {first} in one message and {other} in another: give it by its name, as"
            array, _, field = name.rpartition("[")
            refused += f" {topic}.{array}[{first}]{field.partition(']')[2]}"
        for row, each in enumerate(found, start=1):
            if each is not None and each.text:
                refused = refused or f"message {row} of {topic} holds {each.text!r}, not a number"
        units = {each.unit for each in found if each is not None}
        unit = units.pop() if len(units) == 1 else ""
        values = values[:0] if refused else values
        columns.append(Found(f"{topic}.{name}", values, unit, topic, stamps, refused))
    return columns


def _values(value: Any, name: str, depth: int, labels: Labels) -> Iterator[_Value]:
    """Yield the numbers of a decoded message; `labels` are the names of elements found so far."""
    if isinstance(value, (bool, int, float)):
        yield _Value(name, value)
        return
    if isinstance(value, str) and value.casefold() != "nan":
        yield _Value(name, np.nan, text=shown(value, 40) or "''")
        return
    if depth > DEEPEST or isinstance(value, (str, bytes)):
        return
    if (fields := _fields(value)) is not None:
        if set(fields) in TIMES:
            s, ns = (int(fields[key]) for key in sorted(fields, key=len))
            yield _Value(name, 1_000_000_000 * s + ns, unit="ns")
            return
        labels = (*_labels(fields), *labels)
        for key, inner in fields.items():
            yield from _values(inner, f"{name}.{key}" if name else key, depth + 1, labels)
    elif hasattr(value, "__len__") and len(value) <= LONGEST:
        words = _own_names(value) or next((w for w in labels if len(w) == len(value)), None)
        for place, inner in enumerate(value):
            word = "" if words is None else words[place]
            for each in _values(inner, f"{name}[{place}]", depth + 1, labels):
                yield replace(each, called=f"{word}{each.called and '.'}{each.called}")
            if word and words is not None and words.count(word) == 1:
                yield from _values(inner, f"{name}[{word}]", depth + 1, labels)


def _labels(fields: Mapping[str, Any]) -> Labels:
    """Return the lists of words in a message, first those of fields for names."""
    lists = {
        key: [_called(word) for word in value]
        for key, value in fields.items()
        if not isinstance(value, (str, bytes)) and hasattr(value, "__len__")
        if 0 < len(value) <= LONGEST and _fields(value) is None
        if all(_is_name(key, word) for word in value)
    }
    by_name = sorted(lists, key=lambda key: not key.lower().endswith(NAMES))
    return tuple(lists[key] for key in by_name)


def _own_names(elements: Any) -> list[str] | None:
    """Return the names that elements have in a field of their own, such as {"name": "a", …}."""
    each = [_fields(element) or {} for element in elements]
    for key in each[0] if each else ():
        words = [fields.get(key) for fields in each]
        if key.lower().endswith(NAMES) and all(_is_name(key, word) for word in words):
            return [_called(word) for word in words]
    return None


def _called(word: object) -> str:
    """Return an element's name; it is never an index."""
    text = str(word)
    return f"id {text}" if text.lstrip("-").isdecimal() else text


def _is_name(key: str, word: object) -> bool:
    """Tell whether a value names an element: a word, or a number in a field of identifiers."""
    number = isinstance(word, int) and not isinstance(word, bool)
    return isinstance(word, str) or (number and key.lower() in IDENTIFIERS)


def _fields(value: Any) -> Mapping[str, Any] | None:
    """Return the fields of a message: of JSON, of protobuf, or of ROS 2."""
    if isinstance(value, Mapping):  # of protobuf, too
        return value
    if hasattr(value, "DESCRIPTOR"):
        return {field.name: getattr(value, field.name) for field in value.DESCRIPTOR.fields}
    slots = getattr(value, "__slots__", None)
    if slots:
        return {name.lstrip("_"): getattr(value, name) for name in slots if hasattr(value, name)}
    return vars(value) if hasattr(value, "__dict__") else None
