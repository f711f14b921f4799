"""Pilots: the kinds of a run file's `[pilot.CONTROL]`, and their actions on the grip."""

from __future__ import annotations

from coupled.flight.pilot.attitude import Attitude
from coupled.flight.pilot.base import Action, Pilot, edges
from coupled.flight.pilot.scripted import (
    Clamp,
    Doublet,
    FrequencySweep,
    Ramp,
    Step,
    ThreeTwoOneOne,
)
from coupled.flight.pilot.table import ForceTable, read_force_table
from coupled.flight.pilot.track import Track

__all__ = [
    "PILOTS",
    "Action",
    "Attitude",
    "Clamp",
    "Doublet",
    "ForceTable",
    "FrequencySweep",
    "Pilot",
    "Ramp",
    "Step",
    "ThreeTwoOneOne",
    "Track",
    "edges",
    "read_force_table",
]

PILOTS: dict[str, type[Pilot]] = {
    "step": Step,
    "ramp": Ramp,
    "doublet": Doublet,
    "3211": ThreeTwoOneOne,
    "sweep": FrequencySweep,
    "table": ForceTable,
    "clamp": Clamp,
    "attitude": Attitude,
    "track": Track,
}
