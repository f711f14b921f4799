"""Faults of real rigs outside the library, which a diagnosis should report as unexplained."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from coupled.blind.twin.effects import added, drifting
from coupled.blind.twin.kinds import ALPHA, RATE, SPEED, Clean, Draw, Found, Install, Kind
from coupled.blind.twin.revision2 import load_friction, ripple
from coupled.blind.twin.twin import Twin


def _quadratic(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    value = size / clean.speed("column_computed_m") ** 2
    twin.set(quadratic_damping=value)
    return {"quadratic_N_s2_per_m2": value}


def _second_mass(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Put a part of the loader's mass on a spring of its own."""
    mass, rate = size * clean.loader.mass, 2.0 * math.pi * (1.0 + 2.5 * draw.u[0])
    stiffness, ratio = mass * rate**2, 0.02 + 0.05 * draw.u[1]
    twin.set(second_mass=mass, second_stiffness=stiffness)
    twin.set(second_damping=2.0 * ratio * mass * rate)
    return {"mass_kg": mass, "frequency_Hz": rate / (2.0 * math.pi)}


def _hysteresis(field: str, name: str) -> Install:
    """Return an installer of a hysteresis by the force."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        width = clean.peak("column_force_N") * (0.1 + 0.3 * draw.u[0])
        twin.set(**{field: size}, loop_yield=width)
        return {name: size, "yield_N": width}

    return install


def _hum(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    rate = 1.0 + 5.0 * draw.u[0]
    twin.set(hum_force=size, hum_rate=2.0 * math.pi * rate)
    return {"force_N": size, "frequency_Hz": rate}


def _bend_uneven(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    value = draw.side * size / max(clean.peak("column_force_N"), 1.0)
    twin.set(bend_uneven=value)
    return {"uneven_m_per_N": value}


def _read_square(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    value = draw.side * size / clean.peak("column_deflection_m") ** 2
    twin.set(read_square=value)
    return {"square_per_m": value}


def _flutter(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    rate = 0.5 + 3.0 * draw.u[0]
    twin.set(flutter=size, flutter_rate=2.0 * math.pi * rate)
    return {"amplitude_norm": size, "frequency_Hz": rate}


def _moment(name: str, law: Callable[[float, Sequence[float], Clean], float]) -> Install:
    """Return an installer of a moment, in elevator command, over time and change of motion."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        value = draw.side * size
        twin.air.moment = lambda time, change: value * law(time, change, clean)
        return {name: value}

    return install


def _tent(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Make the table wrong around one point, within the q̄ of the record."""
    span = clean.spread("dynamic_pressure_Pa")
    at = clean.mean("dynamic_pressure_Pa") + (draw.u[0] - 0.5) * 0.4 * span
    height, width = draw.side * size, max(0.2 * span, 5.0)
    twin.set(tent_height=height, tent_at=at, tent_width=width)
    return {"height": height, "at_Pa": at, "width_Pa": width}


def _pressure_play(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    width = size * clean.spread("dynamic_pressure_Pa")
    twin.set(pressure_play=width)
    return {"width_Pa": width}


OUTSIDERS = (
    Kind("load_friction", "loader", 1e-3, 0.3, load_friction("share")),
    Kind("cogging", "loader", 0.05, 15.0, ripple("force_N", "pitch_m")),
    Kind("quadratic_damping", "loader", 0.1, 40.0, _quadratic),
    Kind("second_mass", "loader", 0.01, 0.6, _second_mass),
    Kind("gauge_loop", "loader", 0.05, 15.0, _hysteresis("gauge_loop", "loop_N")),
    Kind("periodic_force", "loader", 0.05, 15.0, _hum),
    Kind("gradient_drift", "loader", 0.005, 0.6, drifting("gradient_drift", "share_per_s")),
    Kind("bend_loop", "linkage", 2e-5, 4e-3, _hysteresis("bend_loop", "loop_m")),
    Kind("bend_uneven", "linkage", 2e-5, 8e-3, _bend_uneven),
    Kind("transducer_square", "linkage", 2e-5, 8e-3, _read_square),
    Kind("transducer_drift", "linkage", 2e-5, 8e-3, drifting("read_drift", "drift_m_per_s")),
    Kind(
        *("uneven_gain", "surface", 0.001, 0.5),
        added("surface_uneven", "uneven_share", signed=True),
        flown=True,
    ),
    Kind("dead_zone", "surface", 1e-4, 0.08, added("dead_zone", "half_width_norm"), flown=True),
    Kind("flutter", "surface", 1e-4, 0.06, _flutter, flown=True),
    Kind(
        *("moment_drift", "airframe", 5e-4, 0.1),
        _moment("command_norm", lambda time, change, clean: time / clean.seconds),
        flown=True,
    ),
    Kind(
        *("moment_of_alpha", "airframe", 0.01, 1.0),
        _moment("command_per_rad", lambda time, change, clean: change[ALPHA]),
        flown=True,
    ),
    Kind(
        *("moment_of_speed", "airframe", 0.002, 0.5),
        _moment(
            "command_per_share",
            lambda time, change, clean: change[SPEED] / clean.mean("true_airspeed_m_per_s"),
        ),
        flown=True,
    ),
    Kind(
        *("moment_of_rate_squared", "airframe", 0.1, 50.0),
        _moment(
            "command_s2_per_rad2", lambda time, change, clean: abs(change[RATE]) * change[RATE]
        ),
        flown=True,
    ),
    Kind("gradient_steps", "schedule", 0.5, 400.0, added("gradient_step", "step_N_per_m")),
    Kind("wrong_knot", "schedule", 5e-4, 0.3, _tent),
    Kind("schedule_hysteresis", "schedule", 0.005, 0.8, _pressure_play),
)
