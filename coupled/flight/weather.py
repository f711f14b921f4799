"""Wind, gusts and turbulence of a run, in SI.

The wind is a velocity of the air over time, along the aircraft's initial heading and upwards. The
aircraft is trimmed in still air, where a constant wind has no effect, so the wind starts at zero.

The velocity of a gust rises as (1 − cos(π·t/rise))/2, is held, and falls in the same way.
Turbulence is JSBSim's: `milspec`, MIL-F-8785C by its discrete approximation, or `tustin`, the same
spectra by Tustin's rule. Below 1000 ft above the ground its strength is that of the wind at 20 ft,
above 2000 ft that of a severity. It acts on all axes, and is drawn from the run's seed.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Literal

import numpy as np

from coupled.errors import InputError
from coupled.flight.wrapper import Aircraft, Hook, Wrapper
from coupled.schema import Section, quantity
from coupled.units import FOOT_m

_WINDS = ("atmosphere/wind-north-fps", "atmosphere/wind-down-fps")
GUST = "atmosphere/cosine-gust/"
_LOCAL = 3.0  # JSBSim's number of the frame north, east, down; the initial heading is north
_STRONGEST = 100.0  # m/s
_TURBULENCE = "atmosphere/turbulence/milspec/"
_MODELS = {"milspec": 3.0, "tustin": 4.0}


class Wind(Section):
    """Velocity of the air over time, straight between: tail wind and updraught positive."""

    time: list[float] = quantity("s", min_length=1)
    along: list[float] = quantity("m_per_s")
    up: list[float] | None = quantity("m_per_s", None)


class Gust(Section):
    """A discrete gust: the velocity of its air, positive as a tail wind, from the left, upwards."""

    at: float = quantity("s", ge=0, le=7200)
    rise: float = quantity("s", gt=0, le=7200)
    hold: float = quantity("s", 0.0, ge=0, le=7200)
    fall: float | None = quantity("s", None, gt=0, le=7200)
    along: float = quantity("m_per_s", 0.0, ge=-_STRONGEST, le=_STRONGEST)
    across: float = quantity("m_per_s", 0.0, ge=-_STRONGEST, le=_STRONGEST)
    up: float = quantity("m_per_s", 0.0, ge=-_STRONGEST, le=_STRONGEST)


class Turbulence(Section):
    """Turbulence from the start on."""

    model: Literal["milspec", "tustin"] = "milspec"
    wind_at_6m: float = quantity("m_per_s", ge=0, le=50)
    severity: int = quantity("", 3, ge=1, le=7)


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


def check_gust(gust: Gust, file: object) -> None:
    """Refuse a gust of zero velocity."""
    if gust.along == gust.across == gust.up == 0.0:
        problem = "moves no air: give along_m_per_s, across_m_per_s or up_m_per_s"
        raise InputError(file, "gust", problem)


def gust_properties(gust: Gust) -> dict[str, float]:
    """Return JSBSim's properties of a gust, in ft and s, without its start."""
    velocity = (gust.along / FOOT_m, gust.across / FOOT_m, -gust.up / FOOT_m)
    values = {
        "startup-duration-sec": gust.rise,
        "steady-duration-sec": gust.hold,
        "end-duration-sec": gust.rise if gust.fall is None else gust.fall,
        "magnitude-ft_sec": math.hypot(*velocity),
        "frame": _LOCAL,
        **{f"{way}-velocity-ft_sec": v for way, v in zip("XYZ", velocity, strict=True)},
    }
    return {GUST + name: value for name, value in values.items()}


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


class DiscreteGust(Wrapper):
    """A run's discrete gust, started at its time; `file` is the file of its section."""

    def __init__(self, gust: Gust, file: object, frame_s: float) -> None:
        self._gust, self._file, self._frame_s = gust, file, frame_s

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Set the gust in JSBSim, and return a hook that starts it in its frame."""
        gust, file = self._gust, self._file
        for name, value in gust_properties(gust).items():
            aircraft.lever(name, file, "gust").set(value)
        start = aircraft.lever(GUST + "start", file, "gust").set
        frame, first = 0, math.ceil(gust.at / self._frame_s - 1e-6)

        def blow() -> None:
            nonlocal frame
            if frame == first:
                start(1.0)
            frame += 1

        return blow


class TurbulentAir(Wrapper):
    """A run's turbulence, drawn from its seed; `file` is the file of its section."""

    def __init__(self, turbulence: Turbulence, file: object, seed: int) -> None:
        self._turbulence, self._file, self._seed = turbulence, file, seed

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Switch on JSBSim's turbulence."""
        values = {
            "atmosphere/randomseed": float(self._seed % 2**31),
            "atmosphere/turb-type": _MODELS[self._turbulence.model],
            _TURBULENCE + "windspeed_at_20ft_AGL-fps": self._turbulence.wind_at_6m / FOOT_m,
            _TURBULENCE + "severity": float(self._turbulence.severity),
        }
        for name, value in values.items():
            aircraft.lever(name, self._file, "turbulence").set(value)
        return None
