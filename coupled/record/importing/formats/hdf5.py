"""HDF5, and MATLAB files of v7.3, which are HDF5: vectors by their path, `LOG.force`.

MATLAB's tables and dates are read by mat-io; its other objects are refused by name. Only data in
the file itself are read. Links to other files, external data and virtual data sets are skipped,
since a log could otherwise name any file on the computer.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from coupled.errors import shown
from coupled.record.importing.formats.columns import (
    MOST_COLUMNS,
    Found,
    Numbers,
    as_numbers,
    by_their_times,
    check_vectors,
    columns_of_matrix,
    scaling_in,
    unread,
)
from coupled.record.importing.formats.objects import MARK, refused_object, replace_objects

DEEPEST = 6  # groups within groups
MOST_VALUES = 200_000_000  # of one data set; a small file can declare any size
UNITS = ("unit", "units", "Unit", "Units")


def read_hdf5(path: Path, content: bytes, matrix: str, names: list[str] | str) -> list[Found]:
    """Return the vectors of a file, and with `matrix` its columns, named by `names`.

    A field of a MATLAB struct is `struct.field`, of an array of structs `struct(1).field`; a
    data set in groups `group.set`, a column of a compound one `group.set.column`.
    """
    found: dict[str, Found] = {}
    with h5py.File(io.BytesIO(content), "r") as file:
        _walk(found, file, file, "", 0)
        objects = [name for name, column in found.items() if column.refused.startswith(MARK)]
        variables = list(dict.fromkeys(re.split(r"[.(]", name)[0] for name in objects))
        whole = not objects or _holds_all(file)
        if matrix:
            table = _own(file, matrix.replace(".", "/"))
            values = _array(table) if isinstance(table, h5py.Dataset) else None
            if values is not None and "MATLAB_class" in table.attrs:
                values = values.T  # MATLAB's orientation
            words = names if isinstance(names, list) else _words(file, _own(file, names))
            columns = columns_of_matrix(path, matrix, values, names, words)
            found.update({name: Found(name, column) for name, column in columns.items()})
    if objects and whole:
        replace_objects(found, content, variables)
    if not objects:
        check_vectors(path, list(found.values()))
    return by_their_times(list(found.values()))


def _own(group: Any, name: str) -> Any:
    """Return an item of a group by its name, or None if it is in another file."""
    if not name or name not in group:
        return None
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return None
    return group[name]


def _walk(found: dict[str, Found], file: Any, group: Any, place: str, depth: int) -> None:
    for name in group:
        if depth > DEEPEST or len(found) >= MOST_COLUMNS:
            return
        if str(name).startswith("#"):  # MATLAB's storage of cells
            continue
        _take(found, file, _own(group, name), f"{place}.{name}" if place else str(name), depth)


def _holds_all(file: Any) -> bool:
    """Tell whether all data of objects are in the file itself."""
    elsewhere: list[str] = []

    def look(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
            elsewhere.append(name)

    for name in ("#refs#", "#subsystem#"):
        group = _own(file, name)
        if isinstance(group, h5py.Group):
            group.visititems(look)
    return not elsewhere


def _refused(item: Any) -> str:
    """Return the class of a MATLAB object, or the kind of another special array; else ""."""
    if "MATLAB_sparse" in item.attrs:
        return "sparse matrix"
    if "MATLAB_object_decode" in item.attrs:
        return _word(item.attrs.get("MATLAB_class", "object"))
    return ""


def _take(found: dict[str, Found], file: Any, item: Any, name: str, depth: int) -> None:
    kind = _refused(item) if item is not None else ""
    if kind:
        found[name] = refused_object(name, kind)
        return
    if isinstance(item, h5py.Group):
        _walk(found, file, item, name, depth + 1)
    if not isinstance(item, h5py.Dataset):
        return
    if _refers(item) and item.size > 1 and "." in name:
        array, _, field = name.rpartition(".")
        for place, reference in enumerate(np.ravel(_array(item))):
            if reference and depth <= DEEPEST and len(found) < MOST_COLUMNS:
                _take(found, file, file[reference], f"{array}({place + 1}).{field}", depth + 1)
        return
    values = _array(item)
    if values is None:
        return
    if _text(item) or item.dtype.kind not in "biufV":
        column = None if _text(item) else unread(name, values)
        found.update({} if column is None else {name: column})
        return
    unit = _unit(item.attrs)
    applied = [
        key for key in ("scale_factor", "add_offset") if _number(item.attrs, key) is not None
    ]
    scaling = scaling_in(item.attrs, applied)
    values = _unpacked(values, item.attrs)
    if _word(item.attrs.get("MATLAB_class", "")) == "logical":
        values = values.astype(bool)
    if values.dtype.names:
        for field in values.dtype.names:
            _keep(found, f"{name}.{field}", values[field])
    else:
        _keep(found, name, values, unit, scaling)


def _keep(
    found: dict[str, Found], name: str, values: Any, unit: str = "", scaling: str = ""
) -> None:
    if values.ndim == 2 and 1 in values.shape:
        values = values.reshape(-1)
    if (states := h5py.check_enum_dtype(values.dtype)) is not None:
        problem = f"holds states by name, {shown(', '.join(states), 60)}, no numbers"
        found[name] = Found(name, np.zeros(0), refused=problem)
        return
    column: Numbers | None = as_numbers(values)
    if column is None:
        refused = unread(name, values)
        found.update({} if refused is None else {name: refused})
    elif column.size > 1:
        found[name] = Found(name, column, unit, unscaled=scaling)


def _array(item: Any) -> Any:
    """Return a data set's values, or None if they are in another file or too many."""
    if item.shape is None or item.external or item.is_virtual or item.size > MOST_VALUES:
        return None
    if item.attrs.get("MATLAB_empty", 0):
        return None
    return item[()]


def _refers(item: Any) -> bool:
    return h5py.check_ref_dtype(item.dtype) is h5py.Reference


def _text(item: Any) -> bool:
    return _word(item.attrs.get("MATLAB_class", "")) == "char"


def _word(value: Any) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _unit(attributes: Mapping[str, Any]) -> str:
    for key in UNITS:
        if key in attributes and np.size(attributes[key]) == 1:
            return _word(np.ravel(attributes[key])[0])[:40].strip()
    return ""


def _unpacked(values: Any, attributes: Mapping[str, Any]) -> Any:
    """Return physical values of data packed by netCDF's conventions."""
    scale, offset = _number(attributes, "scale_factor"), _number(attributes, "add_offset")
    empty = [_number(attributes, key) for key in ("_FillValue", "missing_value")]
    if values.dtype.kind not in "iuf":
        return values
    lacking = np.isin(values, [each for each in empty if each is not None])
    low, high = (_number(attributes, key) for key in ("valid_min", "valid_max"))
    span = np.ravel(attributes.get("valid_range", []))
    low, high = span if span.size == 2 and span.dtype.kind in "iuf" else (low, high)
    lacking |= (values < (-np.inf if low is None else low)) | (
        values > (np.inf if high is None else high)
    )
    if scale is None and offset is None and not lacking.any():
        return values
    physical = values * (1.0 if scale is None else scale) + (offset or 0.0)
    return np.where(lacking, np.nan, physical)


def _number(attributes: Mapping[str, Any], key: str) -> float | None:
    value = np.ravel(attributes[key]) if key in attributes else np.zeros(0)
    return float(value[0]) if value.size == 1 and value.dtype.kind in "iuf" else None


def _words(file: Any, item: Any) -> list[str]:
    """Return the words of a char matrix, of a cell array of them, or of a data set of strings."""
    if not isinstance(item, h5py.Dataset) or (values := _array(item)) is None:
        return []
    if _refers(item):
        return [word for each in np.ravel(values) for word in _words(file, file[each])[:1]]
    if _text(item):
        rows = np.atleast_2d(values.T)
        return ["".join(chr(int(code)) for code in row).strip() for row in rows]
    if h5py.check_string_dtype(item.dtype):
        return [_word(each).strip() for each in np.ravel(values)]
    return []
