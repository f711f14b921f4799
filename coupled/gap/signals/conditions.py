"""What acts on a record besides the hand: weather, events and services.

Wind, gusts and events are in the manifest of a record. The conditions of a simulated flight are
known exactly: they act on the model too, and are not reported as effects. They are unknown for
other records, and for a part of a record that does not begin with the flight.

A recorded trim, autopilot or stick pusher is not an effect: it acts in the replay as recorded, in
the stages on which it acted in flight.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np

from coupled.errors import InputError
from coupled.flight.conditions import Conditions, build_conditions, condition_wrappers
from coupled.flight.event import trim_moved
from coupled.flight.wrapper import Wrapper
from coupled.gap.signals.output import Floats
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.serving import ServiceRows, service_rows

FILE = "the manifest"


def conditions_of(record: Record) -> Conditions:
    """Return the conditions of a record's flight; empty if they are not known."""
    given = record.manifest.get("conditions")
    begins = len(record) > 0 and record.time_s[0] == 0.0
    if not isinstance(given, Mapping) or not begins:
        return Conditions()
    tables = {key: given[key] for key in Conditions.model_fields if key in given}
    try:
        build_conditions(tables, FILE)
    except InputError:  # of another version
        return Conditions()
    return Conditions(**tables)


def reach_of(record: Record, control: ControlName) -> float:
    """Return the grip's reach in the cab of a record's flight, d; 0 if unlimited."""
    given = record.manifest.get("reach")
    reach = given.get(control) if isinstance(given, Mapping) else None
    return reach if isinstance(reach, float) and reach > 0.0 else 0.0


def wrappers_of(record: Record, frame_s: float) -> list[Wrapper]:
    """Return the conditions of a record as wrappers of an aircraft."""
    seed = record.manifest.get("seed")
    drawn = seed if isinstance(seed, int) else 0
    return condition_wrappers(conditions_of(record), FILE, frame_s, drawn)


def trim_shift(record: Record, control: ControlName, frame_s: float) -> Floats:
    """Return the shift of a control's trim by events over each frame, as share of full command.

    Sign as of the surface command in JSBSim.
    """
    times = np.arange(len(record), dtype=np.float64) * frame_s
    return trim_moved(conditions_of(record).event, control, times)


class Reading(Protocol):
    """One control in a record."""

    @property
    def record(self) -> Record:
        """The record."""

    @property
    def control(self) -> ControlName:
        """The control."""


def services(reading: Reading) -> ServiceRows | None:
    """Return the rows of the services; None if the record has none."""
    return service_rows(reading.record, reading.control)


def left(reading: Reading) -> Floats | float:
    """Return the share of G_T that remains after a failure of the artificial feel."""
    rows = services(reading)
    return 1.0 if rows is None else 1.0 - rows.feel_lost


def neutral(reading: Reading) -> Floats | float:
    """Return the deflection about which F_mod acts, d."""
    rows = services(reading)
    return 0.0 if rows is None else rows.neutral


def asked(reading: Reading) -> Floats:
    """Return the command of the surface, d: δ̂, or as changed by a jam or the other side."""
    rows = services(reading)
    return reading.record[channel(reading.control, "estimate")] if rows is None else rows.asked
