"""Readings files: a CSV typed by a person, one row for each reading, units in the columns' names.

    gradient_set, deflection_…, force_…, v1_V, v3_V    and, for the null of eq. (14), v2_V

If ruler and scale were read again after the voltmeter, there are deflection_after_… and
force_after_… as well, and the means count. A row with v2_V was noted without the multiplier; v2 is
the supply's voltage that restored v1, `approach` the side of the approach: out, or in, from
beyond. Its deflection and force may be empty. Forces held on other controls of the same structure
are further columns, force_on_wheel_N and the like, 0 if not held. Rows are numbered as in a text
editor, the heads being row 1.

S₁ and K need no v3, whose column may be left out. v1_counts and v3_counts are a converter's.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.readings import Readings, Signal, readings_of
from coupled.errors import InputError, collected, nearest, together
from coupled.files import read_text, write_text
from coupled.record.channels import CONTROL_NAMES
from coupled.schema import LARGEST, SMALLEST
from coupled.units import POUND_N, DEGREE_rad, INCH_m

Floats = NDArray[np.float64]
MOST_ROWS = 10_000
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(nan|inf)", re.I)
LABEL, APPROACH, REMARK = "gradient_set", "approach", "remark"
LENGTHS = {"deflection_m": 1.0, "deflection_mm": 1e-3, "deflection_in": INCH_m}
ANGLES = {"deflection_rad": 1.0, "deflection_deg": DEGREE_rad}
ON = "on "  # before the name of another control that a force is held on
SIGNALS = tuple(f"{name}_{unit}" for unit in ("V", "counts") for name in ("v1", "v2", "v3"))
FORCES = {"force_N": 1.0, "force_lb": POUND_N}
SIDES = {"out": 1.0, "in": -1.0}


def read_readings(path: Path, control: str) -> Readings:
    """Return the readings of a file, for a control's kind of deflection."""
    lines = rows_of(path)
    if not lines:
        raise InputError(path, "", "holds nothing; its first row should name the columns")
    (_, heads), *rows = lines
    units = units_of(path, heads, control)
    if not rows:
        raise InputError(path, "", "holds no readings below its column names")
    if len(rows) > MOST_ROWS:
        raise InputError(path, "", f"holds more than {MOST_ROWS} rows")
    parsed, faults = [], list[InputError]()
    for number, cells in rows:
        if not any(cells):
            faults.append(InputError(path, f"row {number}", "is empty; take it out"))
        elif len(cells) != len(heads):
            problem = f"has {len(cells)} cells, the columns are {len(heads)}"
            faults.append(InputError(path, f"row {number}", problem))
        else:
            parsed.append((number, dict(zip(heads, cells, strict=True))))
    read = _read_rows(path, parsed, units, faults)
    if faults:
        raise together(faults)
    others = [quantity for quantity in units if quantity.startswith(ON)]
    return _assembled(read, others, signal_of(path, heads))


def rows_of(path: Path) -> list[tuple[int, list[str]]]:
    """Return (row number, stripped cells) of the file's rows, without blank ones at its end."""
    text = read_text(path, "save it as CSV in UTF-8")
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


@dataclass(frozen=True)
class _Row:
    """A row read: its gradient set, {quantity: SI value}, and the side of a null."""

    number: int
    label: str
    value: Mapping[str, float]
    side: float | None


def _read_rows(
    path: Path,
    rows: list[tuple[int, dict[str, str]]],
    units: dict[str, tuple[str, float]],
    faults: list[InputError],
) -> list[_Row]:
    """Return the rows without a fault; the faults of the others are added to `faults`."""
    read = []
    seen: dict[tuple[str, ...], int] = {}
    for number, cells in rows:
        same = seen.setdefault(tuple(cells.values()), number)
        with collected(faults):
            if same != number:
                problem = f"is the same as row {same}; no two readings are identical, remove one"
                raise InputError(path, f"row {number}", problem)
            read.append(_read_row(path, number, cells, units, faults))
    return read


def _read_row(
    path: Path,
    number: int,
    cells: dict[str, str],
    units: dict[str, tuple[str, float]],
    faults: list[InputError],
) -> _Row:
    null = "v2" in units and cells[units["v2"][0]] != ""
    may_lack = {"v2", "deflection after", "force after"}
    if null:
        may_lack |= {"deflection", "force", *(name for name in units if name.startswith(ON))}
    value: dict[str, float] = {}
    before = len(faults)
    for quantity, (column, factor) in units.items():
        if cells[column] or quantity not in may_lack:
            with collected(faults):
                value[quantity] = number_in(path, number, column, cells[column]) * factor
    whole = len(faults) == before
    if null and whole and 0.0 in (value["v2"], value["v3"]):
        problem = "a null at 0 V does not determine S2; hold the control off neutral"
        raise InputError(path, f"row {number}", problem)
    side = _side(path, number, cells.get(APPROACH, "")) if null else None
    if "deflection" in value and "force" in value:
        if not cells[LABEL]:
            raise InputError(path, f"row {number}: {LABEL}", "is empty; name the gradient set")
    elif whole and any(quantity.split()[0] in ("deflection", "force") for quantity in value):
        raise InputError(path, f"row {number}", "has a deflection or a force without the other")
    return _Row(number, cells[LABEL], value, side)


def _assembled(rows: list[_Row], others: list[str], signal: Signal) -> Readings:
    taken: list[tuple[int, str, tuple[float, ...]]] = []
    nulls: list[tuple[int, tuple[float, ...]]] = []
    for row in rows:
        value = row.value
        if row.side is not None:
            nulls.append((row.number, (value["v1"], value["v2"], value["v3"], row.side)))
        if "deflection" in value and "force" in value:
            means = [_mean(value, quantity) for quantity in ("deflection", "force")]
            (delta, rise), (force, force_rise) = means
            six = (delta, force, value["v1"], value.get("v3", math.nan), rise, force_rise)
            held = tuple(value.get(quantity, 0.0) for quantity in others)
            taken.append((row.number, row.label, six + held))
    columns = np.array([one for *_, one in taken], float).reshape(-1, 6 + len(others)).T
    crossed = {quantity[len(ON) :]: columns[6 + k] for k, quantity in enumerate(others)}
    return readings_of(
        [number for number, *_ in taken],
        [label for _, label, _ in taken],
        columns[:6],
        [number for number, _ in nulls],
        np.array([four for _, four in nulls], float).reshape(-1, 4).T,
        crossed,
        signal,
    )


def _mean(value: Mapping[str, float], quantity: str) -> tuple[float, float]:
    """Return the mean of an instrument's readings, and the second less the first."""
    first, second = value[quantity], value.get(f"{quantity} after")
    return (first, math.nan) if second is None else (0.5 * (first + second), second - first)


def _side(path: Path, row: int, word: str) -> float:
    """Return the side of a null's approach; outward by default."""
    if word not in ("", *SIDES):
        raise InputError(path, f"row {row}: {APPROACH}", f"{word!r} is neither out nor in")
    return SIDES.get(word, 1.0)


def number_in(path: Path, row: int, column: str, cell: str) -> float:
    """Return the number of a cell; raises InputError if it is not one."""
    place = f"row {row}: {column}"
    if not cell:
        raise InputError(path, place, "is empty; a reading has no gaps")
    if not NUMBER.fullmatch(cell):
        shown = cell if len(cell) <= 40 else cell[:37] + "..."
        hint = "; write it with a point" if "," in cell else ""
        raise InputError(path, place, f"{shown!r} is no number{hint}")
    number = float(cell)
    if not math.isfinite(number):
        raise InputError(path, place, f"{cell[:40]!r} is no finite number")
    if abs(number) > LARGEST:
        raise InputError(path, place, f"{cell[:40]!r} is larger than any real one")
    if 0.0 < abs(number) < SMALLEST:
        raise InputError(path, place, f"{cell[:40]!r} is smaller than any real one; give 0")
    return number


def write_readings(path: Path, readings: Readings, control: str, inches: bool = False) -> None:
    """Write readings, and those of the null below them, in the format of `read_readings`."""
    if control == "wheel":
        columns = ("deflection_deg", "force_lb" if inches else "force_N")
    else:
        columns = ("deflection_in", "force_lb") if inches else ("deflection_m", "force_N")
    one, two = {**LENGTHS, **ANGLES}[columns[0]], FORCES[columns[1]]
    twice = not np.all(np.isnan(readings.deflection_rise))
    heads = [LABEL, *columns, "v1_V", "v3_V"]
    heads += [after(columns[1]), after(columns[0])] if twice else []
    heads += [on(name, columns[1]) for name in readings.other_names]
    lines = [",".join([*heads, "v2_V", APPROACH])]
    half = [np.nan_to_num(0.5 * rise) for rise in (readings.deflection_rise, readings.force_rise)]
    numbers = [
        (readings.deflection - half[0]) / one,
        (readings.force - half[1]) / two,
        readings.v1,
        readings.v3,
    ]
    if twice:
        numbers += [(readings.force + half[1]) / two, (readings.deflection + half[0]) / one]
    numbers += [readings.others[:, k] / two for k in range(len(readings.other_names))]
    for label, *row in zip(readings.label, *numbers, strict=True):
        lines.append(",".join([label, *(_shown(x) for x in row), "", ""]))
    gap = (",," if twice else "") + "," * len(readings.other_names)
    words = {side: word for word, side in SIDES.items()}
    null = (readings.null_v3, readings.null_v2, readings.null_v1, readings.null_side)
    for v3, v2, v1, side in zip(*null, strict=True):
        lines.append(f"null,,,{_shown(v1)},{_shown(v3)},{gap}{_shown(v2)},{words[side]}")
    write_text(path, "\n".join(lines) + "\n")


def _shown(number: float) -> str:
    """Return the shortest text of a number in 13 digits."""
    return repr(float(f"{number:.13g}"))


def units_of(path: Path, heads: list[str], control: str) -> dict[str, tuple[str, float]]:
    """Return {quantity: (column, factor to SI)} once the columns are known and of one system."""
    ours, other = (ANGLES, LENGTHS) if control == "wheel" else (LENGTHS, ANGLES)
    known = [LABEL, APPROACH, REMARK, *ours, *FORCES, *SIGNALS]
    known += [after(head) for head in [*ours, *FORCES]]
    crossed = {on(name, head): name for name in CONTROL_NAMES if name != control for head in FORCES}
    known += crossed
    for head in heads:
        if heads.count(head) > 1:
            raise InputError(path, f"row 1: {head}", "duplicate column")
        if head in other or head in [after(name) for name in other]:
            raise InputError(path, f"row 1: {head}", f"a {control} is read in {', '.join(ours)}")
        if head not in known:
            hint = (
                "columns are parted by commas"
                if ";" in head or "\t" in head
                else nearest(head, known)
            )
            raise InputError(path, f"row 1: {head}", f"is no column of readings; {hint}")
    found = _voltages(path, heads)
    for quantity, choices in (("deflection", ours), ("force", FORCES)):
        present = [head for head in heads if head in choices]
        if len(present) > 1:
            problem = f"mixes units: {' and '.join(present)}; give one of them"
            raise InputError(path, "row 1", problem)
        column = present[0] if present else f"{quantity} in {' or '.join(choices)}"
        found[quantity] = (column, choices.get(column, 1.0))
        again = [head for head in heads if head in [after(name) for name in choices]]
        if again and again != [after(column)]:
            problem = f"mixes units: {column} with {', '.join(again)}; give one unit"
            raise InputError(path, "row 1", problem)
        if again:
            found[f"{quantity} after"] = (again[0], found[quantity][1])
    for column in (LABEL, *(column for column, _ in found.values())):
        if column not in heads:
            raise InputError(path, "row 1", f"the column {column} is missing")
    inches, pounds = "deflection_in" in heads, "force_lb" in heads
    if control != "wheel" and inches != pounds:
        problem = f"mixes units: {found['deflection'][0]} with {found['force'][0]}"
        raise InputError(path, "row 1", f"{problem}; give inches and pounds, or metres and newtons")
    found |= _crossed(path, heads, crossed)
    return found


def _voltages(path: Path, heads: list[str]) -> dict[str, tuple[str, float]]:
    """Return {quantity: (column, 1)} of v1, and of v2 and v3 if present."""
    signal = signal_of(path, heads)
    there = {name: f"{name}_{signal}" for name in ("v1", "v3", "v2")}
    if there["v2"] in heads and there["v3"] not in heads:
        problem = f"{there['v2']} is of the null of S2, which needs {there['v3']} as well"
        raise InputError(path, "row 1", problem)
    return {n: (column, 1.0) for n, column in there.items() if n == "v1" or column in heads}


def signal_of(path: Path, heads: list[str]) -> Signal:
    """Return the unit of the voltages: volts, or counts of a converter. Raises for both."""
    counts = [head for head in heads if head in SIGNALS and head.endswith("_counts")]
    volts = [head for head in heads if head in SIGNALS and head.endswith("_V")]
    if counts and volts:
        raise InputError(path, "row 1", f"mixes units: {volts[0]} with {counts[0]}; give one unit")
    return "counts" if counts else "V"


def _crossed(
    path: Path, heads: list[str], crossed: Mapping[str, str]
) -> dict[str, tuple[str, float]]:
    """Return {quantity: (column, factor to SI)} of the forces on other controls."""
    found: dict[str, tuple[str, float]] = {}
    for head in [head for head in heads if head in crossed]:
        quantity = f"{ON}{crossed[head]}"
        if quantity in found:
            problem = f"mixes units: {found[quantity][0]} and {head}; give one of them"
            raise InputError(path, "row 1", problem)
        found[quantity] = (head, FORCES[head.replace(f"_on_{crossed[head]}", "")])
    return found


def after(column: str) -> str:
    """Return the column of a second reading, after the voltmeter's."""
    return column.replace("_", "_after_", 1)


def on(control: str, column: str) -> str:
    """Return the column of a force on another control."""
    return column.replace("force", f"force_on_{control}")
