"""The library for a servo with commanded set points.

A command has no sensor, so sensor effects are left out. A limit of the servo's rate must be above
the speed that the grip reached.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from coupled.gap.effects.effect import Effect, Parameter
from coupled.gap.signals.output import Floats, heard
from coupled.gap.thresholds import REACHED_BEYOND, REACHED_OVER
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record

RATE_LIMIT = "loader.servo_rate_limit_{d}_per_s"


def under_set_points(
    library: Sequence[Effect], records: Collection[Record], control: ControlName
) -> list[Effect]:
    """Return a library for set points, with the servo's rate limit above the speed reached."""
    grip = channel(control, "deflection")
    seen = [_reached(record[grip], record) for record in records if grip in record]
    reached = max(seen, default=0.0)

    def left(parameter: Parameter) -> Parameter:
        lowest = reached if parameter.key == RATE_LIMIT else 0.0
        return replace(parameter, low=max(parameter.low, min(lowest, 0.5 * parameter.high)))

    return [
        replace(effect, parameters=tuple(map(left, effect.parameters)))
        for effect in library
        if not effect.of_sensor
    ]


def _reached(grip: Floats, record: Record) -> float:
    """Return the speed in d/s that the grip reached, over a few frames, above its noise.

    Backlash only makes the grip slower than the servo. A bend would add to the speed; it is
    neglected.
    """
    rate_Hz = (len(grip) - 1) / float(record.time_s[-1] - record.time_s[0])
    noise = REACHED_BEYOND * heard(grip).rms
    over = [n for n in REACHED_OVER if n < len(grip)]
    way = [float(np.max(np.abs(grip[n:] - grip[:-n]))) - noise for n in over]
    return max([rate_Hz * w / n for n, w in zip(over, way, strict=True)], default=0.0)
