"""Wind in a run: how the air moves after the start, along the aircraft's heading and upwards.

The aircraft is trimmed in still air, so a steady wind is no different from none; what matters is
the change, as through a shear. Hence a run's wind starts at zero.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from coupled.errors import InputError
from coupled.schema import Section, quantity

Step = Callable[[tuple[float, float, float]], None]
_STRONGEST = 100.0  # m/s


class Wind(Section):
    """Velocity of the air over time, straight between: tail wind and updraught positive."""

    time: list[float] = quantity("s", min_length=1)
    along: list[float] = quantity("m_per_s")
    up: list[float] | None = quantity("m_per_s", None)


def check_wind(wind: Wind, file: object) -> None:
    """Refuse a wind whose times do not rise, or whose speeds cannot be flown."""
    if any(b <= a for a, b in pairwise(wind.time)):
        raise InputError(file, "wind.time_s", "must rise from value to value")
    speeds = {"along_m_per_s": wind.along, "up_m_per_s": wind.up}
    for key, values in speeds.items():
        if values is None:
            continue
        if len(values) != len(wind.time):
            raise InputError(file, f"wind.{key}", "needs as many values as time_s")
        if values[0] != 0.0:
            raise InputError(file, f"wind.{key}", "must start at 0: it is the change since trim")
        if max(map(abs, values)) > _STRONGEST:
            raise InputError(file, f"wind.{key}", f"is beyond ±{_STRONGEST:g} m/s")


def blown(step: Step, blow: Callable[[float, float], None], wind: Wind, frame_s: float) -> Step:
    """Return a step that sets the air's velocity first, frame by frame from the start."""
    frame = 0

    def run(commands: tuple[float, float, float], /) -> None:
        nonlocal frame
        time = frame * frame_s
        along = float(np.interp(time, wind.time, wind.along))
        blow(along, 0.0 if wind.up is None else float(np.interp(time, wind.time, wind.up)))
        frame += 1
        step(commands)

    return run
