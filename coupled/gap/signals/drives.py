"""The input of a machine (force, set points or imposed motion), if its records show it clearly.

A digital servo receives set points. In a record faster than the set points each one is held for
several frames, and they differ by more than one step of a converter; a measured motion repeats
values only by rounding. In a record as fast as the set points their noise decides: a computed
number has none in comparison with the transducer at the grip.

A record may have motion and force of the grip and no δc. If a spring holds the loader, its response
to the force is predicted, with the linkage in series (`stages.series`). Without a spring this
prediction would drift, so the motion is taken as imposed and the force as output
(`stages.imposed`).

The zero of an encoder is known no better than to one of its counts.
"""

from __future__ import annotations

import math
from collections.abc import Collection

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from coupled.gap.signals.output import Floats, estimate_noise, rounding
from coupled.gap.thresholds import (
    FEW,
    FEW_FRAMES,
    MOST,
    NEGLIGIBLE,
    SHORT_FRAMES,
    SIGMAS,
    SHORTEST_RECORD_s,
)
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.equations import specified_gradient
from coupled.rig.rig import Rig

ZEROS = {"deflection": "sensing.deflection_zero_{d}", "force": "sensing.force_zero_N"}


def as_driven(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with its kind of input, if all records show one that the file does not set."""
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
    """Tell whether a prediction from the force would drift, for lack of a spring.

    True if the loader's own period exceeds `SLOW_LOADER_s` at a gradient in N/d.
    """
    mass = rig.controls[control].loader.mass
    return max(gradient, 0.0) * SHORTEST_RECORD_s**2 < 4.0 * np.pi**2 * mass


def softest_gradient(rig: Rig, control: ControlName, record: Record) -> float:
    """Return a record's least gradient, N/d: as recorded, from its q̄, or the table's least.

    Of a curve, that of its softest segment.
    """
    gradient, pressure = channel(control, "gradient"), "dynamic_pressure_Pa"
    schedule = rig.controls[control].schedule
    if schedule.curved:
        return min(map(min, schedule.segments))
    if gradient in record:
        return float(np.min(record[gradient]))
    if pressure in record:
        return float(np.min(specified_gradient(schedule, record[pressure])))
    return min(schedule.total_gradient)


def _made(record: Record, control: ControlName) -> bool:
    """Tell whether δc is a computed number, not a measured motion.

    Only for records without other channels of loader or host, since in a simulation without noise
    δc has no noise either.
    """
    others = (channel(control, q) for q in ("gradient", "modifying_force", "estimate"))
    given, grip = channel(control, "computed"), channel(control, "deflection")
    if any(name in record for name in others) or not (given in record and grip in record):
        return False
    return _estimate_quietest_noise(record[given]) < NEGLIGIBLE * estimate_noise(record[grip]).rms


def _estimate_quietest_noise(signal: Floats) -> float:
    """Return the rms noise of the quietest stretches in which a signal moves; infinite if none.

    Fourth differences have 70 times the variance of white noise. In the quietest short stretches
    the motion adds almost nothing to them. Over all frames of a chirp the estimate would include
    the chirp. Motion slower than two converter steps a frame is left out, since its values repeat
    by rounding.
    """
    steps = np.abs(np.diff(signal))
    if not np.any(steps) or len(steps) < FEW_FRAMES + 4:
        return math.inf
    least = float(np.diff(np.unique(signal)).min())
    slowest = sliding_window_view(steps, FEW_FRAMES + 3).min(axis=1)
    rough = sliding_window_view(np.diff(signal, 4), FEW_FRAMES)
    noise = np.sqrt(np.mean(rough[slowest > 1.5 * least] ** 2, axis=1) / 70.0)
    return float(np.quantile(noise, 0.1)) if noise.size else math.inf


def in_set_points(signal: Floats) -> bool:
    """Tell whether a signal comes in set points, each held over two frames or more.

    Changes in consecutive frames show a motion; pauses longer than `SHORT_FRAMES` are ignored.
    """
    changes = np.flatnonzero(np.diff(signal))
    if len(changes) < SHORT_FRAMES:
        return False
    apart = np.diff(changes)
    moving = apart[apart <= SHORT_FRAMES]
    sizes = np.abs(np.diff(signal)[changes])
    uneven = float(np.median(sizes)) > SIGMAS * float(sizes.min())
    return uneven and len(moving) > 0 and float(np.mean(moving >= 2)) >= (1.0 - FEW)


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
    return error * math.sqrt(12.0) if error > MOST * estimate_noise(signal).rms else 0.0
