"""Readings: a CSV that a person types, one row a reading, units in the columns' names.

    gradient_set, deflection_…, force_…, v1_V, v3_V    and, for the null of eq. (14), v2_V

A row with v2_V was noted without the multiplier; v2 is the supply's voltage that then
brought v1 back. Its deflection and force may be left empty. Rows are numbered as a text
editor does, the heads being row 1.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError, nearest
from coupled.files import write_text
from coupled.schema import LARGEST
from coupled.units import POUND_N, DEGREE_rad, INCH_m

Floats = NDArray[np.float64]
MOST_ROWS = 10_000
LABEL, REMARK = "gradient_set", "remark"
LENGTHS = {"deflection_m": 1.0, "deflection_mm": 1e-3, "deflection_in": INCH_m}
ANGLES = {"deflection_rad": 1.0, "deflection_deg": DEGREE_rad}
FORCES = {"force_N": 1.0, "force_lb": POUND_N}


@dataclass(frozen=True)
class Readings:
    """Readings in SI, a value a row: `deflection` in d, `force` in N, `v1` and `v3` in V.

    `row` is each one's row in its file, `label` its gradient set. `null_…` are the rows of
    the null: v1 and v3 are as noted with v2 = 0, v2 what brought v1 back.
    """

    row: NDArray[np.int64]
    label: tuple[str, ...]
    deflection: Floats
    force: Floats
    v1: Floats
    v3: Floats
    null_row: NDArray[np.int64]
    null_v1: Floats
    null_v2: Floats
    null_v3: Floats

    def without(self, rows: Sequence[int]) -> Readings:
        """Return the readings that do not stand in these rows of the file."""
        keep, null = ~np.isin(self.row, rows), ~np.isin(self.null_row, rows)
        return Readings(
            row=self.row[keep],
            label=tuple(name for name, kept in zip(self.label, keep, strict=True) if kept),
            deflection=self.deflection[keep],
            force=self.force[keep],
            v1=self.v1[keep],
            v3=self.v3[keep],
            null_row=self.null_row[null],
            null_v1=self.null_v1[null],
            null_v2=self.null_v2[null],
            null_v3=self.null_v3[null],
        )


def read_readings(path: Path, control: str) -> Readings:
    """Return the readings of a file, for a control's kind of deflection."""
    lines = _lines(path)
    if not lines:
        raise InputError(path, "", "holds nothing; its first row should name the columns")
    (_, heads), *rows = lines
    units = _units(path, heads, control)
    if not rows:
        raise InputError(path, "", "holds no readings below its column names")
    if len(rows) > MOST_ROWS:
        raise InputError(path, "", f"holds more than {MOST_ROWS} rows")
    parsed = []
    for number, cells in rows:
        if not any(cells):
            raise InputError(path, f"row {number}", "is empty; take it out")
        if len(cells) != len(heads):
            problem = f"has {len(cells)} cells, the columns are {len(heads)}"
            raise InputError(path, f"row {number}", problem)
        parsed.append((number, dict(zip(heads, cells, strict=True))))
    return _assembled(path, parsed, units)


def _lines(path: Path) -> list[tuple[int, list[str]]]:
    """Return (row number, stripped cells) of the file's rows, without blank ones at its end."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(path, "", f"cannot be read: {error.strerror or error}") from None
    except UnicodeDecodeError:
        raise InputError(path, "", "is not text in UTF-8; a CSV file is wanted") from None
    if "\0" in text:
        raise InputError(path, "", "is not text; a CSV file is wanted")
    reader = csv.reader(io.StringIO(text.rstrip()), strict=True)
    lines = []
    try:
        for cells in reader:
            lines.append((reader.line_num, [cell.strip() for cell in cells]))
    except csv.Error as error:
        raise InputError(path, f"row {reader.line_num}", f"is not CSV: {error}") from None
    return lines


def _units(path: Path, heads: list[str], control: str) -> dict[str, tuple[str, float]]:
    """Return {quantity: (column, factor to SI)} once the columns are known and of one system."""
    ours, other = (ANGLES, LENGTHS) if control == "wheel" else (LENGTHS, ANGLES)
    known = [LABEL, REMARK, *ours, *FORCES, "v1_V", "v2_V", "v3_V"]
    for head in heads:
        if heads.count(head) > 1:
            raise InputError(path, f"row 1: {head}", "stands there twice")
        if head in other:
            raise InputError(path, f"row 1: {head}", f"a {control} is read in {', '.join(ours)}")
        if head not in known:
            hint = "columns are parted by commas" if ";" in head else nearest(head, known)
            raise InputError(path, f"row 1: {head}", f"is no column of readings; {hint}")
    found = {"v1": ("v1_V", 1.0), "v3": ("v3_V", 1.0)}
    for quantity, choices in (("deflection", ours), ("force", FORCES)):
        present = [head for head in heads if head in choices]
        if len(present) > 1:
            problem = f"mixes units: {' and '.join(present)}; give one of them"
            raise InputError(path, "row 1", problem)
        column = present[0] if present else f"{quantity} in {' or '.join(choices)}"
        found[quantity] = (column, choices.get(column, 1.0))
    for column in (LABEL, *(column for column, _ in found.values())):
        if column not in heads:
            raise InputError(path, "row 1", f"the column {column} is missing")
    inches, pounds = "deflection_in" in heads, "force_lb" in heads
    if control != "wheel" and inches != pounds:
        problem = f"mixes units: {found['deflection'][0]} with {found['force'][0]}"
        raise InputError(path, "row 1", f"{problem}; give inches and pounds, or metres and newtons")
    if "v2_V" in heads:
        found["v2"] = ("v2_V", 1.0)
    return found


def _assembled(
    path: Path, rows: list[tuple[int, dict[str, str]]], units: dict[str, tuple[str, float]]
) -> Readings:
    taken: list[tuple[int, str, tuple[float, ...]]] = []
    nulls: list[tuple[int, float, float, float]] = []
    seen: dict[tuple[str, ...], int] = {}
    for number, cells in rows:
        null = "v2" in units and cells["v2_V"] != ""
        loose = ("deflection", "force") if null else ()
        value = {
            quantity: _number(path, number, column, cells[column]) * factor
            for quantity, (column, factor) in units.items()
            if cells[column] or (quantity not in loose and quantity != "v2")
        }
        same = seen.setdefault(tuple(cells.values()), number)
        if same != number:
            problem = f"is the same as row {same}; no two readings are, take one out"
            raise InputError(path, f"row {number}", problem)
        if null:
            if value["v2"] == 0.0 or value["v3"] == 0.0:
                problem = "a null at 0 V tells nothing of S2; hold the control off neutral"
                raise InputError(path, f"row {number}", problem)
            nulls.append((number, value["v1"], value["v2"], value["v3"]))
        if "deflection" in value and "force" in value:
            if not cells[LABEL]:
                raise InputError(path, f"row {number}: {LABEL}", "is empty; name the gradient set")
            four = (value["deflection"], value["force"], value["v1"], value["v3"])
            taken.append((number, cells[LABEL], four))
        elif "deflection" in value or "force" in value:
            raise InputError(path, f"row {number}", "has a deflection or a force without the other")
    deflection, force, v1, v3 = np.array([four for *_, four in taken], float).reshape(-1, 4).T
    null_v1, null_v2, null_v3 = np.array([volts for _, *volts in nulls], float).reshape(-1, 3).T
    return Readings(
        row=np.array([number for number, *_ in taken], np.int64),
        label=tuple(label for _, label, _ in taken),
        deflection=deflection,
        force=force,
        v1=v1,
        v3=v3,
        null_row=np.array([number for number, *_ in nulls], np.int64),
        null_v1=null_v1,
        null_v2=null_v2,
        null_v3=null_v3,
    )


def _number(path: Path, row: int, column: str, cell: str) -> float:
    place = f"row {row}: {column}"
    if not cell:
        raise InputError(path, place, "is empty; a reading has no gaps")
    try:
        number = float(cell)
    except ValueError:
        shown = cell if len(cell) <= 40 else cell[:37] + "..."
        hint = "; write it with a point" if "," in cell else ""
        raise InputError(path, place, f"{shown!r} is no number{hint}") from None
    if not math.isfinite(number) or abs(number) > LARGEST:
        raise InputError(path, place, f"{cell[:40]!r} is no finite number")
    return number


def write_readings(path: Path, readings: Readings, control: str, inches: bool = False) -> None:
    """Write readings, and those of the null below them, as `read_readings` takes them."""
    if control == "wheel":
        columns = ("deflection_deg", "force_lb" if inches else "force_N")
    else:
        columns = ("deflection_in", "force_lb") if inches else ("deflection_m", "force_N")
    one, two = {**LENGTHS, **ANGLES}[columns[0]], FORCES[columns[1]]
    lines = [f"{LABEL},{columns[0]},{columns[1]},v1_V,v3_V,v2_V"]
    for label, *numbers in zip(
        readings.label,
        readings.deflection / one,
        readings.force / two,
        readings.v1,
        readings.v3,
        strict=True,
    ):
        lines.append(",".join([label, *(_shown(x) for x in numbers), ""]))
    for v3, v2, v1 in zip(readings.null_v3, readings.null_v2, readings.null_v1, strict=True):
        lines.append(f"null,,,{_shown(v1)},{_shown(v3)},{_shown(v2)}")
    write_text(path, "\n".join(lines) + "\n")


def _shown(number: float) -> str:
    """Return a number as short as it reads back the same, tails of arithmetic cut off."""
    return repr(float(f"{number:.15g}"))
