"""What drives a machine, where its records show it without doubt.

A digital servo is given set points. In a record of them that is faster than they come, each stands
for several frames, and they differ by more than one step of a converter: a motion that was measured
repeats itself so only by its rounding. Where they come as fast as the record's frames, it is their
noise that tells: a number that a computer made has none beside what the grip's transducer reads.

A record may have the grip's motion and force and no δc. Where a spring holds the loader, its answer
to the force is predicted, and the linkage moves the grip in series with it (`stages.series`). A
loader without a spring would drift in such a prediction: its motion is taken as imposed, and the
force as its answer (`stages.imposed`).

The zero of an encoder is known no better than to one of its counts.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from coupled.gap.signals.output import Floats, heard, rounding
from coupled.gap.thresholds import (
    COUNTS,
    HELD_AT_MOST,
    HELD_FINER,
    HELD_JUMPS,
    HELD_SHARE,
    HELD_STEPS,
    HELD_WINDOW,
    SLOW_LOADER_s,
)
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.equations import specified_gradient
from coupled.rig.rig import Rig

ZEROS = {"deflection": "sensing.deflection_zero_{d}", "force": "sensing.force_zero_N"}


def as_driven(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with what drives it, where all records show what its file does not say."""
    name, grip, force = (channel(control, q) for q in ("computed", "deflection", "force"))
    if rig.controls[control].drive != "force":
        return rig
    held = all(name in record and in_set_points(record[name]) for record in records)
    if held or any(_made(record, control) for record in records):
        return rig.changed({f"controls.{control}.drive": "setpoint"})
    alone = all(name not in one and grip in one and force in one for one in records)
    if alone and any(drifts(rig, control, softest_gradient(rig, control, one)) for one in records):
        return rig.changed({f"controls.{control}.drive": "displacement"})
    return rig


def drifts(rig: Rig, control: ControlName, gradient: float) -> bool:
    """Tell whether a loader has no spring to speak of: a prediction from its force would drift.

    That is a period longer than `SLOW_LOADER_s` at a gradient in N/d.
    """
    mass = rig.controls[control].loader.mass
    return max(gradient, 0.0) * SLOW_LOADER_s**2 < 4.0 * np.pi**2 * mass


def softest_gradient(rig: Rig, control: ControlName, record: Record) -> float:
    """Return the least gradient of a record, N/d: recorded, by its q̄, or the least of the table."""
    gradient, pressure = channel(control, "gradient"), "dynamic_pressure_Pa"
    schedule = rig.controls[control].schedule
    if gradient in record:
        return float(np.min(record[gradient]))
    if pressure in record:
        return float(np.min(specified_gradient(schedule, record[pressure])))
    return min(schedule.total_gradient)


def _made(record: Record, control: ControlName) -> bool:
    """Tell whether δc is a number that was made, not a motion that was measured.

    Only where nothing else of a loader or its host is recorded: a simulation without noise has δc
    without noise, too.
    """
    others = (channel(control, q) for q in ("gradient", "modifying_force", "estimate"))
    given, grip = channel(control, "computed"), channel(control, "deflection")
    if any(name in record for name in others) or not (given in record and grip in record):
        return False
    return _finest(record[given]) < HELD_FINER * heard(record[grip]).rms


def _finest(signal: Floats) -> float:
    """Return the noise of the quietest stretches in which a signal moves; infinite without any.

    By fourth differences, over stretches of so many frames that a motion is none in the quietest.
    Moving is by two steps of a converter a frame or more: a slower one repeats its own.
    """
    steps = np.abs(np.diff(signal))
    if not np.any(steps) or len(steps) < HELD_WINDOW + 4:
        return np.inf
    least = float(np.diff(np.unique(signal)).min())
    slowest = sliding_window_view(steps, HELD_WINDOW + 3).min(axis=1)
    rough = sliding_window_view(np.diff(signal, 4), HELD_WINDOW)
    moving = slowest > 1.5 * least
    noise = np.sqrt(np.mean(rough[moving] ** 2, axis=1) / 70.0)
    return float(np.quantile(noise, 0.1)) if noise.size else np.inf


def in_set_points(signal: Floats) -> bool:
    """Tell whether a signal comes in set points, each held over two frames or more.

    Two changes in a row would be a motion; a pause longer than some frames says nothing.
    """
    changes = np.flatnonzero(np.diff(signal))
    if len(changes) < HELD_JUMPS:
        return False
    apart = np.diff(changes)
    moving = apart[apart <= HELD_AT_MOST]
    sizes = np.abs(np.diff(signal)[changes])
    uneven = float(np.median(sizes)) > HELD_STEPS * float(sizes.min())
    return uneven and len(moving) > 0 and float(np.mean(moving >= 2)) >= HELD_SHARE


def as_counted(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with zeros that may be off by a count of their channels, where these count.

    A channel counts where its rounding is half of its noise or more. What the file says stays.
    """
    known = rig.controls[control].tolerance
    found = dict(known)
    for quantity, zero in ZEROS.items():
        name, key = channel(control, quantity), zero.format(d=unit_of(control))
        counts = [_count(record, name) for record in records if name in record]
        if key not in known and counts and max(counts) > 0.0:
            found[key] = max(counts)
    return rig if found == known else rig.changed({f"controls.{control}.tolerance": found})


def _count(record: Record, name: str) -> float:
    """Return the size of a channel's count in its unit, 0 where that is little of its noise."""
    signal = record[name]
    error = rounding(signal, math.inf)
    return error * math.sqrt(12.0) if error > COUNTS * heard(signal).rms else 0.0
