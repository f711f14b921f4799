"""A link on a joint, with dry friction or without: a rig, and records by SciPy."""

from __future__ import annotations

import copy
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from tests.support.joined import WHEEL
from tests.support.rigs import BENCH

MASS, DAMPING, WEIGHT_N, ANGLE_rad = 1.0, 0.6, 12.0, 0.4
LOADER = "controls.wheel.loader."
FORCE, MOTION = "wheel_force_N", "wheel_computed_rad"


def pendulum_rig(changes: dict[str, Any] | None = None) -> Rig:
    """Return a wheel without springs that carries a link, `ANGLE_rad` from where it hangs."""
    table: dict[str, Any] = {**BENCH, "controls": {"wheel": copy.deepcopy(WHEEL)}}
    plain: dict[str, Any] = {
        "controls.wheel.schedule.total_gradient_N_per_rad": [0.0, 0.0],
        "controls.wheel.compensation.deflection": False,
        "controls.wheel.compensation.gradient": False,
        "controls.wheel.compensation.bend_rad_per_N": 0.0,
        "controls.wheel.travel_rad": 6.0,
        LOADER + "basic_gradient_N_per_rad": 0.0,
        LOADER + "damping_N_s_per_rad": DAMPING,
        LOADER + "bend_rad_per_N": 0.0,
        LOADER + "gravity_N": WEIGHT_N,
        LOADER + "gravity_angle_rad": ANGLE_rad,
    }
    return rig_from_table(table, "test").changed(plain | (changes or {}))


def swing(times: NDArray[np.float64], push_N: float = 9.0) -> NDArray[np.float64]:
    """Return the angle, rad, under a force of `push_N`·sin 4t from rest."""

    def motion(t: float, state: Any) -> list[float]:
        x, v = state
        push = push_N * math.sin(4.0 * t)
        return [v, (push - DAMPING * v - WEIGHT_N * math.sin(x + ANGLE_rad)) / MASS]

    span = (float(times[0]), float(times[-1]))
    return np.asarray(
        solve_ivp(motion, span, [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12).y[0]
    )


def moved(
    seconds: float = 20.0,
    rate_Hz: float = 100.0,
    friction_N: float = 0.0,
    size: float = 1.0,
    most_rad: float = 1.5,
    pace: float = 1.0,
) -> Record:
    """Return a record of the joint moved by a drive, all forces times `size`, with sensor noise.

    `pace` is the factor on the motion's frequencies of 0.5 and 1.1 Hz.
    """
    rng = np.random.default_rng(5)
    times = np.arange(round(seconds * rate_Hz)) / rate_Hz
    place, speed, gain = np.zeros((3, len(times)))
    for share, turn, phase in ((0.7, 3.0 * pace, 0.0), (0.3, 7.1 * pace, 1.0)):
        wave = most_rad * share * np.exp(1j * (turn * times + phase))
        place += wave.imag
        speed += turn * wave.real
        gain -= turn**2 * wave.imag
    force = MASS * gain + DAMPING * speed + friction_N * np.sign(speed)
    force += WEIGHT_N * np.sin(place + ANGLE_rad) + rng.normal(0.0, 0.02, len(times))
    read = (times, size * force, place + rng.normal(0.0, 1e-5, len(times)))
    return Record(("time_s", FORCE, "wheel_deflection_rad"), np.column_stack(read))


def moved_rig(size: float = 1.0, rate_Hz: float = 100.0) -> Rig:
    """Return the rig of the moved joint as filed: without its weight, all forces times `size`."""
    return pendulum_rig(
        {
            "frame_rate_Hz": rate_Hz,
            "controls.wheel.drive": "displacement",
            LOADER + "servo_frequency_Hz": 0.0,
            LOADER + "mass_kg": size * MASS,
            LOADER + "damping_N_s_per_rad": size * DAMPING,
            LOADER + "gravity_N": 0.0,
            LOADER + "gravity_angle_rad": 0.0,
        }
    )
