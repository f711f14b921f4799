"""A recorder that stamps channels late: closed forms, and no effect on the host."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Doublet
from coupled.rig.recorder import lateness, stamped
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig


def test_a_cubic_is_moved_exactly_and_a_whole_frame_is_a_row() -> None:
    t = np.arange(40.0)
    cubic = 1.0 + 0.3 * t - 0.02 * t**2 + 1e-3 * t**3
    for late in (0.4, 2.7, -1.3):
        inner = slice(6, -6)
        then = t - late
        wanted = 1.0 + 0.3 * then - 0.02 * then**2 + 1e-3 * then**3
        np.testing.assert_allclose(stamped(cubic, late)[inner], wanted[inner], rtol=1e-12)
    np.testing.assert_allclose(stamped(cubic, 3.0)[3:], cubic[:-3], rtol=1e-12)
    assert np.all(stamped(cubic, 3.0)[:3] == cubic[0])  # before the record a channel stands
    assert stamped(cubic, 0.0) is cubic


def test_a_slow_sine_is_moved_to_within_the_error_of_a_cubic() -> None:
    t = np.arange(1200) / 120.0
    late_s = 0.0213
    moved = stamped(np.sin(4.0 * np.pi * t), late_s * 120.0)
    wanted = np.sin(4.0 * np.pi * (t - late_s))
    # The cubic's error is 9/384·(h·ω)⁴ at most.
    assert np.max(np.abs(moved - wanted)[10:]) < 9.0 / 384.0 * (4.0 * np.pi / 120.0) ** 4


def test_the_force_is_recorded_late_and_the_host_had_it_in_time(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    plain = made(tmp_path, nominal, {}, 3)
    late = made(tmp_path, nominal, {"force_skew": {"delay_s": 3.0 / 120.0}}, 3)
    force = "column_force_N"
    for name in set(plain.channels) - {force}:
        assert np.array_equal(plain[name], late[name]), name
    # The noise stays where it was: moved is what is measured.
    hand = plain["column_hand_force_N"]
    np.testing.assert_allclose(late[force][3:] - plain[force][3:], hand[:-3] - hand[3:], atol=1e-9)


def doublet(rig: Rig) -> Manoeuvre:
    return Manoeuvre(rig, {"column": Doublet(force_N=20.0, half_period_s=1.0)}, 6.0)


def test_the_motion_is_recorded_late_and_neither_pressure_nor_surface() -> None:
    rig = nominal_rig(True)
    plain = fly(doublet(rig))
    late = fly(doublet(rig.changed({"flight.motion_stamp_s": 6.0 / rig.frame_rate})))
    assert set(lateness(rig)) == set()
    moved = {name for name in plain.channels if not np.array_equal(plain[name], late[name])}
    assert {"pitch_rate_rad_per_s", "alpha_rad", "load_factor", "altitude_m"} <= moved
    for name in moved:
        assert late[name][6:] == pytest.approx(plain[name][:-6], rel=1e-9, abs=1e-12)
    assert {"dynamic_pressure_Pa", "elevator_rad", "column_force_N"}.isdisjoint(moved)
