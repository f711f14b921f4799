"""Control checks of 14 CFR Part 60: closed forms of a release, and rigs that must pass or fail."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from coupled.calibration.checks import (
    TOLERANCES,
    Check,
    band,
    dynamic_checks,
    static_checks,
    surface_checks,
    swing_of,
)
from coupled.calibration.documentation import document
from coupled.calibration.sweeps import Release, feel_pressures, release, sweep
from coupled.flight.scenario import configure
from coupled.rig.parameters import Rig
from coupled.rig.statics import bend_loss, uncompensated_loss
from tests.rigs import G_STIFF, K_REPORT, bench


def oscillator(omega: float, zeta: float, start: float = 0.1) -> Release:
    time = np.arange(0.0, 6.0, 1e-4)
    wd = omega * math.sqrt(1.0 - zeta**2)
    x = np.exp(-zeta * omega * time) * (np.cos(wd * time) + zeta * omega / wd * np.sin(wd * time))
    return Release(time, start * x, start)


@pytest.mark.parametrize("start", [0.1, -0.1])
def test_a_swing_in_closed_form(start: float) -> None:
    omega, zeta = 9.0, 0.2
    wd = omega * math.sqrt(1.0 - zeta**2)
    swing = swing_of(oscillator(omega, zeta, start))
    np.testing.assert_allclose(np.diff(swing.crossings), math.pi / wd, rtol=1e-6)
    heights = np.exp(-math.pi * zeta / math.sqrt(1.0 - zeta**2) * np.arange(1, 5))
    np.testing.assert_allclose(swing.peaks, heights[heights > 0.05], rtol=1e-5)


def test_an_overdamped_fall_in_closed_form() -> None:
    time = np.arange(0.0, 6.0, 1e-4)
    swing = swing_of(Release(time, 0.2 * np.exp(-2.0 * time), 0.2))
    assert swing.fall_s == pytest.approx(math.log(9.0) / 2.0, rel=1e-6)
    assert swing.crossings.size == swing.peaks.size == 0
    never = swing_of(Release(time, np.full_like(time, 0.2), 0.2))
    assert math.isnan(never.fall_s)


def test_the_rules_tolerances_of_a_release() -> None:
    wanted = oscillator(9.0, 0.2)
    for slower, crossing, period in ((1.09, True, True), (1.11, False, False)):
        checks = {
            c.name: c for c in dynamic_checks(0.0, "+", oscillator(9.0 / slower, 0.2), wanted)
        }
        assert checks["first zero crossing, +"].passed is crossing
        assert checks["period 0, +"].passed is period
        assert checks["period 1, +"].passed  # ± 20 %
    more = {c.name: c for c in dynamic_checks(0.0, "+", oscillator(9.0, 0.1), wanted)}
    assert not more["overshoot 1, +"].passed
    assert not more["overshoots above 5 %, +"].passed
    fall = list(dynamic_checks(0.0, "+", oscillator(9.0, 0.8), oscillator(9.0, 0.9)))
    assert [c.name for c in fall] == ["90 % to 10 %, +"]
    stuck = Release(wanted.time_s, np.full_like(wanted.time_s, 0.1), 0.1)
    assert not any(c.passed for c in dynamic_checks(0.0, "+", stuck, wanted))


def test_a_margin_is_what_is_left_of_the_tolerance() -> None:
    assert Check("x", 0.0, 11.0, 10.0, 4.0, "N").margin == 0.75
    assert Check("x", 0.0, 5.0, 10.0, 4.0, "N").margin == -0.25
    assert not Check("x", 0.0, float("inf"), 10.0, 4.0, "N").passed
    assert not Check("x", 0.0, float("nan"), 10.0, 4.0, "N").passed


def test_the_wider_of_two_force_tolerances_holds() -> None:
    np.testing.assert_allclose(
        band("column", np.array([100.0, -400.0])), [22.2411, 40.0], rtol=1e-5
    )
    assert TOLERANCES["wheel"].force_N == pytest.approx(13.34, abs=0.01)
    assert TOLERANCES["pedals"].breakout_N == pytest.approx(22.24, abs=0.01)


FRICTION: dict[str, Any] = {"friction_N": 6.0, "breakout_N": 9.0}


def both(rig: Rig, configuration: Any, pressure: float = 3000.0) -> Any:
    return sweep(configure(rig, configuration), "column", pressure)


def test_a_sweep_shows_friction_and_breakout() -> None:
    told = both(bench(FRICTION), "rigid")
    out = told.time_s < 25.0
    back = (told.time_s > 28.0) & (told.time_s < 45.0)
    for rows, side in ((out, 1.0), (back, -1.0)):
        moving = rows & (told.deflection > 0.02) & (told.deflection < 0.15)
        expected = 9.0 + G_STIFF * told.deflection[moving] + side * 6.0
        # what is left is the damping at the sweep's speed of some 8 mm/s
        assert np.max(np.abs(told.force[moving] - expected)) < 1.0
    assert told.deflection.max() == pytest.approx(0.1778, rel=1e-3)
    assert told.deflection.min() == pytest.approx(-0.1778, rel=1e-3)


def test_a_rig_that_is_as_specified_passes_with_all_of_its_margin() -> None:
    found = document(configure(bench(FRICTION), "rigid"), "column", 0.3)
    assert found.checks
    assert all(check.margin > 0.99 for check in found.checks)
    assert {c.name.split(",")[0] for c in found.checks} >= {"breakout", "force", "surface"}


def test_static_checks_tell_the_compensated_rig_from_the_uncompensated() -> None:
    rig = bench()
    specified = both(rig, "rigid")
    checks = {
        name: static_checks(rig, "column", 3000.0, both(rig, name), specified)
        for name in ("compensated", "uncompensated")
    }
    assert all(c.passed for c in checks["compensated"])
    forces = [c for c in checks["uncompensated"] if c.name.startswith("force")]
    assert not any(c.passed for c in forces)
    lost = bend_loss(K_REPORT, G_STIFF) / (1.0 + bend_loss(K_REPORT, G_STIFF))
    assert forces[0].measured == pytest.approx(forces[0].reference * (1.0 - lost), rel=0.01)


def test_the_surface_lacks_what_the_bend_takes() -> None:
    rig = bench()
    for name, loss in (
        ("compensated", 0.0),
        ("uncompensated", uncompensated_loss(K_REPORT, G_STIFF)),
    ):
        [check, _] = surface_checks("column", 0.1778, 0.4, 3000.0, both(rig, name))
        assert check.measured == pytest.approx(check.reference * (1.0 - loss), abs=0.05)


def test_a_release_begins_where_it_was_held_and_springs_back_by_the_bend() -> None:
    rig = bench()
    let_go = release(rig, "column", 3000.0, 1.0)
    assert let_go.start == pytest.approx(0.4 * 0.1778, rel=1e-6)
    sprung = let_go.deflection[1] / let_go.start
    assert sprung == pytest.approx(1.0 - bend_loss(K_REPORT, G_STIFF), abs=0.01)


def test_the_gradients_compensation_quickens_a_release() -> None:
    """Eq. (12) makes the loader's spring G/(1 − K·G): its period is √(1 − K·G) of the specified."""
    rig = bench({"damping_N_s_per_m": 20.0, "servo_frequency_Hz": 200.0})
    periods = [
        np.diff(swing_of(release(configure(rig, name), "column", 3000.0, 1.0)).crossings)[0]
        for name in ("compensated", "rigid")
    ]
    assert periods[0] / periods[1] == pytest.approx(math.sqrt(1.0 - K_REPORT * G_STIFF), rel=0.01)


def test_one_gradient_is_documented_at_one_pressure() -> None:
    flat = bench({"controls.column.schedule.total_gradient_N_per_m": [800.0, 800.0]})
    assert feel_pressures(flat, "column") == [0.0]
    assert len(feel_pressures(bench(), "column")) == 3
