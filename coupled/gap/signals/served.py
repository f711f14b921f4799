"""What a record holds of a control's services, as the replays of its stages take it.

A trim, an autopilot or a pusher that the record tells of is no effect to be found: it goes into the
replay as it was recorded, in the same stages that flew it. Records without those channels are
replayed as before.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.serving import ServiceRows, service_rows

Floats = NDArray[np.float64]


class Reading(Protocol):
    """A control of a record."""

    @property
    def record(self) -> Record:
        """The record."""

    @property
    def control(self) -> ControlName:
        """The control."""


def services(reading: Reading) -> ServiceRows | None:
    """Return the rows of the services, None where the record has none."""
    return service_rows(reading.record, reading.control)


def left(reading: Reading) -> Floats | float:
    """Return the share of G_T that the artificial feel has left."""
    rows = services(reading)
    return 1.0 if rows is None else 1.0 - rows.feel_lost


def neutral(reading: Reading) -> Floats | float:
    """Return the place about which F_mod acts, d."""
    rows = services(reading)
    return 0.0 if rows is None else rows.neutral


def asked(reading: Reading) -> Floats:
    """Return what was asked of the surface, d: δ̂, or what a jam or the other side made of it."""
    rows = services(reading)
    return reading.record[channel(reading.control, "estimate")] if rows is None else rows.asked
