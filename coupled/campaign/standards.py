"""Limits of the standards that a flight is held against.

14 CFR 25.143(d): pilot forces. 14 CFR Part 60, appendix A, table A2A: the force of a
held control against the specified one (2.a, and 2.d.8 and 2.e.1 in flight), and the peak
rate after a small input (2.b.4), for which the rigid structure stands for the aircraft.
"""

from __future__ import annotations

import numpy as np

from coupled.authority.compare import Flight, held_forces
from coupled.flight.expectation import RATE, Standard
from coupled.record.channels import ControlName, channel
from coupled.units import POUND_N, DEGREE_rad

Bounds = tuple[float | None, float | None]

# 25.143(d): pitch, roll and yaw, in lbf. A foot is not a hand: yaw has one short-term limit.
_PILOT_FORCE_lbf: dict[Standard, dict[ControlName, float]] = {
    "25.143(d) two hands": {"column": 75.0, "wheel": 50.0, "pedals": 150.0},
    "25.143(d) one hand": {"column": 50.0, "wheel": 25.0, "pedals": 150.0},
    "25.143(d) long-term": {"column": 10.0, "wheel": 5.0, "pedals": 20.0},
}
_FORCE_lbf: dict[ControlName, float] = {"column": 5.0, "wheel": 3.0, "pedals": 5.0}
_FORCE_SHARE = 0.10
_RATE_rad_per_s = 0.15 * DEGREE_rad
_RATE_SHARE = 0.20


def judge_standard(
    standard: Standard, control: ControlName | None, flight: Flight, rigid: Flight | None
) -> tuple[float, Bounds]:
    """Return a flight's figure and its bounds, in N or rad/s.

    `control` is the one that the comparison looks at where none is named. Of two
    tolerances the wider holds.
    """
    looked_at = control or flight.manoeuvre.control
    if standard in _PILOT_FORCE_lbf:
        force = float(np.max(np.abs(flight.record[channel(looked_at, "force")])))
        return force, (None, _PILOT_FORCE_lbf[standard][looked_at] * POUND_N)
    if standard == RATE:
        assert rigid is not None
        peak, wanted = (f.outcome.peak_rate_rad_per_s or 0.0 for f in (flight, rigid))
        allowed = max(_RATE_rad_per_s, _RATE_SHARE * abs(wanted))
        return peak, (wanted - allowed, wanted + allowed)
    felt, specified = held_forces(flight.manoeuvre, looked_at, flight.record)
    allowed = max(_FORCE_lbf[looked_at] * POUND_N, _FORCE_SHARE * abs(specified))
    return felt, (specified - allowed, specified + allowed)
