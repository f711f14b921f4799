"""Trim by Newton's method: angle of attack, thrust and elevator together.

JSBSim's own trim pairs the thrust with the acceleration along the nose, and solves one after the
other. This fails if the thrust mostly lifts, as through nozzles that point down. Here all three are
varied together until the three accelerations of the plane of symmetry vanish. The aircraft is
assumed symmetric: no roll, no sideslip, ailerons and rudder at neutral.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.flight.imbalance import imbalance
from coupled.rig.parameters import Flight
from coupled.units import KNOT_m_per_s

Floats = NDArray[np.float64]
_ACCELERATIONS = (
    "accelerations/udot-ft_sec2",
    "accelerations/wdot-ft_sec2",
    "accelerations/qdot-rad_sec2",
)
_LOW, _HIGH = np.array([-0.35, 0.0, -1.0]), np.array([0.5, 1.0, 1.0])
_STEPS = np.array([1e-4, 1e-3, 1e-3])
_STARTS = (0.7, 0.4)  # throttles; the second is tried if the first leads out of bounds
_STILL = 1e-7  # ft/s² and rad/s²


Elevators = Sequence[tuple[float, Callable[[float], object]]]  # sign and setter of each command


def newton_trim(
    fdm: Any,
    flight: Flight,
    elevators: Elevators | None = None,
    start_alpha_rad: float = 0.07,
) -> str:
    """Trim a loaded aircraft on its flight path; return why it cannot be, or an empty string.

    `elevators` set the commands of the pitch control, by default `fcs/elevator-cmd-norm`. Altitude,
    flaps and the rig's other settings must be set before. Dynamic systems are kept at their steady
    state.
    """
    if elevators is None:
        elevators = [(1.0, partial(fdm.set_property_value, "fcs/elevator-cmd-norm"))]
    fdm.set_trim_status(True)
    try:
        for throttle in _STARTS:
            start = np.array([start_alpha_rad, throttle, 0.0])
            problem = _search(fdm, flight, elevators, start)
            if not problem:
                break
        return problem
    finally:
        fdm.set_trim_status(False)


def _search(fdm: Any, flight: Flight, elevators: Elevators, found: Floats) -> str:
    for _ in range(40):
        left = _accelerations(fdm, flight, elevators, found)
        if not np.all(np.isfinite(left)):
            return "its state is not finite"
        if np.max(np.abs(left)) < _STILL:
            return ""
        slopes = np.empty((3, 3))
        for i in range(3):
            step = np.where(np.arange(3) == i, _STEPS, 0.0)
            up = _accelerations(fdm, flight, elevators, found + step)
            down = _accelerations(fdm, flight, elevators, found - step)
            slopes[:, i] = (up - down) / (2.0 * _STEPS[i])
        if not np.all(np.isfinite(slopes)) or abs(np.linalg.det(slopes)) < 1e-12:
            return "angle of attack, throttle and elevator are not separable"
        move = np.linalg.solve(slopes, -left)
        move *= min(1.0, 0.1 / float(np.max(np.abs(move))))
        found = np.clip(found + move, _LOW, _HIGH)
    return "no balance is found"


def why_unbalanced(fdm: Any, flight: Flight, elevators: Elevators) -> str:
    """Return which accelerations stay, with which control at its limit (`imbalance`).

    Empty if there is a balance. The aircraft must be loaded as for `newton_trim`.
    """
    fdm.set_trim_status(True)
    try:
        return imbalance(partial(_accelerations, fdm, flight, elevators), _LOW, _HIGH)
    finally:
        fdm.set_trim_status(False)


def _accelerations(fdm: Any, flight: Flight, elevators: Elevators, point: Floats) -> Floats:
    alpha, throttle, elevator = (float(x) for x in point)
    fdm["ic/vc-kts"] = flight.calibrated_airspeed / KNOT_m_per_s
    fdm["ic/alpha-rad"] = alpha
    fdm["ic/gamma-deg"] = math.degrees(flight.flight_path)
    for engine in range(fdm.get_propulsion().get_num_engines()):
        fdm[f"fcs/throttle-cmd-norm[{engine}]"] = throttle
    for sign, set_command in elevators:
        set_command(sign * elevator)
    for _ in range(3):  # the rate of the angle of attack, which damps, depends on the result
        fdm.run_ic()
    return np.array([fdm[name] for name in _ACCELERATIONS])
