"""Schedule: interpolation, scale and slope, and the pressure's lag, by closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.rig.replay import (
    replay_schedule,
)
from tests.support.rigs import G_STIFF, bench

SCHEDULE = "controls.column.schedule"


def test_a_schedule_interpolates_linearly_and_is_constant_beyond_its_ends() -> None:
    q = np.array([-10.0, 0.0, 1500.0, 3000.0, 9000.0])
    g = replay_schedule(bench(), "column", q)
    assert g == pytest.approx([560.0, 560.0, (560.0 + G_STIFF) / 2, G_STIFF, G_STIFF], rel=1e-12)


def test_a_schedule_of_many_rows_is_straight_between_each_two() -> None:
    q, g = [500.0, 1500.0, 2000.0, 4000.0], [560.0, 900.0, 2100.0, 1700.0]
    rig = bench({f"{SCHEDULE}.dynamic_pressure_Pa": q, f"{SCHEDULE}.total_gradient_N_per_m": g})
    asked = np.array([400.0, 500.0, 750.0, 1500.0, 1625.0, 1999.0, 2000.0, 3500.0, 4100.0])
    assert replay_schedule(rig, "column", asked) == pytest.approx(np.interp(asked, q, g), rel=1e-12)


def test_scale_and_slope_errors_change_the_gradient_by_their_definition() -> None:
    q = np.array([0.0, 1000.0])
    scaled = replay_schedule(bench({f"{SCHEDULE}.pressure_scale": 1.5}), "column", q)
    assert scaled == pytest.approx([560.0, 560.0 + (G_STIFF - 560.0) * 0.5], rel=1e-12)
    sloped = replay_schedule(bench({f"{SCHEDULE}.slope": 0.5}), "column", q)
    assert sloped == pytest.approx([560.0, 560.0 + 0.5 * (G_STIFF - 560.0) / 3], rel=1e-12)


def test_the_pressure_lag_is_of_first_order() -> None:
    rig = bench({f"{SCHEDULE}.pressure_lag_s": 0.4})
    t = np.arange(200) / rig.frame_rate
    q = np.where(t > 0.0, 3000.0, 0.0)
    g = replay_schedule(rig, "column", q)
    exact = 560.0 + (G_STIFF - 560.0) * (1.0 - np.exp(-t / 0.4))
    assert g == pytest.approx(exact, rel=1e-12)


def test_a_lagging_pressure_begins_where_the_first_frame_has_it() -> None:
    rig = bench({f"{SCHEDULE}.pressure_lag_s": 0.4, f"{SCHEDULE}.pressure_scale": 1.5})
    g = replay_schedule(rig, "column", np.full(50, 1000.0))
    assert g == pytest.approx((560.0 + G_STIFF) / 2, rel=1e-12)
