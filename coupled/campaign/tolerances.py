"""The figures of the rules that controls and flights are held against.

14 CFR Part 60, appendix A, table A2A: static checks (2.a), releases (2.b.1 to 3), a small
pitch input (2.b.4), latency (4.a). 14 CFR 25.143(d): what a pilot may have to hold, for short
and for long. Of two tolerances of one quantity the wider holds, as the table has it.
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
SMALL_rad_per_s = (0.5 * DEGREE_rad, 2.0 * DEGREE_rad)  # 2.b.4: the rates that it is for

# 4.a.1: after the aircraft's own answer; levels C and D, A and B, and of helicopters C and D.
LATENCY_s = {
    "Part 60 4.a latency 150 ms": 0.150,
    "Part 60 4.a latency 300 ms": 0.300,
    "Part 60 4.a latency 100 ms": 0.100,
}

# 2.a.1 to 2.a.3: how far a surface may be from where the control asks for it.
SURFACE_rad = {
    "elevator": 2.0 * DEGREE_rad,
    "aileron": 2.0 * DEGREE_rad,
    "spoiler": 3.0 * DEGREE_rad,
    "rudder": 2.0 * DEGREE_rad,
}


@dataclass(frozen=True)
class StaticTolerance:
    """What 2.a allows a control: breakout and force in N."""

    breakout_N: float
    force_N: float


STATIC: dict[ControlName, StaticTolerance] = {
    "column": StaticTolerance(2.0 * POUND_N, 5.0 * POUND_N),
    "wheel": StaticTolerance(2.0 * POUND_N, 3.0 * POUND_N),
    "pedals": StaticTolerance(5.0 * POUND_N, 5.0 * POUND_N),
}


def force_band(control: ControlName, force: Floats | float) -> Floats:
    """Return how far a force may be off a specified one, N: ±10 % or the rule's pounds."""
    return np.maximum(FORCE_SHARE * np.abs(force), STATIC[control].force_N)


# 25.143(d), in lbf. A foot is not a hand: yaw has one short-term limit.
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
# The rule gives no time at which a force ceases to be short-term: this one is chosen. A pilot
# has trimmed, or changed what asks for the force, well within it.
SHORT_TERM_s = 20.0


def sustained_force(force: Floats, frame_s: float, over_s: float = SHORT_TERM_s) -> float:
    """Return the greatest mean size of a force over so long a time, N; 0 if it is not that long.

    A mean, so that easing for a moment, or going through zero, does not start the time anew.
    """
    rows = round(over_s / frame_s)
    if rows < 1 or len(force) < rows:
        return 0.0
    total = np.concatenate(([0.0], np.cumsum(np.abs(force))))
    return float(np.max(total[rows:] - total[:-rows])) / rows
