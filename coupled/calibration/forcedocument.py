"""The force document of a rig: the documentation and fit of each control, and the issue."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from coupled.calibration.aircraftdata import read_aircraft_data
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.documentation import (
    Documentation,
    controls_of,
    document,
    surface_travels,
)
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.plan import stations
from coupled.calibration.qualification import Issue
from coupled.calibration.readingsfile import read_readings
from coupled.calibration.result import CalibrationResult
from coupled.errors import InputError, nearest, shown
from coupled.files import sha256
from coupled.record.channels import ControlName
from coupled.results import TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

Progress = Callable[[str, int, int], None]
Fits = Mapping[ControlName, tuple[CalibrationResult, str] | None]


@dataclass(frozen=True, repr=False)
class ForceDocument(TableResult):
    """The force document of a rig: a `Documentation` per control, with the fit of its readings."""

    rig: Rig
    controls: tuple[Documentation, ...]
    fits: Fits
    issue: Issue

    @property
    def passed(self) -> bool:
        """Whether every check of 14 CFR Part 60 is within its tolerance."""
        return all(check.passed for found in self.controls for check in found.checks)

    def __repr__(self) -> str:
        checks = [check for found in self.controls for check in found.checks]
        within = sum(check.passed for check in checks)
        return f"ForceDocument({self.rig.name}: {within} of {len(checks)} checks within tolerance)"

    def as_dict(self) -> dict[str, list[dict[str, Any]]]:
        """Return the checks of each control as JSON data."""
        return {found.control: [c.as_dict() for c in found.checks] for found in self.controls}

    def to_polars(self) -> pl.DataFrame:
        """Return the checks, one row each, with units."""
        table = self.as_dict()
        return frame_of([{"control": name} | row for name, rows in table.items() for row in rows])


def document_rig(
    rig: Rig,
    control: ControlName | None = None,
    readings: Path | None = None,
    specified: Rig | None = None,
    aircraft: Path | None = None,
    date: str = "",
    revision: str = "",
    progress: Progress | None = None,
) -> ForceDocument:
    """Return the force document of a rig, for one control or all.

    `readings` are of the first control (default: a virtual bench), `specified` is a rig with the
    specified values, `aircraft` measured forces of the aircraft. Raises InputError if the rig does
    not have the control, or a file cannot be used.
    """
    file = Path(rig.place)
    rig.check_controlled(file)
    if control is not None and control not in rig.controls:
        raise InputError(file, "control", f"no {control!r}; {nearest(control, rig.controls)}")
    chosen = controls_of(rig) if control is None else [control]
    travels = surface_travels(rig, file)
    own, read = specified or rig, None
    if aircraft is not None:
        if chosen[0] not in own.controls:
            raise InputError(own.name, "controls", f"the rig has no {chosen[0]}")
        first = own.controls[chosen[0]]
        read = read_aircraft_data(aircraft, chosen[0], first, travels.get(chosen[0]))
    fits = {name: _fit(rig, name, readings, chosen) for name in chosen}
    found = []
    for name in chosen:
        known = read if name == chosen[0] else None
        found.append(document(rig, name, travels.get(name), progress, specified, known))
    reference = "what the rig's own file specifies"
    if specified is not None:
        source = specified.file
        reference = f"what {shown(source.name) if source else specified.name} specifies"
    if aircraft is not None:
        reference += f"; static checks of the first control: {shown(aircraft.name)}, the aircraft's"
    return ForceDocument(rig, tuple(found), fits, _issue(rig, reference, date, revision))


def _issue(rig: Rig, reference: str, date: str, revision: str) -> Issue:
    """Return the data of the cover, for the current rig, which may differ from its file."""
    text, file = rig.to_toml(), rig.file
    digest = hashlib.sha256(text.encode()).hexdigest()
    name = shown(file.name) if file is not None else f"{rig.name}.toml"
    if file is not None and file.is_file():
        if file.read_text(encoding="utf-8-sig") == text:  # line ends may differ
            digest = sha256(file)
        else:
            name += ", changed"
    return Issue(name, digest, reference, date, revision)


def _fit(
    rig: Rig, control: ControlName, readings: Path | None, chosen: Sequence[ControlName]
) -> tuple[CalibrationResult, str] | None:
    """Return the fit of a control for its figure, and the source of its readings.

    None for a control of one gradient, and if readings are given for all but the first.
    """
    data, tools = rig.controls[control], usual_instruments(control)
    if readings is not None:
        if control != chosen[0]:
            return None
        read = read_readings(readings, control)
        return calibrate_control(read, data, control, tools, readings), shown(readings.name)
    try:
        grid = stations(rig, control, 5, 5)
    except InputError:
        return None
    made = take_readings(CalibrationBench(rig, control, grid, tools), 0)
    found = calibrate_control(made, data, control, tools, rig.name)
    return found, "a virtual bench's readings"
