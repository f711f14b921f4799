"""The wind, gusts and events of a record's flight, as the manifest beside it holds them.

What a simulated flight met is known to the last digit: it is flown again, and is no effect to be
found. Of another record, or of a part of one that does not begin with the flight, nothing is known.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.conditions import Conditions, build_conditions, condition_wrappers
from coupled.flight.event import trim_moved
from coupled.flight.wrapper import Wrapper
from coupled.record.channels import ControlName
from coupled.record.record import Record

Floats = NDArray[np.float64]
FILE = "the manifest"


def conditions_of(record: Record) -> Conditions:
    """Return the conditions in which a record was flown; none where they are not known."""
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
    """Return where the cab stopped the grip in a record's flight, d; 0 where nothing did."""
    given = record.manifest.get("reach")
    reach = given.get(control) if isinstance(given, Mapping) else None
    return reach if isinstance(reach, float) and reach > 0.0 else 0.0


def wrappers_of(record: Record, frame_s: float) -> list[Wrapper]:
    """Return the conditions of a record as what is put around an aircraft."""
    seed = record.manifest.get("seed")
    drawn = seed if isinstance(seed, int) else 0
    return condition_wrappers(conditions_of(record), FILE, frame_s, drawn)


def trim_shift(record: Record, control: ControlName, frame_s: float) -> Floats:
    """Return by how much events have moved a control's trim over each frame, of the whole command.

    As a command of the surface: positive as JSBSim has it.
    """
    times = np.arange(len(record), dtype=np.float64) * frame_s
    return trim_moved(conditions_of(record).event, control, times)
