"""A control's force documentation: its sweeps and releases, and the checks on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from coupled.calibration.checks import ControlCheck, dynamic_checks, static_checks, surface_checks
from coupled.calibration.sweeps import Release, feel_pressures, release, sweep
from coupled.flight.direct import check_direct_controls
from coupled.flight.manoeuvre import configure
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.resources import aircraft_folder
from coupled.rig.rig import Rig
from coupled.rig.standalone import History

Progress = Callable[[str, int, int], None]
SIDES = {"positive": 1.0, "negative": -1.0}


@dataclass(frozen=True)
class Condition:
    """One q̄: sweeps of the rig as specified (rigid), without and with compensation, and as it is.

    `let_go` are the releases as it is and as specified, by side.
    """

    pressure_Pa: float
    specified: History
    uncompensated: History
    compensated: History
    felt: History
    let_go: dict[str, tuple[Release, Release]]


@dataclass(frozen=True)
class Documentation:
    """What documents one control; `surface_rad` is its surface's travel, None on a bench."""

    rig: Rig
    control: ControlName
    conditions: tuple[Condition, ...]
    checks: tuple[ControlCheck, ...]
    surface_rad: float | None


def surface_travels(rig: Rig, file: Path) -> dict[str, float]:
    """Return each surface's travel in rad by its control, found by flying it; none on a bench."""
    if rig.flight is None:
        return {}
    frame_s, controls = 1.0 / rig.frame_rate, list(rig.controls)
    travels = check_direct_controls(rig.flight, frame_s, controls, [aircraft_folder()], file)
    return {control: abs(travel) for control, travel in travels.items()}


def document(
    rig: Rig, control: ControlName, surface_rad: float | None, progress: Progress | None = None
) -> Documentation:
    """Return a control's documentation at the least, middle and greatest gradient."""
    travel = rig.controls[control].travel
    pressures = feel_pressures(rig, control)
    conditions, checks = [], []
    for i, pressure in enumerate(pressures):
        if progress is not None:
            progress(f"{control}, q̄ = {pressure:.0f} Pa", i, len(pressures))
        condition = _condition(rig, control, pressure)
        conditions.append(condition)
        felt, specified = condition.felt, condition.specified
        checks += static_checks(rig, control, pressure, felt, specified)
        if surface_rad is not None:
            checks += surface_checks(control, travel, surface_rad, pressure, felt)
        for side, (now, wanted) in condition.let_go.items():
            checks += dynamic_checks(pressure, side, now, wanted)
    return Documentation(rig, control, tuple(conditions), tuple(checks), surface_rad)


def _condition(rig: Rig, control: ControlName, pressure: float) -> Condition:
    rigid = configure(rig, "rigid")
    return Condition(
        pressure,
        sweep(rigid, control, pressure),
        sweep(configure(rig, "uncompensated"), control, pressure),
        sweep(configure(rig, "compensated"), control, pressure),
        sweep(rig, control, pressure),
        {
            name: (release(rig, control, pressure, side), release(rigid, control, pressure, side))
            for name, side in SIDES.items()
        },
    )


def controls_of(rig: Rig) -> list[ControlName]:
    """Return a rig's controls in the usual order."""
    return [name for name in CONTROL_NAMES if name in rig.controls]
