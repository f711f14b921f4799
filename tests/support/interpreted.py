"""The rig's kernels as plain Python: nothing is compiled, so that a changed stage runs at once.

`interpret()` puts them in the compiler's place; it is for whoever imports the stages after it.
A kernel reads the fields of a record as attributes, which numpy's records do not have: each is
opened into plain objects for the call, and what the kernel has set is written back after it.
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
    """Put what the attributes are now into the record that they were opened from."""
    for name in record.dtype.names:
        value = getattr(plain, name)
        if isinstance(value, SimpleNamespace):
            written_back(value, record[name])
        elif not isinstance(value, np.ndarray):
            record[name] = value


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
            elif type(argument) is np.ndarray and argument.dtype.names:
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
    """Let the rig's kernels be plain Python from here on; those of other rooms stay compiled."""
    bound = compiled.bound

    def plain_or(compiler: Function) -> Function:
        def chosen(function: Function) -> Function:
            of_the_rig = function.__module__.startswith("coupled.rig.")
            return plain(function) if of_the_rig else compiler(function)

        return chosen

    def plain_bound(kernel: Any, *arguments: Any) -> Any:
        return bound(kernel, *arguments) if hasattr(kernel, "compile") else kernel

    instead = {
        "stage": plain_or(compiled.stage),
        "entry": plain_or(compiled.entry),
        "bound": plain_bound,
        "carray": _carray,
        "pointer": int,
    }
    vars(compiled).update(instead)
