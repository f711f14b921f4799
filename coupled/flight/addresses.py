"""Addresses of JSBSim's property nodes, and of its functions that read and set them.

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
from typing import NamedTuple

_READ, _WRITE = "_ZNK14SGPropertyNode14getDoubleValueEv", "_ZN14SGPropertyNode14setDoubleValueEd"
_TABLE = "_ZTV14SGPropertyNode"
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
        library = ctypes.CDLL(str(sys.modules[module].__file__))
        read, write = (ctypes.cast(library[name], ctypes.c_void_p) for name in (_READ, _WRITE))
        table = ctypes.addressof(ctypes.c_char.in_dll(library, _TABLE))
    except (KeyError, OSError, AttributeError, ValueError):
        return None
    return NodeFunctions(read.value or 0, write.value or 0, table + _TO_FUNCTIONS)


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
    """Return the address of a node's C++ object, or 0."""
    first, end = object.__basicsize__, type(node).__basicsize__
    for offset in range(first, min(end, _LONGEST), _WORD):
        address = ctypes.c_ssize_t.from_address(id(node) + offset).value
        if address and ctypes.c_ssize_t.from_address(address).value == table:
            return address
    return 0
