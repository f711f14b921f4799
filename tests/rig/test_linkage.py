"""Linkage: servo, play, bend and arc, each by its closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from coupled.rig import linkage
from coupled.rig.packing import pack
from coupled.rig.replay import (
    replay_linkage,
)
from tests.support.rigs import K_REPORT, bench

SCHEDULE = "controls.column.schedule"


def servo(changes: dict[str, Any], computed: np.ndarray, force: np.ndarray | float = 0.0) -> Any:
    rig = bench({"bend_m_per_N": 0.0, "controls.column.compensation.bend_m_per_N": 0.0, **changes})
    rig = rig.changed({"frame_rate_Hz": 2000.0})
    return replay_linkage(rig, "column", computed, np.zeros_like(computed) + force)


def test_a_servo_answers_a_ramp_by_its_closed_form() -> None:
    w, z = 2 * math.pi * 18.0, 0.7
    t = np.arange(2000) / 2000.0
    x = servo({}, 0.1 * t)
    wd = w * math.sqrt(1 - z * z)
    lag = 2 * z / w
    decay = np.exp(-z * w * t) * (
        lag * np.cos(wd * t) + (2 * z * z - 1) / (w * math.sqrt(1 - z * z)) * np.sin(wd * t)
    )
    assert x == pytest.approx(0.1 * (t - lag + decay), abs=1e-9)


@pytest.mark.parametrize("frequency_Hz", [2.0, 1000.0])
def test_a_servo_is_stable_at_any_frequency(frequency_Hz: float) -> None:
    x = servo({"servo_frequency_Hz": frequency_Hz}, np.full(8000, 0.02))
    assert x[-1] == pytest.approx(0.02, rel=1e-9)


def test_a_rate_limit_is_the_slope_of_the_position() -> None:
    t = np.arange(4000) / 2000.0
    x = servo({"servo_rate_limit_m_per_s": 0.05}, np.where(t < 0.2, 0.0, 0.08))
    moving = (x > 0.01) & (x < 0.06)
    assert np.diff(x)[moving[:-1] & moving[1:]] * 2000.0 == pytest.approx(0.05, rel=1e-9)
    assert x[-1] == pytest.approx(0.08, rel=1e-6)


def test_a_servo_off_its_rate_limit_arrives_with_the_limits_speed() -> None:
    """It leaves the limit where ω²·(u − x) = 2ζω·v, and swings out freely from there."""
    w, z, v, u = 2 * math.pi * 18.0, 0.7, 0.5, 0.15
    t = np.arange(4000) / 2000.0
    x = servo({"servo_rate_limit_m_per_s": v}, np.where(t < 0.01, 0.0, u))
    off = -2 * z * v / w
    start = float(np.interp(u + off, x[: np.argmax(x)], t[: np.argmax(x)]))
    since, wd = t[t > start] - start, w * math.sqrt(1 - z * z)
    swing = np.exp(-z * w * since) * (
        off * np.cos(wd * since) + (v + z * w * off) / wd * np.sin(wd * since)
    )
    assert np.max(swing) > 1e-4
    assert x[t > start] == pytest.approx(u + swing, abs=5e-6)


def test_an_acceleration_limit_is_the_slope_of_the_speed() -> None:
    """Far from its command a servo gathers speed at the limit, x = a·t²/2, and brakes at it."""
    t, a = np.arange(8000) / 2000.0, 0.4
    x = servo({"servo_acceleration_limit_m_per_s2": a}, np.where(t < 0.1, 0.0, 0.08))
    since = t - 0.1
    gathers = (since > 0.01) & (since < 0.25)
    began = 0.1 - 1.0 / 2000.0  # the command runs straight over the step before
    assert x[gathers] == pytest.approx(0.5 * a * (t[gathers] - began) ** 2, rel=1e-9)
    bends = np.diff(x, 2) * 2000.0**2
    assert np.max(np.abs(bends)) < 1.25 * a  # within the step in which it lets go
    assert np.quantile(np.abs(bends), 0.99) < a * (1.0 + 1e-6)
    assert np.mean(np.isclose(bends, -a, rtol=1e-6)) > 0.05  # it brakes at the limit, too


@pytest.mark.parametrize("limit", ["acceleration_limit_m_per_s2", "rate_limit_m_per_s"])
def test_a_limit_that_is_never_met_changes_no_bit(limit: str) -> None:
    t = np.arange(4000) / 2000.0
    u = 0.02 * np.sin(9.0 * t)
    assert np.array_equal(servo({f"servo_{limit}": 100.0}, u), servo({}, u))


def test_backlash_lets_the_grip_lag_by_half_the_play_each_way() -> None:
    t = np.arange(40000) / 2000.0
    x = 0.04 * np.sin(2 * np.pi * t / 10.0)
    loose = servo({"play_m": 0.006}, x)
    tight = servo({}, x)
    assert np.max(loose) == pytest.approx(0.04 - 0.003, rel=1e-4)
    rising = (np.diff(tight)[:-1] > 0) & (t[1:-1] > 8.6) & (t[1:-1] < 12.0)
    assert (tight - loose)[1:-1][rising] == pytest.approx(0.003, abs=1e-9)


def test_bend_is_linear_or_saturates_towards_its_limit() -> None:
    force = np.linspace(-400.0, 400.0, 101)
    flat = np.zeros_like(force)
    bent = servo({"bend_m_per_N": K_REPORT}, flat, force)
    assert bent == pytest.approx(K_REPORT * force, rel=1e-12)
    stiff = servo({"bend_m_per_N": K_REPORT, "bend_limit_m": 0.02}, flat, force)
    assert stiff == pytest.approx(0.02 * np.tanh(K_REPORT * force / 0.02), rel=1e-12)
    p = pack(bench({"bend_limit_m": 0.02}))[0]["parameters"]["linkage"]
    ahead = (linkage.bend(p, 100.01) - linkage.bend(p, 99.99)) / 0.02
    assert linkage.bend_slope(p, 100.0) == pytest.approx(ahead, rel=1e-7)


def test_a_level_ruler_reads_an_arc_by_eqs_15_to_17() -> None:
    """The report: 1 % at 14°, 2 % at 20° (by its own series 19.8°)."""
    for angle_deg, error in ((14.0, 0.01), (19.8, 0.02)):
        rig = bench({"arc_geometry": True, "controls.column.length_m": 0.4})
        p = pack(rig)[0]["parameters"]["linkage"]
        along = 0.4 * math.radians(angle_deg)
        assert 1.0 - linkage.transducer(p, along) / along == pytest.approx(error, rel=2e-2)
