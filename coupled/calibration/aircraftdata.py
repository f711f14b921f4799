"""Forces measured on the aircraft itself: the reference of the static checks.

A CSV typed by a person, one row for each reading of the aircraft's control, units in the names of
the columns:

    deflection_…, force_…   and, if noted,   dynamic_pressure_…, direction, surface_…

`direction` is `out` from neutral or `back` to it. Without it, rows in the order of a sweep out and
back have the direction of the motion. Other rows are the mean force of both directions, and the
friction is that of the specification. Nothing is interpolated between rows: a
check uses the deflections, sides and directions that were read.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.readingsfile import ANGLES, FORCES, LENGTHS, number_in, rows_of
from coupled.calibration.specification import LEGS, SweepLeg
from coupled.errors import InputError, nearest
from coupled.record.channels import ControlName
from coupled.rig.parameters import Control
from coupled.units import DEGREE_rad, PSF_Pa

Floats = NDArray[np.float64]
PRESSURES = {
    "dynamic_pressure_Pa": 1.0,
    "dynamic_pressure_kPa": 1e3,
    "dynamic_pressure_psf": PSF_Pa,
}
SURFACES = {"surface_deg": DEGREE_rad, "surface_rad": 1.0}
DIRECTION, REMARK = "direction", "remark"
DIRECTIONS = {"out": 1.0, "back": -1.0}
MOST_PRESSURES = 8
TURNS = 0.02  # of the range of deflections: a smaller reversal is noise of a reading
BEYOND = 1.02  # of the travel: the largest deflection of a reading
NOTHING = SweepLeg(np.empty(0), np.empty(0), np.empty(0), read=True)


@dataclass(frozen=True)
class Row:
    """One reading, SI; `direction` is 0 for the mean of both, `surface` may be NaN."""

    number: int
    pressure: float
    deflection: float
    force: float
    direction: float
    surface: float


@dataclass(frozen=True)
class AircraftData:
    """The readings of one control: four legs, in the order of `LEGS`, by rising q̄ in Pa.

    A leg's `surface` is the absolute share of the surface's travel, NaN where it was not read.
    """

    legs: Mapping[float, tuple[SweepLeg, ...]]


def read_aircraft_data(
    path: Path, control: ControlName, specified: Control, surface_rad: float | None = None
) -> AircraftData:
    """Return a file's readings of a control; without directions the friction is as `specified`.

    `surface_rad` is the surface's travel for full travel of the control. Raises InputError.
    """
    rows, found = read_rows(path, control, surface_rad), {}
    for pressure in sorted({row.pressure for row in rows}):
        here = _directed([row for row in rows if row.pressure == pressure])
        found[pressure] = _legs(path, here, specified, surface_rad or np.nan)
    if len(found) > MOST_PRESSURES:
        problem = f"is of {len(found)} dynamic pressures; give {MOST_PRESSURES} at most"
        raise InputError(path, "", problem)
    return AircraftData(found)


def read_rows(path: Path, control: ControlName, surface_rad: float | None) -> list[Row]:
    """Return a file's readings in their order; `surface_rad` is as for `read_aircraft_data`."""
    lines = rows_of(path)
    if len(lines) < 2:
        raise InputError(path, "", "holds no readings; its first row names the columns")
    (_, heads), *below = lines
    units = _units(path, heads, control, surface_rad)
    rows = []
    for number, cells in below:
        if len(cells) != len(heads):
            problem = f"has {len(cells)} cells, the columns are {len(heads)}"
            raise InputError(path, f"row {number}", problem)
        rows.append(_row(path, number, dict(zip(heads, cells, strict=True)), units))
    return rows


def _units(
    path: Path, heads: list[str], control: ControlName, surface_rad: float | None
) -> dict[str, tuple[str, float]]:
    """Return {quantity: (column, factor to SI)}."""
    ours = ANGLES if control == "wheel" else LENGTHS
    choices = {"deflection": ours, "force": FORCES, "pressure": PRESSURES, "surface": SURFACES}
    known = [DIRECTION, REMARK, *(head for each in choices.values() for head in each)]
    for head in heads:
        if heads.count(head) > 1:
            raise InputError(path, f"row 1: {head}", "duplicate column")
        if head not in known:
            problem = f"is no column of an aircraft's {control}; {nearest(head, known)}"
            raise InputError(path, f"row 1: {head}", problem)
    found = {}
    for quantity, factors in choices.items():
        present = [head for head in heads if head in factors]
        if len(present) > 1:
            problem = f"mixes units: {' and '.join(present)}; give one of them"
            raise InputError(path, "row 1", problem)
        if present:
            found[quantity] = (present[0], factors[present[0]])
        elif quantity in ("deflection", "force"):
            problem = f"the column {quantity} in {' or '.join(factors)} is missing"
            raise InputError(path, "row 1", problem)
    if "surface" in found and surface_rad is None:
        problem = "cannot be judged: the rig has no aircraft whose surface it is"
        raise InputError(path, f"row 1: {found['surface'][0]}", problem)
    return found


def _row(
    path: Path, number: int, cells: dict[str, str], units: dict[str, tuple[str, float]]
) -> Row:
    value = {
        quantity: number_in(path, number, column, cells[column]) * factor
        for quantity, (column, factor) in units.items()
        if quantity != "surface" or cells[column]
    }
    word = cells.get(DIRECTION, "")
    if word not in ("", *DIRECTIONS):
        problem = f"{word!r} is neither out nor back"
        raise InputError(path, f"row {number}: {DIRECTION}", problem)
    pressure = value.get("pressure", 0.0)
    if pressure < 0.0:
        raise InputError(path, f"row {number}: {units['pressure'][0]}", "cannot be negative")
    surface = abs(value.get("surface", np.nan))
    way = DIRECTIONS.get(word, 0.0)
    return Row(number, pressure, value["deflection"], value["force"], way, surface)


def _directed(rows: list[Row]) -> list[Row]:
    """Return the rows of a sweep with their directions; other rows as they are.

    Without directions it is a sweep if a side has readings on the way out and on the way back.
    Those at turning points have no direction, and are left out.
    """
    if any(row.direction for row in rows):
        return rows
    deflection = np.array([row.deflection for row in rows])
    outward = motion_of(deflection) * np.sign(deflection)
    sides = [outward[deflection * side > 0.0] for side in (1.0, -1.0)]
    ways = [min(np.count_nonzero(ours > 0.0), np.count_nonzero(ours < 0.0)) for ours in sides]
    if max(ways) < 2:
        return rows
    return [replace(row, direction=w) for row, w in zip(rows, outward.tolist(), strict=True) if w]


def motion_of(deflection: Floats) -> Floats:
    """Return the direction of the motion at each reading, 0 until it has left a turning point."""
    least = TURNS * float(np.ptp(deflection))
    turns, extreme, way = [0], 0, 0.0
    for k, value in enumerate(deflection):
        away = value - deflection[extreme]
        if way * away > 0.0 or (way == 0.0 and abs(away) > least):
            way = way or float(np.sign(away))
            extreme = k
        elif way * away < -least:
            turns.append(extreme)
            way, extreme = -way, k
    turns.append(len(deflection) - 1)
    motion = np.zeros(len(deflection))
    for begun, ended in pairwise(turns):
        gone = deflection[begun + 1 : ended] - deflection[begun]
        motion[begun + 1 : ended] = np.where(np.abs(gone) > least, np.sign(gone), 0.0)
    return motion


def _legs(
    path: Path, rows: list[Row], specified: Control, surface_rad: float
) -> tuple[SweepLeg, ...]:
    """Return the four legs of one q̄; legs without readings are empty."""
    legs = []
    for side, motion in LEGS.values():
        on = [row for row in rows if row.deflection * side > 0.0 and row.direction in (0.0, motion)]
        on.sort(key=lambda row: abs(row.deflection))
        if not on:
            legs.append(NOTHING)
            continue
        _check(path, on, specified.travel_to(side))
        rubs = side * motion * specified.loader.friction
        legs.append(
            SweepLeg(
                np.array([row.deflection for row in on]),
                np.array([row.force + (0.0 if row.direction else rubs) for row in on]),
                np.array([row.surface for row in on]) / surface_rad,
                read=True,
            )
        )
    if all(not leg.deflection.size for leg in legs):
        raise InputError(path, f"row {rows[0].number}", "is at neutral, and no other is of its q̄")
    return tuple(legs)


def _check(path: Path, rows: list[Row], travel: float) -> None:
    """Raise InputError for impossible rows; rows are of one leg, by absolute deflection."""
    for before, row in zip([None, *rows[:-1]], rows, strict=True):
        if abs(row.deflection) > BEYOND * travel:
            problem = f"is at {row.deflection:.4g}, beyond the rig's travel of {travel:.4g} there"
            raise InputError(path, f"row {row.number}", problem)
        if before is None:
            continue
        if row.deflection == before.deflection:
            problem = f"is at the place of row {before.number}; give one force for each place"
            raise InputError(path, f"row {row.number}", f"{problem} and direction")
        if bool(row.direction) != bool(before.direction):
            problem = f"names a direction, or none, unlike row {before.number}; do as one"
            raise InputError(path, f"row {row.number}", problem)
