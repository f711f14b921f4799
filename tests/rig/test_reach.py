"""A hand at the end of its reach: what the surface gets there, on any rig and at any force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Configuration, Manoeuvre, PressureProfile, configure
from coupled.flight.pilot import PILOTS
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.schema import build
from tests.support.rigs import G_STIFF, K_REPORT, bench

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
    assert held.max() < 1.0005 * REACH  # and comes to it without going past it
    assert side * record["column_estimate_m"][-1] == pytest.approx(reached * REACH, rel=1e-9)
    felt = side * record["column_force_N"][-1]
    assert felt == pytest.approx(force * G_STIFF * REACH, rel=1e-9)


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


def test_the_grip_comes_to_the_reach_as_a_clamp_does() -> None:
    """The error dies as exp(−6·t), once the loader's own swing of 9 1/s has."""
    hand = {"kind": "step", "force_N": 600.0, "rise_s": 0.0, "reach_m": REACH}
    rig = configure(bench({"servo_frequency_Hz": 500.0}), "rigid")
    left = REACH - pushed(rig, hand)["column_deflection_m"]
    for row in (220, 240, 260):
        assert left[row] / left[row - 20] == pytest.approx(np.exp(-6.0 * 0.2), rel=0.02)


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
            assert share.max() < 1.15
