"""Checks of a record before its diagnosis: clock, values, sensors, units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.gap.thresholds import (
    OTHER_RATE,
    OTHER_RIG,
    OTHER_SPEED,
    PIECE,
    SHORT_SWINGS,
    STAMP_JITTER,
    SHORTEST_RECORD_s,
)
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.importing import plausible
from coupled.record.record import Record
from coupled.rig.equations import specified_gradient
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
SPEED = "true_airspeed_m_per_s"
START_ROWS = 12  # chosen: a tenth of a second at 120 Hz, before a pilot has changed the motion


def check_record(
    rig: Rig, record: Record, control: ControlName, file: object, moved: bool = True
) -> None:
    """Check that a record can be of a rig. Raises InputError with the reason if it cannot.

    The channels of the control are checked if it is to be `moved`.
    """
    if rig.controls and control not in rig.controls:
        raise InputError(file, control, f"the rig has no {control}")
    if rig.controls and rig.controls[control].schedule.deflection is not None:
        key = f"controls.{control}.schedule.force_N"
        problem = "is a curve, which a diagnosis does not model; give total_gradient_N_per_"
        raise InputError(rig.name, key, f"{problem}{unit_of(control)}")
    time = record.time_s
    steps = np.diff(time)
    rate = 1.0 / float(np.median(steps))
    if abs(rate / rig.frame_rate - 1.0) > OTHER_RATE:
        raise InputError(
            file, "time_s", f"runs at {rate:.4g} Hz, the rig at {rig.frame_rate:g} Hz: another rig?"
        )
    gap = np.flatnonzero(np.abs(steps * rig.frame_rate - 1.0) > STAMP_JITTER)
    if gap.size:
        raise InputError(file, "time_s", f"has a gap or a jump after {time[gap[0]]:.3f} s")
    if len(time) < SHORTEST_RECORD_s * rig.frame_rate:
        _check_short(record, control, file)
    for name in record.channels:
        if not np.all(np.isfinite(record[name])):
            row = int(np.argmax(~np.isfinite(record[name])))
            raise InputError(file, name, f"row {row + 2} holds no number")
    if rig.controls and moved:
        _check_channels(rig, record, control, file)


def _check_short(record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if a short record has too few frames or swings to fit and to hold out."""
    names = [channel(control, q) for q in ("force", "computed", "deflection")]
    swings = min((_swings(record[name]) for name in names if name in record), default=0)
    if len(record) < 2 * PIECE or swings < SHORT_SWINGS:
        length_s = record.time_s[-1] - record.time_s[0]
        problem = f"is {length_s:.1f} s long with {swings} swings in {len(record)} rows;"
        needed = f"{SHORTEST_RECORD_s:g} s are needed, or {SHORT_SWINGS} swings in {2 * PIECE} rows"
        raise InputError(file, "", f"{problem} {needed}")


def _swings(signal: Floats) -> int:
    """Return how often a signal crosses its mean by half of its standard deviation or more."""
    away = signal - signal.mean()
    sides = np.sign(away[np.abs(away) > 0.5 * away.std()])
    return int(np.count_nonzero(np.diff(sides)))


def _check_channels(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if a channel is stuck, a copy of another, or in another unit."""
    names = [channel(control, q) for q in ("force", "computed", "deflection")]
    present = [name for name in names if name in record]
    for i, name in enumerate(present):
        if plausible.is_constant(record[name]):
            raise InputError(file, name, f"never changes: {_why_constant(rig, record, control)}")
        other = plausible.copy_of(name, {known: record[known] for known in present[: i + 1]})
        if other is not None:
            raise InputError(file, name, f"is a copy of {other}")
    gradient, pressure = channel(control, "gradient"), "dynamic_pressure_Pa"
    both = gradient in record and pressure in record
    stuck = both and plausible.is_constant(record[pressure])
    if stuck and not plausible.is_constant(record[gradient]):
        raise InputError(file, pressure, f"never changes, while {gradient} does: it is stuck")
    data = rig.controls[control]
    for name in present[1:] if names[0] in present else present:
        most = float(np.max(np.abs(record[name])))
        if most > plausible.FAR_BEYOND * data.travel:
            raise InputError(
                file, name, f"reaches {most:.3g}, beyond {data.travel:g}: is it in another unit?"
            )
    _check_force_unit(rig, record, control, file)
    _check_schedule(rig, record, control, file)


def _why_constant(rig: Rig, record: Record, control: ControlName) -> str:
    """Return the possible cause of a constant channel: no motion, or a stuck sensor."""
    force = channel(control, "force")
    if force not in record:
        return f"the {control} is at rest, or a sensor is stuck"
    most = float(np.max(np.abs(record[force])))
    if most == 0.0:
        return f"no force moves the {control}, or a sensor is stuck"
    loader, computed = rig.controls[control].loader, channel(control, "computed")
    if computed not in record or plausible.is_constant(record[computed]):
        holds = loader.breakout + max(loader.friction, loader.breakaway)
        return (
            f"{most:.4g} N do not move the {control} (breakout and friction hold {holds:.4g} N in "
            "the rig file), or a sensor is stuck; record a larger force"
        )
    return "a sensor that is stuck"


def _check_schedule(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if the gradients differ from those of the rig's table."""
    gradient, pressure = channel(control, "gradient"), "dynamic_pressure_Pa"
    if gradient not in record or pressure not in record:
        return
    specified = specified_gradient(rig.controls[control].schedule, record[pressure])
    if not specified.any():
        return
    ratio = float(np.median(record[gradient]) / np.median(specified))
    if not 1.0 / OTHER_RIG < ratio < OTHER_RIG:
        raise InputError(
            file, gradient, f"is {ratio:.3g} times what this rig's table gives: another rig's file?"
        )


def check_trim(trim_speed_m_per_s: float, record: Record, file: object) -> None:
    """Raise InputError if a record does not start at the trim speed of the rig's aircraft."""
    if SPEED not in record:
        return
    start = start_of(record, SPEED)
    if abs(start / trim_speed_m_per_s - 1.0) > OTHER_SPEED:
        problem = f"starts at {start:.4g}, and the aircraft is trimmed at {trim_speed_m_per_s:.4g}"
        remedy = "give records from their trim on, and those of another trim by themselves"
        raise InputError(file, SPEED, f"{problem}: {remedy}")


def start_of(record: Record, name: str) -> float:
    """Return the value of a channel at the start of a record, in its unit."""
    return float(np.median(record[name][:START_ROWS]))


def _check_force_unit(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if the force, by gradient and deflection, is in pounds."""
    names = [channel(control, q) for q in ("force", "computed", "gradient")]
    if any(name not in record for name in names):
        return
    force, computed, gradient = (record[name] for name in names)
    ratio = plausible.force_ratio(force, computed, gradient)
    if ratio is not None and plausible.in_pounds(ratio):
        raise InputError(
            file, names[0], f"is {ratio:.2f} of what deflection and gradient say: it is in pounds"
        )
