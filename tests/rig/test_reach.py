"""A hand at the end of its reach: what the surface gets there, on any rig and at any force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Configuration, Manoeuvre, PressureProfile, configure
from coupled.flight.pilot import PILOTS
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.schema import build
from tests.support.rigs import G_STIFF, K_REPORT, amounts, bench

REACH = 0.12  # m
SHARE = K_REPORT * G_STIFF


def pushed(
    rig: Rig, hand: dict[str, Any], control: ControlName = "column", q: float = 3000.0
) -> Record:
    profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[q])
    pilot = build(PILOTS[hand["kind"]], hand, "t", "pilot", unit_of(control))
    return fly(Manoeuvre(rig, {control: pilot}, 8.0, bench=profile))


@pytest.mark.parametrize(
    ("configuration", "reached", "force"),
    [
        ("rigid", 1.0, 1.0),
        ("uncompensated", 1.0 / (1.0 + SHARE), 1.0 / (1.0 + SHARE)),
        ("deflection only", 1.0, 1.0 / (1.0 + SHARE)),
        ("gradient only", 1.0 - SHARE, 1.0),
        ("compensated", 1.0, 1.0),
    ],
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_at_the_reach_the_surface_gets_the_closed_form(
    configuration: Configuration, reached: float, force: float, side: float
) -> None:
    hand = {"kind": "step", "force_N": 600.0 * side, "reach_m": REACH}
    record = pushed(configure(bench(), configuration), hand)
    held = side * record["column_deflection_m"]
    assert held[-1] == pytest.approx(REACH, rel=1e-9)
    assert held.max() <= REACH + _FINEST  # and comes to it without going past it
    assert side * record["column_estimate_m"][-1] == pytest.approx(reached * REACH, rel=1e-9)
    felt = side * record["column_force_N"][-1]
    assert felt == pytest.approx(force * G_STIFF * REACH, rel=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_at_the_reach_a_rigid_control_gives_the_closed_form(side: float) -> None:
    """F = (G·r + F_c)/(1 − μ) with friction that grows by μ·|F|; a play leaves G·r, δc past it."""
    hand = {"kind": "step", "force_N": 600.0 * side, "reach_m": REACH}
    for changes, force, past in (
        ({"friction_N": 4.0, "friction_by_load": 0.1}, (G_STIFF * REACH + 4.0) / 0.9, 0.0),
        ({"play_m": 0.002}, G_STIFF * REACH, 0.001),
    ):
        record = pushed(configure(bench(changes), "rigid"), hand)
        assert side * record["column_force_N"][-1] == pytest.approx(force, rel=1e-9)
        assert side * record["column_deflection_m"][-1] == pytest.approx(REACH, rel=1e-9)
        assert side * record["column_computed_m"][-1] == pytest.approx(REACH + past, rel=1e-9)


def test_the_reach_is_the_same_on_both_sides() -> None:
    """Into it and back, through play and a servo that overshoots: the mirrored flight, exactly."""
    changes = {"play_m": 0.004, "servo_frequency_Hz": 2.0, "servo_damping_ratio": 0.2}
    rig = configure(bench({**changes, "friction_N": 3.0}), "uncompensated")
    hand = {"kind": "doublet", "half_period_s": 0.8, "rise_s": 0.1, "reach_m": 0.06}
    one, other = (pushed(rig, {**hand, "force_N": force}) for force in (400.0, -400.0))
    for name in ("force_N", "computed_m", "deflection_m", "estimate_m"):
        assert np.array_equal(one[f"column_{name}"], -other[f"column_{name}"])
    assert np.abs(one["column_deflection_m"]).max() == pytest.approx(0.06)


@pytest.mark.parametrize("hand", ["step", "clamp"])
def test_a_hand_that_does_not_come_to_its_reach_is_no_other(hand: str) -> None:
    settings = {"step": {"force_N": 100.0, "rise_s": 0.5}, "clamp": {"deflection_m": 0.05}}[hand]
    free = pushed(bench(), {"kind": hand, **settings})
    near = pushed(bench(), {"kind": hand, **settings, "reach_m": REACH})
    assert np.array_equal(free.data, near.data)
    stopped = pushed(bench(), {"kind": hand, **settings, "reach_m": 0.03})
    assert stopped["column_deflection_m"][-1] == pytest.approx(0.03, rel=1e-6)


def test_the_hand_lets_go_of_its_reach() -> None:
    hand = {"kind": "step", "force_N": 400.0, "duration_s": 3.0, "reach_m": REACH}
    record = pushed(bench(), hand)
    assert record["column_deflection_m"][390] == pytest.approx(REACH, rel=1e-6)
    assert abs(record["column_deflection_m"][-1]) < 1e-4


def test_the_stop_takes_the_motion_at_once_and_where_the_closed_form_has_it() -> None:
    """Rigid: δc stops at r, from whatever speed, in no time; the servo comes up from below."""
    hand = {"kind": "step", "force_N": 600.0, "rise_s": 0.0, "reach_m": REACH}
    record = pushed(configure(bench(), "rigid"), hand)
    computed = record["column_computed_m"]
    met = int(np.argmax(computed >= REACH))
    before = (computed[met - 1] - computed[met - 2]) / record.time_s[1]
    assert before > 0.3  # m/s, with which it met the stop
    assert np.ptp(computed[met:]) == 0.0
    assert np.all(np.diff(record["column_deflection_m"]) >= 0.0)


def test_the_stop_moves_with_the_gradient_and_the_grip_stays() -> None:
    """q̄ falls and rises: F = G_T·r + friction within its band, δ = r, and δc = r − K·F."""
    profile = PressureProfile(time_s=[0.0, 3.0, 6.0, 9.0], dynamic_pressure_Pa=[3e3, 3e3, 1e3, 3e3])
    hand = build(
        PILOTS["step"], {"kind": "step", "force_N": 900.0, "reach_m": REACH}, "t", "p", "m"
    )
    record = fly(Manoeuvre(bench(), {"column": hand}, 10.0, bench=profile))
    late = record.time_s > 2.5
    assert record["column_deflection_m"][late] == pytest.approx(REACH, rel=1e-9)
    force = record["column_force_N"][late]
    assert force == pytest.approx(record["column_gradient_N_per_m"][late] * REACH, abs=2.5)
    assert np.ptp(force) > 100.0


_FINEST = 1e-9  # m: what a grip may stand beyond its reach
_PILOTS: dict[str, dict[str, Any]] = {
    "step": {"rise_s": 0.0},
    "doublet": {"half_period_s": 0.7, "rise_s": 0.05},
    "3211": {"unit_s": 0.3, "rise_s": 0.02},
    "sweep": {"low_Hz": 0.3, "high_Hz": 4.0, "duration_s": 4.0},
    "clamp": {"bandwidth_rad_per_s": 12.0, "rise_s": 0.1},
}


@pytest.mark.slow
@settings(deadline=None, max_examples=300)
@given(
    kind=st.sampled_from(sorted(_PILOTS)),
    size=amounts(5000.0),
    side=st.sampled_from([-1.0, 1.0]),
    reach=st.floats(0.02, 0.25),
    structure=st.fixed_dictionaries(
        {
            "bend_m_per_N": amounts(2.5e-4),
            "bend_push_m_per_N": st.none() | amounts(2.5e-4),
            "bend_limit_m": amounts(0.05),
            "bend_hysteresis_share": amounts(0.95),
            "bend_hysteresis_width_N": amounts(200.0),
            "bend_frequency_Hz": st.just(0.0) | st.floats(0.5, 50.0),
            "bend_damping_ratio": amounts(1.5),
            "play_m": amounts(5e-3),
            "play_stiffness_N_per_m": st.just(0.0) | st.floats(1e3, 1e6),
            "friction_N": amounts(40.0),
            "breakout_N": amounts(40.0),
            "cubic_N_per_m3": amounts(1e4),
            "delay_s": amounts(0.05),
            "servo_frequency_Hz": st.floats(3.0, 200.0),
            "servo_damping_ratio": st.floats(0.05, 2.0),
            "servo_rate_limit_m_per_s": amounts(2.0),
            "multiplier": st.sampled_from(["hybrid", "digital"]),
            "modifying_lag_s": amounts(0.1),
        }
    ),
    pressures=st.lists(amounts(3000.0), min_size=4, max_size=4),
    compensated=st.booleans(),
)
def test_no_force_structure_or_pilot_takes_the_grip_past_its_reach(
    kind: str,
    size: float,
    side: float,
    reach: float,
    structure: dict[str, Any],
    pressures: list[float],
    compensated: bool,
) -> None:
    if structure["bend_push_m_per_N"] is None:
        del structure["bend_push_m_per_N"]
    rig = configure(bench(structure), "compensated" if compensated else "uncompensated")
    hand = {"kind": kind, "reach_m": reach, **_PILOTS[kind]}
    hand["deflection_m" if kind == "clamp" else "force_N"] = side * (
        size if kind != "clamp" else size / 3e4
    )
    profile = PressureProfile(time_s=[0.0, 1.5, 3.0, 4.0], dynamic_pressure_Pa=pressures)
    pilot = build(PILOTS[kind], hand, "t", "pilot", "m")
    record = fly(Manoeuvre(rig, {"column": pilot}, 5.0, bench=profile))
    assert np.abs(record["column_deflection_m"]).max() <= reach + _FINEST


@pytest.mark.parametrize("configuration", ["uncompensated", "compensated"])
def test_a_reach_never_makes_a_hand_stronger(configuration: Configuration) -> None:
    rig = read_rig(shipped_rigs()["737"]).changed({"flight": None})
    hand = {"kind": "doublet", "force_N": 900.0, "half_period_s": 0.4, "rise_s": 0.35}
    bent = configure(rig, configuration)
    free = pushed(bent, hand, q=15_000.0)["column_force_N"]
    near = pushed(bent, {**hand, "reach_m": 0.1}, q=15_000.0)["column_force_N"]
    assert np.abs(near).max() < np.abs(free).max()
    assert np.all(near * np.sign(free) <= np.abs(free) + 1e-9)


@pytest.mark.parametrize("name", sorted(shipped_rigs()))
def test_every_rig_stands_still_at_the_reach(name: str) -> None:
    """By the strongest short pushes: with friction, breakout, two segments, and any K·G_T."""
    rig = read_rig(shipped_rigs()[name])
    for control, data in rig.controls.items():
        pressures = data.schedule.dynamic_pressure
        for configuration in ("uncompensated", "compensated"):
            made = configure(rig, configuration).changed({"flight": None})
            key = f"reach_{unit_of(control)}"
            hand = {"kind": "step", "force_N": 1500.0, key: 0.8 * data.travel}
            record = pushed(made, hand, control, 0.5 * (pressures[0] + pressures[-1]))
            share = record[channel(control, "deflection")] / (0.8 * data.travel)
            assert share[-1] == pytest.approx(1.0, abs=2e-3)
            assert np.ptp(share[-200:]) < 2e-3
            assert share.max() <= 1.0 + 1e-9
