"""What acts on a record besides the hand: weather and events.

Wind, gusts and events are in the manifest of a record. The conditions of a simulated flight are
known exactly: they act on the model too, and are not reported as effects. They are unknown for
other records, and for a part of a record that does not begin with the flight.

Throttles, flaps and other levers that a log contains move the model's (`levers`).

The Earth turns, so a flight to the east is lighter than one to the north, by 2·Ω·v. A model starts
to the north; for a log of another program it starts at the heading of the log.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from coupled.errors import InputError
from coupled.flight.conditions import Conditions, build_conditions, condition_wrappers
from coupled.flight.event import trim_moved
from coupled.flight.levers import Levers
from coupled.flight.wrapper import Wrapper
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import SIGMAS, BRIEF_s
from coupled.record.channels import ControlName
from coupled.record.levers import levers_of
from coupled.record.record import Record

FILE = "the manifest"
HEADING = "heading_rad"


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
    """Return the conditions of a record as wrappers of an aircraft.

    A log of another program also has a first heading. Recorded levers that move are conditions too,
    unless the manifest has events, which move them.
    """
    seed = record.manifest.get("seed")
    drawn = seed if isinstance(seed, int) else 0
    known = conditions_of(record)
    acting = condition_wrappers(known, FILE, frame_s, drawn)
    if "conditions" not in record.manifest and HEADING in record:
        acting.append(Headed(float(record[HEADING][0])))
    if known.event:  # which move the levers
        return acting
    rate_Hz = (len(record) - 1) / float(record.time_s[-1] - record.time_s[0])
    levers = levers_of(record.channels)
    # If one throttle moves and another rests, each drives its own engine.
    kinds = {kind for name, (kind, _) in levers.items() if np.ptp(record[name]) > 0.0}
    rows = max(2, round(BRIEF_s * rate_Hz))
    moved = {n: _from_rest(record[n], rows) for n, (kind, _) in levers.items() if kind in kinds}
    return [*acting, Levers(moved, frame_s * rate_Hz)] if moved else acting


def _from_rest(positions: Floats, rows: int) -> Floats:
    """Return a lever's positions, the first without noise if the lever rests over the first rows.

    The model's lever is moved from trim by the difference from the first position.
    """
    start = positions[:rows]
    halves = [float(np.mean(half)) for half in np.array_split(start, 2)]
    noise = float(np.std(np.diff(start))) / math.sqrt(2.0)
    rests = abs(halves[1] - halves[0]) <= SIGMAS * 2.0 * noise / math.sqrt(len(start))
    return np.concatenate(([np.mean(start) if rests else start[0]], positions[1:]))


class Headed(Wrapper):
    """A heading of the start."""

    def __init__(self, heading: float) -> None:
        self.heading = heading


def trim_shift(record: Record, control: ControlName, frame_s: float) -> Floats:
    """Return the shift of a control's trim by events over each frame, as share of full command.

    Sign as of the surface command in JSBSim.
    """
    times = np.arange(len(record), dtype=np.float64) * frame_s
    return trim_moved(conditions_of(record).event, control, times)
