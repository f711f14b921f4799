"""The rig's kernels as plain Python: a changed stage runs without compilation.

`interpret()` replaces the compiler, for modules that are imported later. A kernel reads the fields
of a record as attributes, which numpy's records do not have: each record is converted to a plain
object for the call, and its changes are written back. If another argument is the same memory, each
field is read and set in the record itself, which is slower.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import wraps
from types import SimpleNamespace
from typing import Any

import numpy as np

from coupled.rig import compiled

Function = Callable[..., Any]


def opened(record: Any) -> SimpleNamespace:
    """Return a record's fields as attributes; its arrays are the record's own."""
    found = SimpleNamespace()
    for name in record.dtype.names:
        value = record[name]
        if isinstance(value, np.void):
            value = opened(value)
        elif not isinstance(value, np.ndarray):
            value = value.item()
        setattr(found, name, value)
    return found


def written_back(plain: SimpleNamespace, record: Any) -> None:
    """Write the attributes back to their record."""
    for name in record.dtype.names:
        value = getattr(plain, name)
        if isinstance(value, SimpleNamespace):
            written_back(value, record[name])
        elif not isinstance(value, np.ndarray):
            record[name] = value


class InPlace:
    """A record's fields as attributes, read from its memory and set there."""

    __slots__ = ("_record",)
    _record: Any

    def __init__(self, record: Any) -> None:
        object.__setattr__(self, "_record", record)

    def __getattr__(self, name: str) -> Any:
        value = self._record[name]
        if isinstance(value, np.void):
            return InPlace(value)
        return value if isinstance(value, np.ndarray) else value.item()

    def __setattr__(self, name: str, value: Any) -> None:
        self._record[name] = value


def _is_table(argument: Any) -> bool:
    """Return whether an argument is an array of records."""
    return type(argument) is np.ndarray and argument.dtype.names is not None


def _also_numbers(table: Any, arguments: tuple[Any, ...]) -> bool:
    """Return whether another argument is the memory of an array of records."""
    others = [each for each in arguments if type(each) is np.ndarray and each is not table]
    return any(np.may_share_memory(table, other) for other in others)


def plain(function: Function) -> Function:
    """Return a kernel that takes numpy's records, and plain objects from another kernel."""

    @wraps(function)
    def called(*arguments: Any) -> Any:
        records = []
        given = list(arguments)
        for i, argument in enumerate(arguments):
            if type(argument) is np.void:
                given[i] = opened(argument)
                records.append((given[i], argument))
            elif _is_table(argument) and _also_numbers(argument, arguments):
                given[i] = [InPlace(each) for each in argument]
            elif _is_table(argument):
                given[i] = [opened(each) for each in argument]
                records += zip(given[i], argument, strict=True)
        found = function(*given)
        for now, record in records:
            written_back(now, record)
        return found

    return called


def _carray(address: int, shape: int | tuple[int, ...], dtype: Any) -> Any:
    count = int(np.prod(shape)) * np.dtype(dtype).itemsize
    return np.frombuffer((ctypes.c_char * count).from_address(int(address)), dtype).reshape(shape)


def interpret() -> None:
    """Make the rig's kernels plain Python from now on; kernels of other packages stay compiled."""
    bound = compiled.bound

    def plain_or(compiler: Function) -> Function:
        def chosen(function: Function, **options: bool) -> Function:
            of_the_rig = function.__module__.startswith("coupled.rig.")
            return plain(function) if of_the_rig else compiler(function, **options)

        return chosen

    def plain_bound(kernel: Any, *arguments: Any) -> Any:
        return bound(kernel, *arguments) if hasattr(kernel, "compile") else kernel

    placed: list[Function] = []

    def number(kernel: Function, *arguments: Any) -> int:
        placed.append(kernel)
        return len(placed) - 1

    instead = {
        "machine_code": number,
        "call_at": lambda place, address, k: placed[place](address, k),
        "stage": plain_or(compiled.stage),
        "seldom": plain_or(compiled.seldom),
        "entry": plain_or(compiled.entry),
        "bound": plain_bound,
        "carray": _carray,
        "pointer": int,
    }
    vars(compiled).update(instead)
