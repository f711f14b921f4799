"""The limits and tolerances of the rules for controls and flights.

14 CFR Part 60, appendix A, table A2A: static checks (2.a), releases (2.b.1 to 3), a small pitch
input (2.b.4), latency (4.a). 14 CFR 25.143(d): pilot forces for short and for long. Of two
tolerances of one quantity the wider applies, as in the table.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ControlName
from coupled.units import POUND_N, DEGREE_rad

Floats = NDArray[np.float64]

FORCE_SHARE = 0.10  # 2.a, 2.d.8 and 2.e.1
TIME_SHARE = 0.10  # 2.b: of P₀; of P_n it is n + 1 times that
HEIGHT_SHARE = 0.10  # 2.b: of the first overshoot
COUNTED = 0.05  # 2.b: overshoots above this share of the displacement count
RATE_rad_per_s = 0.15 * DEGREE_rad  # 2.b.4
RATE_SHARE = 0.20
SMALL_rad_per_s = (0.5 * DEGREE_rad, 2.0 * DEGREE_rad)  # 2.b.4: the range of rates

# 4.a.1: after the aircraft's own response; levels C and D, A and B, and helicopters C and D.
LATENCY_s = {
    "Part 60 4.a latency 150 ms": 0.150,
    "Part 60 4.a latency 300 ms": 0.300,
    "Part 60 4.a latency 100 ms": 0.100,
}

# 2.a.1 to 2.a.3: deviation of a surface from the position for the control's deflection.
SURFACE_rad = {
    "elevator": 2.0 * DEGREE_rad,
    "aileron": 2.0 * DEGREE_rad,
    "spoiler": 3.0 * DEGREE_rad,
    "rudder": 2.0 * DEGREE_rad,
}


@dataclass(frozen=True)
class StaticTolerance:
    """The tolerances of 2.a for a control: breakout and force in N."""

    breakout_N: float
    force_N: float


STATIC: dict[ControlName, StaticTolerance] = {
    "column": StaticTolerance(2.0 * POUND_N, 5.0 * POUND_N),
    "wheel": StaticTolerance(2.0 * POUND_N, 3.0 * POUND_N),
    "pedals": StaticTolerance(5.0 * POUND_N, 5.0 * POUND_N),
}


def force_band(control: ControlName, force: Floats | float) -> Floats:
    """Return the tolerance of a specified force, N: ±10 % or the rule's pounds."""
    return np.maximum(FORCE_SHARE * np.abs(force), STATIC[control].force_N)


# 25.143(d), in lbf. Yaw, by the feet, has one short-term limit.
TWO_HANDS_N: dict[ControlName, float] = {
    "column": 75.0 * POUND_N,
    "wheel": 50.0 * POUND_N,
    "pedals": 150.0 * POUND_N,
}
ONE_HAND_N: dict[ControlName, float] = {
    "column": 50.0 * POUND_N,
    "wheel": 25.0 * POUND_N,
    "pedals": 150.0 * POUND_N,
}
LONG_TERM_N: dict[ControlName, float] = {
    "column": 10.0 * POUND_N,
    "wheel": 5.0 * POUND_N,
    "pedals": 20.0 * POUND_N,
}
# The rule gives no duration of a short-term force; this one is chosen. A pilot trims within it, or
# changes the condition that requires the force.
SHORT_TERM_s = 20.0


def sustained_force(force: Floats, frame_s: float, over_s: float = SHORT_TERM_s) -> float:
    """Return the largest mean size of a force over a duration, N; 0 if the record is shorter.

    A mean, so that a momentary release or a zero crossing does not restart the duration.
    """
    rows = round(over_s / frame_s)
    if rows < 1 or len(force) < rows:
        return 0.0
    total = np.concatenate(([0.0], np.cumsum(np.abs(force))))
    return float(np.max(total[rows:] - total[:-rows])) / rows
