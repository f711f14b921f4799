"""Wrong values and structural damage for fuzzing: of calls, of JSON and TOML tables, of XML."""

from __future__ import annotations

import copy
import random
from collections.abc import Iterator
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import polars as pl

import coupled

# Objects that a program may pass by mistake as any argument.
VALUES: tuple[Any, ...] = (
    *(None, True, 0, -1, 3, 10**400, 1.5, float("nan"), float("inf"), -1e300, 1 + 2j),
    *("", "x", "t37", "\0", "a" * 5000, "../..", "no/such.csv", "\x1b[31m", b"x"),
    *([], [None], [1, 2], ["a"], [[]], (), (1.0,), {}, {"a": 1}, {1: 2}, {"a": {}}, set(), {3}),
    *(object(), len, int, print, Exception("x"), Decimal("1.5"), range(3), ...),
    *(Path("no/such.toml"), Path(), Path("x\0"), datetime(2020, 1, 1, tzinfo=UTC)),
    *(np.array(3.0), np.array([]), np.array([np.nan, 1.0]), np.zeros((2, 2, 2)), np.array(["a"])),
    *(np.float64(2.5), np.int64(-3), np.datetime64("2020-01-01"), np.bool_(True)),
    *(pl.DataFrame(), pl.DataFrame({"a": [1.0]}), pl.DataFrame({"time_s": ["x", "y"]})),
    *(pl.DataFrame({"time_s": [1.0, 0.0], "a": [1, 2]}), pl.Series([1.0])),
)

# Values that another program may write in JSON or TOML.
PLAIN: tuple[Any, ...] = (
    *(None, True, 0, -1, 7, 10**400, 1.5, -1e300, 5e-324, float("nan"), float("inf")),
    *("", "x", "\0", "\u202e", "a" * 3000, [], [[]], [None], [1, "a"], {}, {"a": {}}, {"": []}),
)


def places(table: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield the path of each value in nested tables and lists, including the whole."""
    yield path
    if isinstance(table, dict):
        for key, value in table.items():
            yield from places(value, (*path, key))
    elif isinstance(table, list):
        for number, value in enumerate(table):
            yield from places(value, (*path, number))


def damaged(table: Any, rng: random.Random, values: tuple[Any, ...] = PLAIN) -> Any:
    """Return nested tables with one to three values replaced, omitted, renamed or nested."""
    found = copy.deepcopy(table)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        path = rng.choice(list(places(found)))
        if not path:
            if rng.random() < 0.1:
                return copy.deepcopy(rng.choice(values))
            continue
        holder = found
        for step in path[:-1]:
            holder = holder[step]
        match rng.randrange(5):
            case 0:
                del holder[path[-1]]
            case 1 if isinstance(holder, dict):
                holder[rng.choice(["", "x", "effects", "name", "a.b"])] = holder.pop(path[-1])
            case 2:
                holder[path[-1]] = [holder[path[-1]]]
            case _:
                holder[path[-1]] = copy.deepcopy(rng.choice(values))
    return found


def unexpected(error: BaseException) -> str:
    """Return an unexpected error as shown to a user; empty for a refusal in one line."""
    if isinstance(error, (coupled.InputError, TypeError)):
        text = str(error)
        return "" if text and "\n" not in text else f"not a line: {text!r}"
    return f"{type(error).__name__}: {error}"


# Faults in an aircraft's XML, some of which crash JSBSim.
WORDS = (
    *("", "abc", "nan", "1e999", "-1", "no/such", "a[99999999]", "a[-1]", "aero/alpha-rad["),
    *("/", "//", "1/2", "a b", "aero/alpha-rad", "velocities/q-rad_sec", "-", "1,5", "é", "0x1"),
)


def damaged_xml(text: bytes, rng: random.Random) -> bytes:
    """Return an aircraft's XML with one to three faults: of elements, or of the text itself."""
    if rng.random() < 0.2:
        return _torn(text, rng)
    root = ElementTree.fromstring(text)
    for _ in range(rng.choice((1, 1, 2, 3))):
        parents = [(parent, child) for parent in root.iter() for child in parent]
        parent, child = rng.choice(parents)
        match rng.randrange(7):
            case 0:
                parent.remove(child)
            case 1:
                parent.append(copy.deepcopy(child))
            case 2:
                child.tag = rng.choice(["property", "value", "table", "function", "x", "pitch"])
            case 3:
                child.attrib = {"name": rng.choice(WORDS), "unit": rng.choice(["FT", "x"])}
            case 4:
                ElementTree.SubElement(child, "property").text = rng.choice(WORDS)
            case 5:
                child[:] = []
            case _:
                child.text = rng.choice(WORDS)
    return ElementTree.tostring(root)


def _torn(text: bytes, rng: random.Random) -> bytes:
    """Return text that is not valid XML, or declares another encoding."""
    at = rng.randrange(len(text))
    encodings = (b"utf-16", b"no-such", b"utf-7", b"cp037", b"big5")
    head = b'<?xml version="1.0" encoding="%s"?>\n' % rng.choice(encodings)
    body = text[text.index(b"<fdm_config") :]
    return rng.choice(
        (text[:at], text[:at] + text[at + 9 :], text[:at] + b"\0" + text[at:], head + body, b"")
    )
