"""The columns of readings: what each is, in which unit, and which of them go together."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from coupled.calibration.readings import Signal
from coupled.errors import InputError, nearest
from coupled.record.channels import CONTROL_NAMES
from coupled.units import POUND_N, DEGREE_rad, INCH_m

LABEL, APPROACH, REMARK = "gradient_set", "approach", "remark"
LENGTHS = {"deflection_m": 1.0, "deflection_mm": 1e-3, "deflection_in": INCH_m}
ANGLES = {"deflection_rad": 1.0, "deflection_deg": DEGREE_rad}
ON = "on "  # before the name of another control that a force is held on
SIGNALS = tuple(f"{name}_{unit}" for unit in ("V", "counts") for name in ("v1", "v2", "v3"))
FORCES = {"force_N": 1.0, "force_lb": POUND_N}


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
    """Return {quantity: (column, 1)} of v1, and of v2 and v3 where they are there."""
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
    """Return the column of a second look, after the voltmeter's."""
    return column.replace("_", "_after_", 1)


def on(control: str, column: str) -> str:
    """Return the column of a force on another control."""
    return column.replace("force", f"force_on_{control}")
