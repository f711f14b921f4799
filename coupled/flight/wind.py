"""Wind in a run: the velocity of the air after the start, along the initial heading and upwards.

The aircraft is trimmed in still air, where a steady wind has no effect; only changes matter, such
as a shear. Hence a run's wind starts at zero.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from coupled.errors import InputError
from coupled.flight.wrapper import Aircraft, Hook, Wrapper
from coupled.schema import Section, quantity
from coupled.units import FOOT_m

_WINDS = ("atmosphere/wind-north-fps", "atmosphere/wind-down-fps")
_STRONGEST = 100.0  # m/s


class Wind(Section):
    """Velocity of the air over time, linear between points: tail wind and updraught positive."""

    time: list[float] = quantity("s", min_length=1)
    along: list[float] = quantity("m_per_s")
    up: list[float] | None = quantity("m_per_s", None)


def check_wind(wind: Wind, file: object) -> None:
    """Refuse a wind whose times do not rise, or whose speeds are invalid."""
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


class MovingAir(Wrapper):
    """A run's wind: along the heading of the start, which is north, and upwards."""

    def __init__(self, wind: Wind, frame_s: float) -> None:
        self._wind, self._frame_s = wind, frame_s

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Return a hook that moves the air, frame by frame from the start."""
        wind, frame_s, frame = self._wind, self._frame_s, 0
        north, down = (aircraft.lever(name).set for name in _WINDS)
        rising = [0.0] * len(wind.time) if wind.up is None else wind.up

        def blow() -> None:
            nonlocal frame
            time = frame * frame_s
            north(float(np.interp(time, wind.time, wind.along)) / FOOT_m)
            down(-float(np.interp(time, wind.time, rising)) / FOOT_m)
            frame += 1

        return blow
