"""Quantised channels: the zero of an encoder is known to one count only."""

from __future__ import annotations

import math
from collections.abc import Collection

from coupled.gap.signals.output import heard, rounding
from coupled.gap.thresholds import COUNTS
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.rig import Rig

ZEROS = {"deflection": "sensing.deflection_zero_{d}", "force": "sensing.force_zero_N"}


def as_counted(rig: Rig, records: Collection[Record], control: ControlName) -> Rig:
    """Return the rig with a tolerance of one count on the zeros of quantised channels.

    A channel is quantised if its rounding is at least half of its noise. A tolerance in the rig
    file takes precedence.
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
    """Return the size of a channel's count in its unit, 0 if it is small against the noise."""
    signal = record[name]
    error = rounding(signal, math.inf)
    return error * math.sqrt(12.0) if error > COUNTS * heard(signal).rms else 0.0
