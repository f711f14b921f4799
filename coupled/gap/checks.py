"""What is checked before a record is held against a rig: clock, numbers, sensors, units."""

from __future__ import annotations

import numpy as np

from coupled.channels import ControlName, channel
from coupled.errors import InputError
from coupled.record import Record
from coupled.rig.parameters import Rig

LEAST_s = 10.0  # a shorter record holds too few stretches to hold any out


def check_record(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Refuse a record that cannot be held against this rig, and say why."""
    if control not in rig.controls:
        raise InputError(file, control, f"the rig has no {control}")
    time = record.time_s
    steps = np.diff(time)
    rate = 1.0 / float(np.median(steps))
    if abs(rate / rig.frame_rate - 1.0) > 1e-3:
        raise InputError(
            file, "time_s", f"runs at {rate:.4g} Hz, the rig at {rig.frame_rate:g} Hz: another rig?"
        )
    gap = np.flatnonzero(np.abs(steps * rig.frame_rate - 1.0) > 0.01)
    if gap.size:
        raise InputError(file, "time_s", f"has a gap or a jump after {time[gap[0]]:.3f} s")
    if len(time) < LEAST_s * rig.frame_rate:
        raise InputError(file, "", f"is {time[-1] - time[0]:.1f} s long; {LEAST_s:g} s are needed")
    for name in record.channels:
        if not np.all(np.isfinite(record[name])):
            row = int(np.argmax(~np.isfinite(record[name])))
            raise InputError(file, name, f"row {row + 2} holds no number")
    _check_channels(rig, record, control, file)


def _check_channels(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Refuse a channel that is stuck, a copy of another, or in another unit."""
    names = [channel(control, q) for q in ("force", "computed", "deflection")]
    present = [name for name in names if name in record]
    for i, name in enumerate(present):
        if np.ptp(record[name]) == 0.0:
            raise InputError(file, name, "never changes: a sensor that is stuck")
        for other in present[:i]:
            if np.array_equal(record[name], record[other]):
                raise InputError(file, name, f"is a copy of {other}")
    gradient, pressure = channel(control, "gradient"), "dynamic_pressure_Pa"
    told = gradient in record and pressure in record
    if told and np.ptp(record[pressure]) == 0.0 and np.ptp(record[gradient]) > 0.0:
        raise InputError(file, pressure, f"never changes, while {gradient} does: it is stuck")
    data = rig.controls[control]
    for name in present[1:] if names[0] in present else present:
        most = float(np.max(np.abs(record[name])))
        if most > 3.0 * data.travel:
            raise InputError(
                file, name, f"reaches {most:.3g}, beyond {data.travel:g}: is it in another unit?"
            )
    _check_force_unit(rig, record, control, file)


def _check_force_unit(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Refuse a force whose size against gradient and deflection is that of pounds."""
    names = [channel(control, q) for q in ("force", "computed", "gradient")]
    if any(name not in record for name in names):
        return
    force, computed, gradient = (record[name] for name in names)
    expected = gradient * computed
    if not expected.any():
        return
    ratio = float(force @ expected) / float(expected @ expected)
    if abs(ratio * 4.448 - 1.0) < 0.25:
        raise InputError(
            file, names[0], f"is {ratio:.2f} of what deflection and gradient say: it is in pounds"
        )
