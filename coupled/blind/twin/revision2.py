"""The effects of the contract's second revision in the twin.

Friction is in newtons above the nominal one here too, as in `coulomb_friction`; a bend is the whole
real one.
"""

from __future__ import annotations

import math

import numpy as np

from coupled.blind.twin.effects import added, drifting, in_air, scaled
from coupled.blind.twin.kernel import STEPS
from coupled.blind.twin.kinds import Clean, Draw, Found, Install, Kind
from coupled.blind.twin.numbers import KEPT
from coupled.blind.twin.twin import Bristles, Twin, set_bristles, set_friction

CONTACT_s = 2e-3  # damping over stiffness of a backlash's contact
OF_SERVO = (
    *("servo_lag", "servo_delay", "servo_tuning", "servo_rate_limit"),
    "servo_acceleration_limit",
)
STIFF_BEND_m_per_N = 1e-4  # bend of a rig filed as rigid, times the size


def _presliding(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Add presliding friction with a length of 50 to 500 μm."""
    travel = 5e-5 * 10.0 ** draw.u[0]
    bristles = Bristles(travel, elastic_share=clean.bristles.elastic_share or 0.3)
    loader = clean.loader
    running = loader.friction + size
    set_friction(twin, running, loader.breakaway, loader.stribeck_rate, bristles)
    return {"friction_N": size, "stiffness_N_per_m": twin.get("bristle")}


def _asymmetric(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Add friction in one direction of motion, and up to six tenths of it in the other."""
    less = 0.6 * draw.u[0] * size
    pull, push = (size, less) if draw.side > 0.0 else (less, size)
    twin.set(pull_friction=pull, push_friction=push)
    set_bristles(twin, clean.loader.friction + 0.5 * (pull + push), clean.bristles)
    return {"pull_N": pull, "push_N": push}


def load_friction(name: str) -> Install:
    """Return an installer of friction by load, a share of the force."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        twin.set(load_friction=size)
        level = clean.loader.friction + size * clean.peak("column_force_N")
        set_bristles(twin, level, clean.bristles)
        return {name: size}

    return install


def ripple(force: str, period: str) -> Install:
    """Return an installer of a force that is periodic in δc; the names are of its parameters."""

    def install(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
        pitch = clean.peak("column_computed_m") * (0.15 + 0.35 * draw.u[0])
        twin.set(cog_force=size, cog_pitch=pitch)
        return {force: size, period: pitch}

    return install


def _relaxation(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    stiffness = size * clean.mean("column_gradient_N_per_m")
    time = 0.1 * 30.0 ** draw.u[0]
    twin.set(relaxing=stiffness, relaxing_s=time)
    return {"stiffness_N_per_m": stiffness, "time_s": time}


def _force_limit(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    limit = max(clean.peak("column_modifying_force_N"), 0.1) * math.exp(0.3 - size)
    twin.set(force_limit=limit)
    return {"limit_N": limit}


def _servo_delay(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Delay the servo's δc; the servo itself is as filed, so its frequency's factor is 1."""
    assert size < (KEPT - 2) / STEPS * twin.get("frame_s")
    twin.set(servo_delay=size)
    return {"delay_s": size, "factor": 1.0}


def _servo_push(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Limit the servo's acceleration to that of the fastest motions, or less."""
    step, rate_Hz = 6, clean.rig.frame_rate
    way = clean.record["column_computed_m"][::step]
    asked = np.abs(np.diff(way, 2)) * (rate_Hz / step) ** 2
    limit = max(float(np.percentile(asked, 99.0)), 1e-2) * math.exp(0.3 - size)
    twin.set(servo_push=limit)
    return {"acceleration_m_per_s2": limit}


def _servo_tuning(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Delay the δc of a servo with other tuning."""
    factor, damping = math.exp(draw.side * size), math.exp((draw.u[0] - 0.5) * size)
    twin.set(servo_delay=0.1 * size, servo_rate=twin.get("servo_rate") * factor)
    twin.set(servo_ratio=twin.get("servo_ratio") * damping)
    return {"delay_s": 0.1 * size, "factor": factor, "damping_factor": damping}


def _no_servo(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    twin.set(servo_rate=0.0)
    return {}


def _stops(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Stop the loader within its motion: one side by the size, the other by a part of it."""
    moved = clean.record["column_computed_m"]
    ends = float(np.max(moved)), float(-np.min(moved))
    shares = (1.0, draw.u[0]) if draw.side > 0.0 else (draw.u[0], 1.0)
    travel = clean.rig.controls["column"].travel
    aft, forward = (
        end / (1.0 + share * size) if end > 0.0 else travel
        for end, share in zip(ends, shares, strict=True)
    )
    twin.set(aft=aft, forward=forward)
    return {"aft_m": aft, "forward_m": forward}


def _mode(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Give the structure a mass: a lightly damped mode of 2/size hertz."""
    bend = clean.loader.bend or STIFF_BEND_m_per_N * size
    bend *= 1.0 + 0.2 * (draw.u[0] - 0.5)
    frequency = 2.0 / size
    twin.set(bend=bend, mode_rate=2.0 * math.pi * frequency, mode_ratio=0.03 + 0.05 * draw.u[1])
    return {"bend_m_per_N": bend, "frequency_Hz": frequency}


def _bend_hysteresis(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    bend = clean.loader.bend or STIFF_BEND_m_per_N * size
    width = clean.peak("column_force_N") * (0.1 + 0.3 * draw.u[0])
    twin.set(bend=bend, bend_share=size, bend_width=width)
    return {"bend_m_per_N": bend, "share": size, "width_N": width}


def _soft_backlash(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Hold the grip in its backlash by a contact that deflects by 0.2 to 1 play at full force."""
    stiffness = clean.peak("column_force_N") / (size * (0.2 + 0.8 * draw.u[0]))
    twin.set(play=size, contact=stiffness, contact_s=CONTACT_s)
    return {"play_m": size, "stiffness_N_per_m": stiffness}


def _force_skew(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    late = twin.get("force_late") + size
    twin.set(force_late=late)
    return {"delay_s": late}


def _motion_skew(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    twin.air.late_s += size
    return {"delay_s": twin.air.late_s}


def _hum(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    """Add a tone near 50 Hz, or in one of three near 60 Hz, to δc as read."""
    mains = 50.0 if draw.u[0] < 2.0 / 3.0 else 60.0
    frequency = mains + 0.4 * (draw.u[1] - 0.5)
    twin.set(tone=size, tone_rate=2.0 * math.pi * frequency, tone_phase=2.0 * math.pi * draw.u[2])
    return {"amplitude_m": size, "frequency_Hz": frequency}


def _dropped(twin: Twin, clean: Clean, size: float, draw: Draw) -> Found:
    twin.set(missed_share=size, missed_seed=float(draw.seed % 1000) + 0.5)
    return {"share": size}


REVISION_2 = (
    Kind("presliding_friction", "loader", 0.03, 15.0, _presliding),
    Kind("asymmetric_friction", "loader", 0.03, 15.0, _asymmetric),
    Kind("load_friction", "loader", 1e-3, 0.3, load_friction("factor")),
    Kind("friction_ripple", "loader", 0.05, 15.0, ripple("ripple_N", "period_m")),
    Kind("relaxation", "loader", 0.002, 1.0, _relaxation),
    Kind("force_limit", "loader", 0.05, 2.5, _force_limit),
    Kind("crosstalk", "loader", 5e-4, 0.5, added("crosstalk", "factor", signed=True), other=True),
    Kind("structural_mode", "linkage", 0.03, 0.7, _mode),
    Kind("servo_delay", "linkage", 0.001, 0.3, _servo_delay),
    Kind("bend_hysteresis", "linkage", 0.01, 0.8, _bend_hysteresis),
    Kind("soft_backlash", "linkage", 2e-5, 4e-3, _soft_backlash),
    Kind("force_scale", "sensing", 0.0005, 0.15, scaled("force_scale")),
    Kind("force_zero", "sensing", 0.02, 20.0, added("force_zero", "offset_N", signed=True)),
    Kind(
        *("deflection_zero", "sensing", 2e-5, 8e-3),
        added("deflection_zero", "offset_m", signed=True),
    ),
    Kind("scale_drift", "sensing", 0.0005, 0.3, drifting("scale_drift", "per_s")),
    Kind("force_skew", "sensing", 0.001, 0.15, _force_skew),
    Kind("motion_skew", "sensing", 0.001, 0.3, _motion_skew, flown=True, shows="airframe"),
    Kind("mains_hum", "sensing", 1e-5, 3e-3, _hum),
    Kind("pitch_stiffness", "airframe", 0.005, 0.7, in_air("pitch_stiffness"), flown=True),
    Kind("lift_slope", "airframe", 0.002, 0.4, in_air("lift_slope"), flown=True),
    Kind("mass", "airframe", 0.001, 0.3, in_air("mass"), flown=True),
    Kind("servo_acceleration_limit", "linkage", 0.05, 2.5, _servo_push),
    Kind("servo_tuning", "linkage", 0.2, 0.7, _servo_tuning),
    Kind("travel", "loader", 0.01, 4.0, _stops),
    Kind("no_servo", "linkage", 1.0, 1.0, _no_servo, excludes=OF_SERVO),
    Kind("dropped_frames", "compensation", 0.001, 0.5, _dropped, shows="schedule"),
)
