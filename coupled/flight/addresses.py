"""Addresses of JSBSim's objects, and of its functions that read and set property nodes.

A call of a node's method from Python takes 25 to 50 ns, and a frame of three controls needs 18 of
them; from compiled code the same function takes some 5 ns. JSBSim's module exports its C++
functions by the names of the Itanium ABI (Linux, macOS). A word of a node's Python object is its
address; it is accepted only if it refers to an object with the table of virtual functions of
JSBSim's nodes. Where anything differs, frames are flown through Python, with the same record to the
byte. The step itself, `run()`, may raise an error, and is called from Python.
"""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

_READ, _WRITE = "_ZNK14SGPropertyNode14getDoubleValueEv", "_ZN14SGPropertyNode14setDoubleValueEd"
_TABLE = "_ZTV14SGPropertyNode"
_TABLE_OF_AERODYNAMICS = "_ZTVN6JSBSim14FGAerodynamicsE"
_SEARCHED = 128  # doubles of an object of the aerodynamics
_WORD = ctypes.sizeof(ctypes.c_void_p)
_TO_FUNCTIONS = 2 * _WORD  # a table begins with an offset and the type
_LONGEST = 4 * _WORD  # of a node's object: its head, Cython's table, and the node; all are pointers


class NodeFunctions(NamedTuple):
    """The addresses of `double read(node)` and `bool write(node, double)`, and of their class."""

    read: int
    write: int
    table: int


@lru_cache(maxsize=4)
def node_functions(module: str) -> NodeFunctions | None:
    """Return the functions of the nodes that are defined in a Python module, if it exports them."""
    try:
        library = _library(module)
        read, write = (ctypes.cast(library[name], ctypes.c_void_p) for name in (_READ, _WRITE))
        table = _table(library, _TABLE)
    except _NOT_THERE:
        return None
    return NodeFunctions(read.value or 0, write.value or 0, table)


_NOT_THERE = (KeyError, OSError, AttributeError, ValueError)


def _library(module: str) -> ctypes.CDLL:
    return ctypes.CDLL(str(sys.modules[module].__file__))


def _table(library: ctypes.CDLL, name: str) -> int:
    """Return the address to which an object with this table of virtual functions refers."""
    return ctypes.addressof(ctypes.c_char.in_dll(library, name)) + _TO_FUNCTIONS


def neighbours(aerodynamics: object, values: Sequence[float]) -> ctypes.Array[Any] | None:
    """Return the two neighbouring numbers of the aerodynamics that have these values.

    They are set in the returned array. None if they are not found, or not once. The array is valid
    as long as the object lives.
    """
    try:
        library = _library(type(aerodynamics).__module__)
        address = _address(aerodynamics, _table(library, _TABLE_OF_AERODYNAMICS))
    except _NOT_THERE:
        return None
    if not address:
        return None
    numbers = (ctypes.c_double * _SEARCHED).from_address(address)
    first, second = values
    found = [i for i in range(_SEARCHED - 1) if (numbers[i], numbers[i + 1]) == (first, second)]
    if len(found) != 1:
        return None
    place = address + found[0] * ctypes.sizeof(ctypes.c_double)
    return (ctypes.c_double * 2).from_address(place)


def node_of(method: Callable[..., object]) -> object:
    """Return the node whose method a function is; None if it is no node's method."""
    return getattr(method, "__self__", None)


def addresses(nodes: Sequence[object]) -> tuple[NodeFunctions, list[int]] | None:
    """Return the functions and addresses of nodes of one class; None if they are not known.

    The addresses are valid as long as the objects live.
    """
    kinds = {type(node) for node in nodes}
    if len(kinds) != 1 or (functions := node_functions(kinds.pop().__module__)) is None:
        return None
    found = [_address(node, functions.table) for node in nodes]
    return (functions, found) if all(found) else None


def _address(node: object, table: int) -> int:
    """Return the address of an object's C++ object with this table, or 0."""
    first, end = object.__basicsize__, type(node).__basicsize__
    for offset in range(first, min(end, _LONGEST), _WORD):
        address = ctypes.c_ssize_t.from_address(id(node) + offset).value
        if address and ctypes.c_ssize_t.from_address(address).value == table:
            return address
    return 0
