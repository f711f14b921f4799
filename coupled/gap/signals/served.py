"""The services of a control in a record, as inputs of the replays.

A recorded trim, autopilot or stick pusher is not an effect: it acts in the replay as recorded, in
the stages on which it acted in flight.
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
