"""A control's force documentation: its sweeps and releases, and the checks on them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from coupled.calibration.aircraftdata import AircraftData
from coupled.calibration.checks import (
    ControlCheck,
    dynamic_checks,
    legs,
    static_checks,
    surface_checks,
)
from coupled.calibration.specification import SweepLeg, specified_legs, specified_rig
from coupled.calibration.sweeps import Release, feel_pressures, release, sweep
from coupled.flight.directcontrols import check_direct_controls
from coupled.flight.manoeuvre import configure
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.standalone import History

Progress = Callable[[str, int, int], None]
SIDES = {"positive": 1.0, "negative": -1.0}


@dataclass(frozen=True)
class ReleasePair:
    """A release of the rig as filed, and of the specified rig."""

    felt: Release
    specified: Release


@dataclass(frozen=True)
class FeelCondition:
    """One q̄: the specification, and sweeps without and with compensation and of the rig as filed.

    `releases` are the releases by side.
    """

    pressure_Pa: float
    specified: tuple[SweepLeg, ...]
    uncompensated: History
    compensated: History
    felt: History
    releases: Mapping[str, ReleasePair]


@dataclass(frozen=True)
class Documentation:
    """The documentation of one control; `surface_rad` is its surface's travel, None on a bench."""

    rig: Rig
    control: ControlName
    conditions: tuple[FeelCondition, ...]
    checks: tuple[ControlCheck, ...]
    surface_rad: float | None


def surface_travels(rig: Rig, file: Path) -> dict[str, float]:
    """Return each surface's travel in rad by its control, found in flight; empty for a bench."""
    if rig.flight is None:
        return {}
    frame_s, controls = 1.0 / rig.frame_rate, list(rig.controls)
    travels = check_direct_controls(rig.flight, frame_s, controls, [aircraft_folder()], file)
    return {control: abs(travel) for control, travel in travels.items()}


def document(
    rig: Rig,
    control: ControlName,
    surface_rad: float | None,
    progress: Progress | None = None,
    specification: Rig | None = None,
    aircraft: AircraftData | None = None,
) -> Documentation:
    """Return a control's documentation at the least, middle and greatest gradient specified.

    `specification` is a rig that gives the specification instead of this one: its schedule,
    breakout, friction, mass and damping. `aircraft` are forces measured on the aircraft, then the
    reference of the static checks, at its dynamic pressures. Raises InputError if the
    specification lacks the control.
    """
    specified = specified_rig((specification or rig).only(control))
    read = _legs_by_pressure(specified, control, aircraft)
    pressures = list(read)
    conditions, checks = [], []
    for i, pressure in enumerate(pressures):
        if progress is not None:
            progress(f"{control}, q̄ = {pressure:.0f} Pa", i, len(pressures))
        condition = FeelCondition(
            pressure,
            read[pressure],
            sweep(configure(rig, "uncompensated"), control, pressure),
            sweep(configure(rig, "compensated"), control, pressure),
            sweep(rig, control, pressure),
            _release_pairs(rig, control, pressure, specified),
        )
        conditions.append(condition)
        checks += _checks(condition, control, specified.controls[control], surface_rad)
    return Documentation(rig, control, tuple(conditions), tuple(checks), surface_rad)


def check_feel(
    rig: Rig,
    control: ControlName,
    surface_rad: float | None = None,
    specification: Rig | None = None,
    aircraft: AircraftData | None = None,
) -> tuple[ControlCheck, ...]:
    """Return the checks of a control's documentation, without the data of its figures."""
    specified = specified_rig((specification or rig).only(control))
    checks = []
    for pressure, legs_there in _legs_by_pressure(specified, control, aircraft).items():
        felt = sweep(rig, control, pressure)
        pair = _release_pairs(rig, control, pressure, specified)
        condition = FeelCondition(pressure, legs_there, felt, felt, felt, pair)
        checks += _checks(condition, control, specified.controls[control], surface_rad)
    return tuple(checks)


def _legs_by_pressure(
    specified: Rig, control: ControlName, aircraft: AircraftData | None
) -> Mapping[float, tuple[SweepLeg, ...]]:
    """Return the reference of a slow sweep at each q̄ in Pa: the aircraft's or the specified."""
    if aircraft is not None:
        return aircraft.legs
    return {
        pressure: specified_legs(specified, control, pressure)
        for pressure in feel_pressures(specified, control)
    }


def _release_pairs(
    rig: Rig, control: ControlName, pressure: float, specified: Rig
) -> Mapping[str, ReleasePair]:
    return {
        name: ReleasePair(
            release(rig, control, pressure, side), release(specified, control, pressure, side)
        )
        for name, side in SIDES.items()
    }


def _checks(
    condition: FeelCondition, control: ControlName, data: Control, surface_rad: float | None
) -> list[ControlCheck]:
    pressure, felt = condition.pressure_Pa, legs(condition.felt)
    checks = static_checks(data, control, pressure, felt, condition.specified)
    if surface_rad is not None:
        checks += surface_checks(data, surface_rad, pressure, felt, read=condition.specified)
    for side, pair in condition.releases.items():
        checks += dynamic_checks(pressure, side, pair.felt, pair.specified)
    return checks


def controls_of(rig: Rig) -> list[ControlName]:
    """Return a rig's controls in the usual order."""
    return [name for name in CONTROL_NAMES if name in rig.controls]
