"""The gusts' filter: the Dryden spectrum made discrete, against scipy's bilinear rule."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest
from scipy.signal import bilinear, lfilter

from coupled.flight.aircraft import make_aircraft
from coupled.flight.gusts import GivenAir, Gusts, dryden, dryden_filter
from coupled.record.channels import ALPHA, LOAD, SPEED
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig


@pytest.mark.parametrize("lag_s", [0.5, 3.0, 40.0])
@pytest.mark.parametrize("frame_s", [1 / 60, 1 / 120, 1 / 600])
def test_the_filter_is_that_of_the_bilinear_rule(lag_s: float, frame_s: float) -> None:
    gain = 2.0 * np.sqrt(lag_s / np.pi)
    rise = gain * np.array([np.sqrt(3.0) * lag_s, 1.0])
    top, bottom = bilinear(rise, [lag_s**2, 2.0 * lag_s, 1.0], 1.0 / frame_s)
    found_top, found_bottom = dryden_filter(2.0, lag_s, frame_s)
    assert found_top == pytest.approx(top, rel=1e-6, abs=1e-12)
    assert found_bottom == pytest.approx(bottom, rel=1e-12)


def test_rising_air_raises_the_angle_of_attack() -> None:
    """w m/s of rising air at V raise the angle of attack by w/V before the aircraft follows."""
    flight = read_rig(shipped_rigs()["t37"]).flight
    assert flight is not None
    frame_s, up_m_per_s = 1 / 120, 2.0
    gusts = Gusts(flight, frame_s, air=GivenAir(up=[up_m_per_s] * 4))
    airframe = make_aircraft(flight, frame_s, gusts=gusts)
    before = airframe.motion()
    for _ in range(3):
        airframe.step((0.0, 0.0, 0.0))
    after = airframe.motion()
    assert after[ALPHA] - before[ALPHA] == pytest.approx(up_m_per_s / before[SPEED], rel=0.1)
    assert after[LOAD] > before[LOAD] + 0.1


def test_the_air_is_filtered_noise() -> None:
    frame_s, lag_s = 1 / 120, 530.0 / 70.0
    hiss = np.random.default_rng([3, 97]).normal(0.0, np.sqrt(np.pi / frame_s), 1024)
    wanted = lfilter(*dryden_filter(2.0, lag_s, frame_s), hiss)
    found = list(islice(dryden(2.0, 530.0, 70.0, frame_s, 3), 1024))
    assert found == pytest.approx(wanted, rel=1e-12, abs=1e-12)
