"""The frequency response of an aircraft to one of its controls, found by flying it.

Two separate aircraft are flown from the trim, one with a small sine on the surface's command and
one with its negative, faded in. The response is half the difference of their motions, with drift
removed. So it includes everything between command and surface, and even nonlinearities cancel.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import STILL
from coupled.record.channels import (
    ALTITUDE,
    HEADING,
    LOAD,
    PITCH,
    PRESSURE,
    ROLL,
    SIDESLIP,
    SPEED,
    ControlName,
)
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.schema import changed

Floats = NDArray[np.float64]

_SIZE = 0.004  # of the command: within the linear range, and far above rounding
_FADE, _WAIT, _MEASURED = 2.0, 2.0, 4.0  # periods
_LEAST_WAIT_s = 10.0  # decay of the short period of the slowest aircraft here
_DRIFT = 3  # order of the polynomial that removes drift


class Response(NamedTuple):
    """The response of the motion to a unit of a surface's command, JSBSim's ±1, at one frequency.

    Roll, heading and sideslip are 0 on a rig without wheel and pedals, which does not read them.
    """

    pitch: complex  # rad
    flight_path: complex  # rad, over the frame before (`path_angle`)
    airspeed: complex  # true, m/s
    load_factor: complex
    pressure_Pa: float  # q̄ of the trim
    roll: complex = 0j  # rad
    heading: complex = 0j  # rad
    sideslip: complex = 0j  # rad


def elevator_response(
    flight: Flight,
    frame_s: float,
    controls: tuple[ControlName, ...],
    file: object,
    rate_rad_per_s: float,
) -> Response:
    """Return the response of an aircraft to its elevator, in still air."""
    return control_response(flight, frame_s, controls, "column", file, rate_rad_per_s)


def control_response(
    flight: Flight,
    frame_s: float,
    controls: tuple[ControlName, ...],
    control: ControlName,
    file: object,
    rate_rad_per_s: float,
) -> Response:
    """Return the response of an aircraft to the surface of one of its controls, in still air.

    The command is set once a frame; the motion of row k is read before that of row k acts.
    """
    still = changed(flight, STILL, file)
    moved = controls.index(control)
    return _response(still.model_dump_json(), frame_s, controls, moved, file, rate_rad_per_s)


@lru_cache(maxsize=64)
def _response(
    flight_json: str,
    frame_s: float,
    controls: tuple[ControlName, ...],
    moved: int,
    file: object,
    rate: float,
) -> Response:
    flight = Flight.model_validate_json(flight_json)
    period = 2.0 * math.pi / rate
    wait = max(_LEAST_WAIT_s, (_FADE + _WAIT) * period)
    times = np.arange(round((wait + _MEASURED * period) / frame_s)) * frame_s
    fade = np.sin(0.5 * np.pi * np.clip(times / (_FADE * period), 0.0, 1.0)) ** 2
    command = _SIZE * fade * np.sin(rate * times)
    planes = [_aircraft(flight, frame_s, controls, file) for _ in "+-"]
    pressure_Pa = planes[0].motion()[PRESSURE]
    up = _fly(planes[0], command, moved, frame_s)
    down = _fly(planes[1], -command, moved, frame_s)
    late = times >= wait
    t = times[late]
    drift = np.polynomial.chebyshev.chebvander(np.linspace(-1.0, 1.0, t.size), _DRIFT)
    basis = np.column_stack((np.sin(rate * t), np.cos(rate * t), drift))
    found = np.linalg.lstsq(basis, 0.5 * (up - down)[late], rcond=None)[0]
    answer = [complex(x) for x in (found[0] + 1j * found[1]) / _SIZE]
    pitch, path, speed, load = answer[:4]
    roll, heading, sideslip = answer[4:] if len(answer) > 4 else (0j, 0j, 0j)
    return Response(pitch, path, speed, load, pressure_Pa, roll, heading, sideslip)


def _aircraft(
    flight: Flight, frame_s: float, controls: tuple[ControlName, ...], file: object
) -> JSBSimAirframe:
    return make_aircraft(flight, frame_s, controls, [aircraft_folder()], file)


def _fly(airframe: JSBSimAirframe, command: Floats, moved: int, frame_s: float) -> Floats:
    """Return the motion of a `Response` under a surface's command, a row for each frame."""
    lateral = len(airframe.motion()) > max(ROLL, HEADING, SIDESLIP)
    rows = np.zeros((command.size, 7 if lateral else 4))
    before = airframe.motion()[ALTITUDE]
    commands = [0.0, 0.0, 0.0]
    for row, value in zip(rows, command.tolist(), strict=True):
        motion = airframe.motion()
        path = path_angle(motion, before, frame_s)
        before = motion[ALTITUDE]
        row[:4] = motion[PITCH], path, motion[SPEED], motion[LOAD]
        if lateral:
            row[4:] = motion[ROLL], motion[HEADING], motion[SIDESLIP]
        commands[moved] = value
        airframe.step((commands[0], commands[1], commands[2]))
    if lateral:
        rows[:, 5] = np.unwrap(rows[:, 5])
    return rows


def path_angle(motion: tuple[float, ...], altitude_before_m: float, frame_s: float) -> float:
    """Return the flight path's angle over the frame before, rad, up positive."""
    climb = (motion[ALTITUDE] - altitude_before_m) / frame_s
    return math.asin(min(max(climb / max(motion[SPEED], 1.0), -1.0), 1.0))
