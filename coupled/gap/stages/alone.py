"""An aircraft alone: a rig without controls, judged by surface positions and motion.

Records of control forces and of the host are ignored. The rig takes the frame rate of the record,
since no loader or host depends on it. If the record is slower than the rig, the model is stepped at
least at the rig's rate, and the surfaces are interpolated between the rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from coupled.errors import InputError
from coupled.gap.signals.output import Output
from coupled.gap.stages.airframe import RATE
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_channel, surface_points
from coupled.gap.thresholds import TINY
from coupled.record.channels import LATERAL, LONGITUDINAL, TIME
from coupled.record.record import Record
from coupled.rig.rig import Rig

ELEVATOR = surface_channel("column")


class AloneReader(Reader):
    """A reader of a rig without controls: no stage but the airframe has outputs."""

    def outputs(self) -> list[Output]:
        """Return no output; the airframe's are made by `airframe_outputs`."""
        return []

    def missing(self) -> dict[str, list[str]]:
        """Return no channel, since the rig has no stage that needs one."""
        return {}

    def filtered(self) -> dict[str, str]:
        """Return no channel of a control."""
        return {}

    @property
    def set_points(self) -> bool:
        """False: nothing drives a control."""
        return False

    @property
    def by_hand(self) -> bool:
        """False: no bench imposes a motion."""
        return False

    @property
    def in_series(self) -> bool:
        """False: there is neither loader nor linkage."""
        return False


def motion_alone(records: Mapping[str, Record]) -> dict[str, Record]:
    """Return the records with time, surface positions and motion only.

    Raises InputError if one lacks the elevator position or the pitch rate.
    """
    found = {}
    for file, record in records.items():
        for name in (ELEVATOR, RATE):
            if name not in record:
                problem = "is missing; the rig has an aircraft only, and is judged by it"
                raise InputError(file, name, problem)
        kept = [name for name in (TIME, *LONGITUDINAL, *LATERAL) if name in record]
        data = np.column_stack([record[name] for name in kept])
        found[file] = Record(tuple(kept), data, record.manifest)
    return found


def at_rate_of(rig: Rig, record: Record) -> Rig:
    """Return the rig with the frame rate of a record, and steps per frame to match its own."""
    assert rig.flight is not None
    rate_Hz = 1.0 / float(np.median(np.diff(record.time_s)))
    if abs(rate_Hz / rig.frame_rate - 1.0) <= TINY:
        return rig
    wanted = rig.frame_rate * rig.flight.steps_per_frame / rate_Hz
    steps = max(1, math.ceil(wanted - 0.01))
    return rig.changed(
        {"frame_rate_Hz": float(f"{rate_Hz:.6g}"), "flight.steps_per_frame": min(steps, 100)}
    )


def check_moved_by_pilot(rig: Rig) -> None:
    """Raise InputError if control laws of the model move its elevator."""
    assert rig.flight is not None
    if surface_points(rig, "column") is None:
        problem = (
            "has control laws that move its elevator, which follow the column's command;"
            " give a rig with [controls.column], and a record with column_estimate_m"
        )
        raise InputError(rig.name, "flight.model", f"{rig.flight.model} {problem}")
