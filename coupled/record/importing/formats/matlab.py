"""The vectors of a MATLAB file, by name: variables, fields of structs, columns of a matrix.

Only numbers are read. Function handles and cells are skipped; tables and dates are read by mat-io,
and other objects refused. Nothing in a file is executed.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.exceptions import ComplexWarning
from scipy import io as scipy_io
from scipy.io.matlab import MatlabOpaque, varmats_from_mat
from scipy.sparse import issparse

from coupled.errors import InputError
from coupled.record.importing.formats.columns import (
    Found,
    by_their_times,
    check_vectors,
    columns_of_matrix,
    unread,
)
from coupled.record.importing.formats.objects import MARK, refused_object, replace_objects

DEEPEST = 6  # structs within structs
MOST_FIELDS = 10_000


def read_matlab(path: Path, content: bytes, matrix: str, names: list[str] | str) -> list[Found]:
    """Return the vectors of a MATLAB file, v4 to v7.2.

    A field of a struct is `struct.field`, of an array of structs `struct(1).field`. With `matrix`
    the columns of that variable are included, by `names`: a list, or the variable that holds them.
    """
    variables = _load(path, content)
    found: dict[str, Found] = {}
    objects = []
    for name, value in variables.items():
        before = _objects(found)
        _collect(found, name, value, 0)
        if _objects(found) - before:
            objects.append(name)
    if objects:
        replace_objects(found, content, objects)
    if matrix:
        words = names if isinstance(names, list) else _words(variables.get(names))
        columns = columns_of_matrix(path, matrix, variables.get(matrix), names, words)
        found.update({name: Found(name, values) for name, values in columns.items()})
    if not objects:
        check_vectors(path, list(found.values()))
    return by_their_times(list(found.values()))


def _objects(found: dict[str, Found]) -> set[str]:
    return {name for name, column in found.items() if column.refused.startswith(MARK)}


def _load(path: Path, content: bytes) -> dict[str, Any]:
    """Return the variables; an exception on a damaged file ends this separate process.

    scipy does not list the variables of a file with objects, and before 1.18 gives all objects
    one name, so each variable of such a file is read by itself.
    """
    if not _has_objects(content):
        return _load_together(path, content)
    found: dict[str, Any] = {}
    for name, variable in varmats_from_mat(io.BytesIO(content)):
        value = _read(variable.getvalue()).get(name or "None")
        own = _field(value, "s0") or name if isinstance(value, MatlabOpaque) else name
        if not own or own.startswith("__"):
            continue
        if own in found:
            raise InputError(path, own, "duplicate variable")
        found[own] = value
    return found


def _has_objects(content: bytes) -> bool:
    """Tell whether the head of a file of v5 to v7.2 refers to stored objects."""
    return content[124:128] in (b"\x00\x01IM", b"\x01\x00MI") and bool(
        content[116:124].strip(b"\0 ")
    )


def _load_together(path: Path, content: bytes) -> dict[str, Any]:
    listed = [name for name, _, _ in scipy_io.whosmat(io.BytesIO(content))]
    doubled = sorted({name for name in listed if listed.count(name) > 1})
    if doubled:
        raise InputError(path, doubled[0], "duplicate variable")
    wanted = [name for name in listed if not name.startswith("__")]
    loaded = _read(content, wanted)
    return {name: value for name, value in loaded.items() if not name.startswith("__")}


def _read(content: bytes, wanted: Sequence[str] | None = None) -> dict[str, Any]:
    """Return variables in the types of MATLAB; in those of storage scipy reads logicals as counts.

    Of complex numbers it would drop the imaginary parts: then they are read as stored.
    """
    read = partial(scipy_io.loadmat, variable_names=wanted, verify_compressed_data_integrity=True)
    with warnings.catch_warnings(action="error", category=ComplexWarning):
        try:
            return dict(read(io.BytesIO(content), mat_dtype=True))
        except ComplexWarning:
            return dict(read(io.BytesIO(content)))


def _field(value: MatlabOpaque, *fields: str) -> str:
    """Return the first of these fields that an object has, as text; "" if it has none."""
    for field in fields:
        if value.size and field in (value.dtype.names or ()):
            word = value.flat[0][field]
            return word.decode("utf-8", "replace") if isinstance(word, bytes) else str(word)
    return ""


def _collect(found: dict[str, Found], name: str, value: Any, depth: int) -> None:
    """Add to `found` the vectors in a variable, field by field."""
    if depth > DEEPEST or len(found) >= MOST_FIELDS:
        return
    if issparse(value):
        found[name] = Found(name, np.zeros(0), refused="is a sparse matrix; save it in full")
    if not isinstance(value, np.ndarray):
        return
    if isinstance(value, MatlabOpaque):
        found[name] = refused_object(name, _field(value, "s2", "_Class"))
    elif value.dtype.names is not None:
        for place, element in enumerate(value.flat):
            own = name if value.size == 1 else f"{name}({place + 1})"
            for field in value.dtype.names:
                _collect(found, f"{own}.{field}", element[field], depth + 1)
    elif value.dtype.kind in "biuf" and value.ndim == 2 and 1 in value.shape and value.size > 1:
        values = value.reshape(-1)
        found[name] = Found(name, values if values.dtype.kind == "b" else values.astype(np.float64))
    elif (refused := unread(name, value)) is not None:
        found[name] = refused


def _words(value: Any) -> list[str]:
    """Return the words of a char matrix or of a cell array of them."""
    if not isinstance(value, np.ndarray):
        return []
    if value.dtype.kind == "U":
        return [str(word).strip() for word in value.flat]
    if value.dtype.kind == "O":
        return [word for cell in value.flat for word in _words(cell)[:1]]
    return []
