"""Which fault of a rig fails which control check, as docs/calibration.md lists it."""

from __future__ import annotations

import math
import re
from functools import cache
from pathlib import Path

import pytest

from coupled.calibration.documentation import check_feel
from coupled.gap.effects.airframe import AIRFRAME, MOTION_ZEROS
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.rig.rig import Rig
from tests.support.rigs import K_REPORT, bench

# Each fault of the library on the column of a test bench, at a size beyond its tolerance.
FAULTS: dict[str, dict[str, float]] = {
    "coulomb_friction": {"friction_N": 30.0},
    "stribeck_friction": {"friction_N": 25.0, "breakaway_N": 35.0, "stribeck_{d}_per_s": 2e-3},
    "viscous_damping": {"factor": 1.5},
    "inertia": {"factor": 1.5},
    "gradient_error": {"factor": 2.0},
    "cubic_stiffness": {"cubic_N_per_{d}3": 3e4},
    "breakout": {"breakout_N": 15.0},
    "force_offset": {"offset_N": 30.0},
    "modifying_lag": {"lag_s": 0.03},
    "presliding_friction": {"friction_N": 30.0, "stiffness_N_per_{d}": 1e5},
    "asymmetric_friction": {"pull_N": 30.0, "push_N": 10.0},
    "load_friction": {"factor": 0.2},
    "friction_ripple": {"ripple_N": 30.0, "period_{d}": 0.05, "phase_rad": 0.0},
    "relaxation": {"stiffness_N_per_{d}": 3000.0, "time_s": 0.3},
    "force_limit": {"limit_N": 100.0},
    "travel": {"aft_{d}": 0.04, "forward_{d}": 0.06},
    "deflection_scale": {"factor": 1.15},
    "force_scale": {"factor": 1.8},
    "force_zero": {"offset_N": 250.0},
    "deflection_zero": {"offset_{d}": 0.02},
    "scale_drift": {"per_s": 2e-3},
    "bend": {"bend_{d}_per_N": 2.0 * K_REPORT},
    "stiffening_bend": {"bend_{d}_per_N": K_REPORT, "limit_{d}": 5e-3},
    "backlash": {"play_{d}": 0.03},
    "soft_backlash": {"play_{d}": 0.03, "stiffness_N_per_{d}": 1e4},
    "yielding_contact": {"stiffness_N_per_{d}": 1e4},
    "bend_hysteresis": {"bend_{d}_per_N": 1.5 * K_REPORT, "share": 0.5, "width_N": 60.0},
    "structural_mode": {
        "bend_{d}_per_N": 2.0 * K_REPORT,
        "frequency_Hz": 2.0,
        "damping_ratio": 0.05,
    },
    "servo_lag": {"factor": 0.15},
    "servo_rate_limit": {"rate_{d}_per_s": 0.1},
    "servo_acceleration_limit": {"acceleration_{d}_per_s2": 0.5},
    "servo_tuning": {"delay_s": 0.05, "factor": 0.15, "damping_factor": 0.3},
    "pressure_scale": {"factor": 1.4},
    "schedule_slope": {"factor": 0.5},
    "cable_stretch": {"loss_per_Pa": 1e-4},
    "surface_freeplay": {"play_norm": 0.3},
    "rigging_offset": {"offset_norm": 0.2},
}


# Why a static check or a release does not change with the other effects.
UNSEEN = {
    "pressure_lag": "q̄ is constant",
    "bob_weight": "the aircraft does not move",
    **{one.name: "the aircraft does not move" for one in (*AIRFRAME, *MOTION_ZEROS)},
    "surface_lag": "sweeps are slow",
    "surface_rate_limit": "sweeps are slow",
    "transport_delay": "timing starts at 90 % of the displacement",
    "servo_delay": "timing starts at 90 % of the displacement",
    "no_servo": "the lag of an 18 Hz servo is within tolerance",
    "digital_multiplier": "it acts within a frame",
    "dropped_frames": "it acts within a frame",
    "force_skew": "only the recorder is wrong",
    "motion_skew": "only the recorder is wrong",
    "mains_hum": "readings are means",
    "crosstalk": "other controls are free",
    "arc_geometry": "0.7 % at 11° is within tolerance",
    "gravity": "a column does not turn",
    "regressor_force": "the regressor keeps its reference",
    "regressor_friction": "the regressor keeps its reference",
}


FULL_rad = math.radians(25.0)
TABLE = Path(__file__).parents[2] / "docs" / "calibration.md"
SHORT = {"90 % to 10 %": "fall", "overshoots above 5 %": "count"}  # names in the table


def failing(effect: str, values: dict[str, float]) -> list[str]:
    """Return the kinds of check that fail with an effect, and pass on the rig without it."""
    named = {f"{effect}.{name}": value for name, value in values.items()}
    faulty = apply(bench(), "column", [BY_NAME[effect]], named)
    kinds = {name.split(",")[0].rstrip(" 123456789") for name, _ in failed(faulty) - healthy()}
    return sorted(kinds)


def failed(rig: Rig) -> set[tuple[str, float]]:
    """Return the checks of a rig that fail against the healthy bench, with their q̄ in Pa."""
    checks = check_feel(rig, "column", FULL_rad, bench())
    return {(check.name, check.pressure_Pa) for check in checks if not check.passed}


@cache
def healthy() -> set[tuple[str, float]]:
    """Return the checks that fail on the bench without a fault."""
    return failed(bench())


def documented() -> dict[str, str]:
    """Return the first cell of the table's row that names an effect, by effect."""
    rows = re.findall(r"^([^|`]+)\| (`[^|]+`)$", TABLE.read_text("utf-8"), re.MULTILINE)
    return {effect: first for first, named in rows for effect in re.findall(r"`(\w+)`", named)}


@pytest.mark.parametrize("effect", FAULTS)
def test_a_fault_beyond_its_tolerance_fails_the_checks_that_the_docs_name(effect: str) -> None:
    found = failing(effect, FAULTS[effect])
    assert found
    assert documented()[effect] == ", ".join(SHORT.get(kind, kind) for kind in found)


def test_the_docs_name_every_fault_of_the_library() -> None:
    assert {*FAULTS, *UNSEEN} >= set(BY_NAME)
    assert documented().keys() == {*FAULTS, *UNSEEN}
    assert {effect: documented()[effect] for effect in UNSEEN} == UNSEEN
