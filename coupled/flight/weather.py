"""Gusts and turbulence of a run: JSBSim's own, told in SI and drawn from the run's seed.

A gust is air that moves as (1 − cos(π·t/rise))/2 of its velocity, holds it, and comes to rest in
the same way. Turbulence is JSBSim's: `milspec`, MIL-F-8785C by its discrete approximation, or
`tustin`, the same spectra by Tustin's rule; below 1000 ft above the ground its strength is that
of the wind at 20 ft, above 2000 ft that of a severity. It shakes all axes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

from coupled.errors import InputError
from coupled.flight.airframe import JSBSimAirframe
from coupled.schema import Section, quantity
from coupled.units import FOOT_m

Step = Callable[[tuple[float, float, float]], None]
_GUST = "atmosphere/cosine-gust/"
_LOCAL = 3.0  # JSBSim's number of the frame north, east, down; the aircraft starts northwards
_STRONGEST = 100.0  # m/s
_TURBULENCE = "atmosphere/turbulence/milspec/"
_MODELS = {"milspec": 3.0, "tustin": 4.0}


class Gust(Section):
    """A discrete gust: how fast the air then moves, a tail wind, from the left, and upwards."""

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


def check_gust(gust: Gust, file: object) -> None:
    """Refuse a gust of no air."""
    if gust.along == gust.across == gust.up == 0.0:
        problem = "moves no air: give along_m_per_s, across_m_per_s or up_m_per_s"
        raise InputError(file, "gust", problem)


def gusting(airframe: JSBSimAirframe, gust: Gust, file: object, frame_s: float) -> Step:
    """Return the aircraft's step, with the gust let go at its time."""
    velocity = (gust.along / FOOT_m, gust.across / FOOT_m, -gust.up / FOOT_m)
    values = {
        "startup-duration-sec": gust.rise,
        "steady-duration-sec": gust.hold,
        "end-duration-sec": gust.rise if gust.fall is None else gust.fall,
        "magnitude-ft_sec": math.hypot(*velocity),
        "frame": _LOCAL,
        **{f"{axis}-velocity-ft_sec": speed for axis, speed in zip("XYZ", velocity, strict=True)},
    }
    for name, value in values.items():
        airframe.lever(_GUST + name, file, "gust").set(value)
    start = airframe.lever(_GUST + "start", file, "gust")
    step, frame, first = airframe.step, 0, math.ceil(gust.at / frame_s - 1e-6)

    def run(commands: tuple[float, float, float], /) -> None:
        nonlocal frame
        if frame == first:
            start.set(1.0)
        frame += 1
        step(commands)

    return run


def stir(airframe: JSBSimAirframe, turbulence: Turbulence, file: object, seed: int) -> None:
    """Let the air be turbulent, by a seed."""
    values = {
        "atmosphere/randomseed": float(seed % 2**31),
        "atmosphere/turb-type": _MODELS[turbulence.model],
        _TURBULENCE + "windspeed_at_20ft_AGL-fps": turbulence.wind_at_6m / FOOT_m,
        _TURBULENCE + "severity": float(turbulence.severity),
    }
    for name, value in values.items():
        airframe.lever(name, file, "turbulence").set(value)
