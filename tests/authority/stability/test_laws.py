"""What a rig's stability depends on, by laws that hold between two rigs."""

from __future__ import annotations

from typing import Any

import pytest

from coupled.authority.stability.limits import ARM_N_per_d, filed, gradient_range
from coupled.authority.stability.linear import growth
from coupled.authority.stability.planes import Kind, linear_rig
from coupled.rig.growth import growth as simulated
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig
from tests.support.rigs import G_STIFF, K_REPORT, bench

PLACE = "controls.column"
HELD = Hand(900.0, 30.0, 0.0)
LATE_s = 0.008


def column(changes: dict[str, Any]) -> Rig:
    return linear_rig(bench(changes), "column", G_STIFF)


@pytest.mark.parametrize(
    "late",
    [
        {"servo_delay_s": LATE_s},
        {f"{PLACE}.sensing.gauge_delay_s": LATE_s},
        {f"{PLACE}.sensing.gauge_sampling_Hz": 0.5 / LATE_s},
    ],
    ids=["servo", "gauge", "half a sample"],
)
def test_delays_around_the_loop_of_a_hand_are_alike(late: dict[str, float]) -> None:
    """A held grip closes one loop: where in it τ seconds are lost does not matter to its poles."""
    prompt, delayed = growth(column({}), HELD), growth(column({"delay_s": LATE_s}), HELD)
    assert abs(delayed - prompt) > 0.5
    assert growth(column(late), HELD) == pytest.approx(delayed, rel=1e-9)
    assert simulated(column(late), HELD, 8.0) == pytest.approx(delayed, rel=0.02)


def test_a_digital_product_has_the_scale_of_the_reading_and_an_analog_one_has_not() -> None:
    """ΔF = ΔG·δc as read: an S₁ off at the reading acts as one off in the electronics."""
    off = 1.25
    reading = {f"{PLACE}.sensing.deflection_scale": off}
    electronics = {f"{PLACE}.sensing.computed_scale": off}
    digital = {"multiplier": "digital", "controls.column.loader.damping_N_s_per_m": 150.0}
    found = growth(column({**digital, **reading}), Hand())
    assert found == pytest.approx(growth(column({**digital, **electronics}), Hand()), rel=1e-12)
    assert abs(found - growth(column(digital), Hand())) > 0.05
    assert simulated(column({**digital, **reading}), Hand(), 6.0) == pytest.approx(found, rel=0.01)
    assert growth(column(reading), HELD) == growth(column({}), HELD)
    assert abs(growth(column(electronics), HELD) - growth(column({}), HELD)) > 0.05


@pytest.mark.parametrize(
    "changes",
    [
        {
            f"{PLACE}.compensation.inertia_gradient_N_per_m": [500.0, 2500.0],
            f"{PLACE}.compensation.force_lead_s": [0.02, 0.02],
            f"{PLACE}.compensation.force_lead_lag_s": 0.01,
        },
        {"servo_rate_share": 0.8, "servo_frequency_Hz": 9.0},
    ],
    ids=["lead on the force", "servo that is led by the rate"],
)
def test_a_lead_acts_in_theory_as_in_simulation(changes: dict[str, Any]) -> None:
    without = {key: value for key, value in changes.items() if key == "servo_frequency_Hz"}
    found = growth(column(changes), HELD)
    assert abs(found - growth(column(without), HELD)) > 0.2
    assert simulated(column(changes), HELD, 8.0) == pytest.approx(found, rel=0.02)


def test_what_is_filed_is_the_planes_own_quantity() -> None:
    """K̂/K, the frame in s, the stiffness of an arm by that of the structure, Hz, and m_g/m."""
    rig = bench(
        {
            f"{PLACE}.compensation.bend_m_per_N": 0.5 * K_REPORT,
            f"{PLACE}.sensing.gauge_frequency_Hz": 40.0,
            f"{PLACE}.sensing.gauge_mass_kg": 0.5,
        }
    )
    own: dict[Kind, float] = {
        "assumed": 0.5,
        "frame": 0.01,
        "hand": ARM_N_per_d * K_REPORT,
        "servo": 18.0,
        "gauge": 40.0,
        "mass": 0.5 / 4.0,
    }
    for kind, value in own.items():
        assert filed(rig, "column", kind) == pytest.approx(value)


def test_a_schedules_range_has_its_slope_and_both_segments() -> None:
    """The table rises from its first value by `slope` times what is filed; so does the second."""
    schedule = {
        f"{PLACE}.schedule.total_gradient_N_per_m": [500.0, 1500.0],
        f"{PLACE}.schedule.second_gradient_N_per_m": [300.0, 2500.0],
        f"{PLACE}.schedule.break_deflection_m": 0.03,
        f"{PLACE}.schedule.slope": 0.5,
    }
    found = gradient_range(bench(schedule).controls["column"])
    assert found == pytest.approx((300.0, 300.0 + 0.5 * 2200.0))
