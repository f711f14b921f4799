"""MATLAB's tables, timetables, dates and durations, by mat-io; other objects are refused by name.

A file stores objects apart from its variables. The variable of an object has only numbers that
refer to it, which are never a column.
"""

from __future__ import annotations

import importlib
import importlib.util
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from coupled.record.importing.formats.columns import MOST_COLUMNS, TEXT, Found, as_numbers

DEEPEST = 6  # structs within structs


def replace_objects(
    found: dict[str, Found], content: bytes, variables: Sequence[str], suffix: str = ".mat"
) -> None:
    """Replace the refusals in `found` by the columns of the objects in `variables`.

    Without mat-io, or for objects that it does not read, `found` keeps them, with the reason.
    """
    if importlib.util.find_spec("matio") is None:
        _explain(found, "reading it needs mat-io: pip install 'coupled[logs]'")
        return
    try:
        matio: Any = importlib.import_module("matio")
    except Exception as error:  # of a release incompatible with the installed pandas
        _explain(found, f"mat-io cannot be loaded: {type(error).__name__}: {str(error)[:100]}")
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"log{suffix}"
        path.write_bytes(content)
        for variable in variables:
            try:
                loaded = matio.load_from_mat(
                    str(path), variable_names=[variable], add_table_attrs=True
                )
            except Exception as error:  # of a library on unknown content
                why = f"mat-io cannot read it: {type(error).__name__}: {str(error)[:100]}"
                _explain(found, why, variable)
                continue
            if variable in loaded:
                _collect(found, variable, loaded[variable], 0)
    _explain(found, "save it as plain numbers")


def refused_object(name: str, kind: object) -> Found:
    """Return the refused column of a MATLAB object."""
    word = kind.decode("utf-8", "replace") if isinstance(kind, bytes) else str(kind)
    return Found(name, np.zeros(0), refused=f"{MARK}{word.strip()[:60] or 'object'}")


MARK = "is a MATLAB "


def _explain(found: dict[str, Found], why: str, variable: str = "") -> None:
    """Add the reason to refused objects without one."""
    for name, column in found.items():
        own = not variable or name == variable or name.startswith((f"{variable}.", f"{variable}("))
        if own and column.refused.startswith(MARK) and ":" not in column.refused:
            found[name] = Found(name, column.values, refused=f"{column.refused}: {why}")


def _collect(found: dict[str, Found], name: str, value: Any, depth: int) -> None:
    """Add the columns of the tables, dates and durations in a value to `found`."""
    if depth > DEEPEST or len(found) >= MOST_COLUMNS:
        return
    if hasattr(value, "columns") and hasattr(value, "index"):
        found.pop(name, None)
        _table(found, name, value)
    elif isinstance(value, np.ndarray) and value.dtype.kind in "mM":
        if 1 in value.shape and value.size > 1:
            found[name] = Found(name, _ns(value.reshape(-1)), "ns")
    elif isinstance(value, np.ndarray) and value.dtype.names is not None:
        for place, element in enumerate(value.flat):
            own = name if value.size == 1 else f"{name}({place + 1})"
            for field in value.dtype.names:
                if element[field] is not None:
                    _collect(found, f"{own}.{field}", element[field], depth + 1)


def _table(found: dict[str, Found], name: str, table: Any) -> None:
    """Add the variables of a table; row times stamp those of a timetable."""
    index = np.asarray(table.index)
    timed = index.dtype.kind in "mM"
    group = name if timed else ""
    stamps = f"{name}.{table.index.name or 'Time'}" if timed else ""
    if timed:
        found[stamps] = Found(stamps, _ns(index), "ns", group, stamps)
    units = list(table.attrs.get("varUnits", table.attrs.get("VariableUnits", [])))
    if len(units) != table.shape[1]:  # a variable of several columns has one unit
        units = [""] * table.shape[1]
    for place, word in enumerate(table.columns):
        column, own = np.asarray(table.iloc[:, place]), f"{name}.{word}"
        if column.dtype.kind in "mM":
            found[own] = Found(own, _ns(column), "ns", group, stamps)
            continue
        values = as_numbers(column)
        refused = "" if values is not None else TEXT
        kept = np.zeros(0) if values is None else values
        unit = str(units[place]).strip()[:40]
        found[own] = Found(own, kept, unit, group, stamps, refused)


def _ns(times: Any) -> Any:
    """Return dates or durations in integer ns; doubles with NaN if one is missing."""
    lacking = np.isnat(times)
    counts = times.astype(f"{'datetime64' if times.dtype.kind == 'M' else 'timedelta64'}[ns]")
    counts = counts.astype(np.int64)
    return np.where(lacking, np.nan, counts.astype(np.float64)) if lacking.any() else counts
