"""What drives a machine, where its records show it without doubt.

A digital servo is given set points. In a record of them that is faster than they come, each stands
for several frames, and they differ by more than one step of a converter: a motion that was measured
repeats itself so only by its rounding.

Where the grip's motion and force are all there is, nothing says what a loader did with the force:
the motion is taken as imposed, and the force as its answer.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import HELD_AT_MOST, HELD_JUMPS, HELD_SHARE, HELD_STEPS
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig


def as_driven(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with what drives it, where all records show what its file does not say."""
    name, grip, force = (channel(control, q) for q in ("computed", "deflection", "force"))
    if rig.controls[control].drive != "force":
        return rig
    if all(name in record and in_set_points(record[name]) for record in records):
        return rig.changed({f"controls.{control}.drive": "setpoint"})
    if all(name not in one and grip in one and force in one for one in records):
        return rig.changed({f"controls.{control}.drive": "displacement"})
    return rig


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
