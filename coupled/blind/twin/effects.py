"""The library's effects in the twin, by the names and units of a diagnosis."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from coupled.blind.twin.kinds import Clean, Draw, Found, Install, Kind
from coupled.blind.twin.twin import Twin, first_order, set_friction


def scaled(*fields: str) -> Install:
    """Return an installer of a factor exp(±size) on the twin's numbers."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        factor = math.exp(draw.side * size)
        for name in fields:
            twin.set(**{name: twin.get(name) * factor})
        return {"factor": factor}

    return install


def added(field: str, name: str, signed: bool = False) -> Install:
    """Return an installer of a number added to the twin's."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        value = size * (draw.side if signed else 1.0)
        twin.set(**{field: twin.get(field) + value})
        return {name: value}

    return install


def drifting(field: str, name: str) -> Install:
    """Return an installer of a number's rate, by its change over the record, with random sign."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        rate = draw.side * size / clean.seconds
        twin.set(**{field: rate})
        return {name: rate}

    return install


def _lagged(field: str) -> Install:
    """Return an installer of a first-order lag of the size, s, by its gain in a frame."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        twin.set(**{field: first_order(size, twin.get("frame_s"))})
        return {"lag_s": size}

    return install


def _coulomb(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    running = clean.loader.friction + size
    set_friction(twin, running, clean.loader.breakaway, clean.loader.stribeck_rate, clean.bristles)
    return {"friction_N": size}


def _stribeck(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    more = size * (0.3 + 0.5 * draw.u[0])
    running = clean.loader.friction + more
    breakaway = running + size * (0.6 + 1.4 * draw.u[1])
    set_friction(twin, running, breakaway, 0.001 * 6.0 ** draw.u[2], clean.bristles)
    return {"friction_N": more, "breakaway_N": breakaway}


def _cubic(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    share = size * clean.mean("column_gradient_N_per_m")
    value = share / max(clean.peak("column_computed_m"), 1e-3) ** 2
    twin.set(cubic=clean.loader.cubic + value)
    return {"cubic_N_per_m3": value}


def _digital(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    twin.set(digital=1)
    return {}


def _bend(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    nominal = clean.loader.bend
    bend = nominal * math.exp(draw.side * size) if nominal > 0.0 else 1e-4 * size
    twin.set(bend=bend)
    return {"bend_m_per_N": bend}


def _stiffening(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Saturate the bend; a rig filed as rigid gets a bend first.

    At full force K·F is smaller by about size²/3. K itself deviates by no more, since with a far
    limit the trial would be of a plain bend.
    """
    nominal = clean.loader.bend
    off = (draw.u[0] - 0.5) * min(0.4, 0.6 * size**2)
    bend = nominal * (1.0 + off) if nominal > 0.0 else 1e-4 * size
    bent = bend * clean.peak("column_force_N")
    limit = bent / (size if nominal > 0.0 else 0.8 + 1.2 * draw.u[1])
    twin.set(bend=bend, bend_limit=limit)
    return {"bend_m_per_N": bend, "limit_m": limit}


def _servo_limit(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    limit = clean.speed("column_computed_m") * math.exp(0.3 - size)
    twin.set(servo_limit=limit)
    return {"rate_m_per_s": limit}


def _arc(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    twin.set(arc=clean.rig.controls["column"].length)
    return {}


def _stretch(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    loss = size / clean.mean("dynamic_pressure_Pa")
    twin.set(stretch=loss)
    return {"loss_per_Pa": loss}


def _surface_limit(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    fastest = clean.speed("column_estimate_m") / clean.rig.controls["column"].travel
    limit = fastest * math.exp(0.3 - size)
    twin.set(rate_step=limit * twin.get("frame_s"))
    return {"rate_norm_per_s": limit}


def in_air(field: str) -> Install:
    """Return an installer of a factor exp(±size) on a value of the rig's flight."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        factor = twin.air.factors[field] = math.exp(draw.side * size)
        return {"factor": factor}

    return install


def _gust(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Add vertical gusts with the Dryden spectrum, MIL-F-8785C, of a length of 50 to 300 m."""
    length = 50.0 * 6.0 ** draw.u[0]
    speed = clean.mean("true_airspeed_m_per_s")
    gust = dryden(len(clean.record), clean.rig.frame_rate, size, length / speed, draw.seed)
    twin.air.gust = gust
    return {"rms_m_per_s": float(np.std(gust))}


def dryden(
    frames: int, frame_rate_Hz: float, rms: float, time_s: float, seed: int
) -> NDArray[np.float64]:
    """Return the air's vertical speed, m/s, shape (frames,): filtered white noise.

    H(s) = (1 + √3·T·s)/(1 + T·s)², T = L/V, discretised by the bilinear rule.
    """
    c = 2.0 * frame_rate_Hz * time_s
    r3 = math.sqrt(3.0)
    up = np.array([1.0 + r3 * c, 2.0, 1.0 - r3 * c])
    down = np.convolve([1.0 + c, 1.0 - c], [1.0 + c, 1.0 - c])
    rng = np.random.default_rng(seed)
    warm = round(8.0 * time_s * frame_rate_Hz)
    blown = lfilter(up, down, rng.standard_normal(frames + warm))[warm:]
    # Unit density gives ∫|H|²df = 1/T, two-sided; a sample has the density 1/rate.
    blown *= rms * math.sqrt(frame_rate_Hz * time_s)
    rise = np.clip(np.arange(frames) / frame_rate_Hz, 0.0, 1.0)  # still air at trim
    return np.asarray(blown * rise)


# In trials without effects, deviations within the tolerance are smaller, and no effects.
BEYOND = 0.03

EFFECTS = (
    Kind("coulomb_friction", "loader", 0.03, 15.0, _coulomb),
    Kind("stribeck_friction", "loader", 0.03, 12.0, _stribeck),
    Kind("viscous_damping", "loader", BEYOND, 1.0, scaled("damping")),
    Kind("inertia", "loader", BEYOND, 1.0, scaled("mass")),
    Kind("gradient_error", "loader", 0.001, 0.4, scaled("basic_gradient")),
    Kind("cubic_stiffness", "loader", 0.0005, 1.0, _cubic),
    Kind("breakout", "loader", 0.03, 15.0, added("breakout", "breakout_N")),
    Kind("bob_weight", "loader", 0.1, 40.0, added("bob_weight", "force_N_per_g"), flown=True),
    Kind("force_offset", "loader", 0.02, 20.0, added("offset", "offset_N", signed=True)),
    Kind("digital_multiplier", "loader", 1.0, 1.0, _digital),
    Kind("transport_delay", "loader", 0.0005, 0.15, added("delay", "delay_s")),
    Kind("modifying_lag", "loader", 0.0002, 0.3, added("modifying_lag", "lag_s")),
    Kind("deflection_scale", "sensing", 0.0005, 0.15, scaled("deflection_scale")),
    Kind("bend", "linkage", 0.005, 1.2, _bend),
    Kind("stiffening_bend", "linkage", 0.05, 3.0, _stiffening),
    Kind("backlash", "linkage", 2e-5, 4e-3, added("play", "play_m")),
    Kind("servo_lag", "linkage", BEYOND, 1.2, scaled("servo_rate")),
    Kind("servo_rate_limit", "linkage", 0.05, 2.5, _servo_limit),
    Kind("arc_geometry", "linkage", 1.0, 1.0, _arc),
    Kind("cable_stretch", "surface", 0.0005, 0.6, _stretch, flown=True),
    Kind("surface_lag", "surface", 0.0005, 0.6, _lagged("lag_gain"), flown=True),
    Kind("surface_rate_limit", "surface", 0.05, 2.5, _surface_limit, flown=True),
    Kind("surface_freeplay", "surface", 1e-4, 0.06, added("surface_play", "play_norm"), flown=True),
    Kind(
        *("rigging_offset", "surface", 1e-4, 0.06),
        added("surface_offset", "offset_norm", signed=True),
        flown=True,
    ),
    Kind(
        *("elevator_effectiveness", "airframe", 0.005, 0.5, in_air("elevator_effectiveness")),
        flown=True,
    ),
    Kind("pitch_damping", "airframe", 0.01, 1.0, in_air("pitch_damping"), flown=True),
    Kind("vertical_gust", "airframe", 0.01, 3.0, _gust, flown=True),
    Kind("pressure_lag", "schedule", 0.01, 3.0, _lagged("pressure_gain")),
    Kind("pressure_scale", "schedule", 0.0005, 0.25, scaled("pressure_scale")),
    Kind("schedule_slope", "schedule", 0.0005, 0.4, scaled("slope")),
)
