"""Events that end a smooth interval of the loader's motion: rest, a stop, or neutral.

Within an interval the acceleration is constant, so the time of an event is the root of a parabola.
"""

from __future__ import annotations

import math

from coupled.rig.compiled import stage
from coupled.rig.declaration import Ends

NOTHING, REST, STOP, NEUTRAL = 0, 1, 2, 3


@stage
def sign(x: float) -> float:
    """Return the sign of a number, 0 for 0."""
    return 1.0 if x > 0.0 else (-1.0 if x < 0.0 else 0.0)


@stage
def crossing(x0: float, v0: float, acceleration: float, target: float, span: float) -> float:
    """Return the first time in (0, span] at which x0 + v0·t + a·t²/2 reaches `target`."""
    gap = target - x0
    root = v0 * v0 + 2.0 * acceleration * gap
    speed = math.sqrt(root) if root > 0.0 else 0.0
    denominator = v0 + (speed if gap > 0.0 else -speed)
    time = 2.0 * gap / denominator if denominator != 0.0 else span
    return min(max(time, 0.0), span)


@stage
def first_event(
    x: float, v: float, dry: bool, breakout: float, halfway: float, span: float, ends: Ends
) -> tuple[float, int]:
    """Return the time of the first event in a step of `span` seconds, s, and its kind.

    The step begins at δc = x with the rate v; `halfway` is the rate at its middle.
    """
    acceleration = 2.0 * (halfway - v) / span
    end, event = x + span * halfway, NOTHING
    if dry and v != 0.0 and v * (v + span * acceleration) < 0.0:
        span, event = -v / acceleration, REST
        end = x + 0.5 * span * v
    if end > ends[1] or end < ends[0]:
        end = ends[1] if end > ends[1] else ends[0]
        span, event = crossing(x, v, acceleration, end, span), STOP
    if breakout > 0.0 and x * end < 0.0:
        span, event = crossing(x, v, acceleration, 0.0, span), NEUTRAL
    return span, event
