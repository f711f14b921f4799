"""A flight compared with 14 CFR 25.143(d) and Part 60, appendix A, table A2A (`tolerances`).

Pilot forces are judged by their duration: the largest force against the short-term limit, and the
force held for longer than a short term against the long-term one. The figure is the one closer to
its limit. All forces are the hand's own, not the strain gauge's readings. Part 60: the force of a
held control against the specified one (2.a, and 2.d.8 and 2.e.1 in flight), and the peak rate after
a small pitch input (2.b.4), for which the rigid structure represents the aircraft. 2.b.4 is for
approach and landing, which the run must choose, and for rates of 0.5 to 2 °/s; "rate against rigid"
has the same tolerances for any rate. Latency (4.a) is in `latency`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from coupled.authority.compare import Flight
from coupled.authority.heldcontrol import average_held_forces
from coupled.campaign.latency import latency_s
from coupled.campaign.tolerances import (
    LONG_TERM_N,
    ONE_HAND_N,
    RATE_SHARE,
    TWO_HANDS_N,
    LATENCY_s,
    RATE_rad_per_s,
    SHORT_TERM_s,
    SMALL_rad_per_s,
    force_band,
    sustained_force,
)
from coupled.flight.expectation import LATENCIES, RATE, SMALL_RATE, Standard, UnjudgedError
from coupled.record.channels import ControlName, channel
from coupled.units import DEGREE_rad

_SHORT_TERM: Mapping[Standard, Mapping[ControlName, float]] = {
    "25.143(d) two hands": TWO_HANDS_N,
    "25.143(d) one hand": ONE_HAND_N,
}
_LONG_TERM: Standard = "25.143(d) long-term"


@dataclass(frozen=True)
class StandardFigure:
    """A flight's figure and its bounds, in N, rad/s or s; `note` identifies one of several.

    `at_s` is the time of the figure in the flight, None if it has none.
    """

    value: float
    least: float | None
    most: float | None
    note: str = ""
    at_s: float | None = None


def judge_standard(
    standard: Standard, control: ControlName | None, flight: Flight, reference: Flight | None
) -> StandardFigure:
    """Return a flight's figure and its bounds.

    `reference` is the rigid flight for a rate, and the flight without delays for a latency.
    `control` is by default that of the comparison. Raises UnjudgedError if the standard does not
    apply to the flight.
    """
    looked_at = control or flight.manoeuvre.control
    if standard == _LONG_TERM or standard in _SHORT_TERM:
        return _pilot_force(standard, looked_at, flight)
    if standard in (RATE, SMALL_RATE):
        assert reference is not None
        return _rate(standard, flight, reference)
    if standard in LATENCIES:
        assert reference is not None
        late_s = latency_s(looked_at, flight, reference)
        return StandardFigure(late_s, None, LATENCY_s[standard])
    felt, specified = average_held_forces(flight.manoeuvre, looked_at, flight.record)
    allowed = float(force_band(looked_at, specified))
    return StandardFigure(felt, specified - allowed, specified + allowed)


def _pilot_force(standard: Standard, control: ControlName, flight: Flight) -> StandardFigure:
    force = flight.record[channel(control, "hand_force")]
    time_s = flight.record.time_s
    frame_s = float(time_s[1] - time_s[0]) if len(time_s) > 1 else SHORT_TERM_s
    sustained = sustained_force(force, frame_s)
    held = StandardFigure(
        sustained, None, LONG_TERM_N[control], f", mean over {SHORT_TERM_s:g} s (long-term)"
    )
    if standard == _LONG_TERM:
        return held
    most = _SHORT_TERM[standard][control]
    at = int(np.argmax(np.abs(force)))
    greatest = float(np.abs(force)[at])
    if sustained / LONG_TERM_N[control] > greatest / most:
        return held
    return StandardFigure(greatest, None, most, at_s=float(time_s[at]))


def _rate(standard: Standard, flight: Flight, rigid: Flight) -> StandardFigure:
    peak, wanted = (f.outcome.peak_rate_rad_per_s or 0.0 for f in (flight, rigid))
    low, high = SMALL_rad_per_s
    if standard == SMALL_RATE:
        if flight.manoeuvre.control != "column":
            problem = f"2.b.4 is for a small pitch input, not for the {flight.manoeuvre.control}"
            raise UnjudgedError(problem)
        if not low <= abs(wanted) <= high:
            problem = f"2.b.4 is for 0.5 to 2 °/s; the rigid flight's is {wanted / DEGREE_rad:.3g}"
            raise UnjudgedError(f"{problem} °/s (see {RATE!r})")
    allowed = max(RATE_rad_per_s, RATE_SHARE * abs(wanted))
    return StandardFigure(peak, wanted - allowed, wanted + allowed)
