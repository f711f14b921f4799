"""Peak rate, peak load factor and time to an attitude, of motions with known values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.authority.compare import Outcome, judge
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, Measure
from coupled.flight.pilot import Clamp
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig

Floats = NDArray[np.float64]
START_s, SECONDS = 1.5, 4.0
CHANGE_rad = 0.2


@pytest.fixture(scope="module")
def flown() -> dict[float, tuple[Manoeuvre, Record]]:
    """Return a pull (1) and a push (−1), each held from START_s on."""
    rig = read_rig(shipped_rigs()["t37"])
    found = {}
    for side in (1.0, -1.0):
        hand = Clamp(deflection_m=side * 0.02, start_s=START_s)
        measure = Measure(attitude_change=CHANGE_rad)
        manoeuvre = Manoeuvre(rig, {"column": hand}, SECONDS, measure=measure)
        found[side] = (manoeuvre, fly(manoeuvre))
    return found


def figures(flown: tuple[Manoeuvre, Record], **motion: Floats) -> Outcome:
    """Return the figures of a flight with other channels of its motion."""
    manoeuvre, record = flown
    data = record.data.copy()
    for name, values in motion.items():
        data[:, record.channels.index(name)] = values
    return judge(manoeuvre, "rigid", replace(record, data=data))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_peak_rate_is_to_the_pilots_side(
    flown: dict[float, tuple[Manoeuvre, Record]], side: float
) -> None:
    """The aircraft follows the hand with 0.1 rad/s, and swings back with 0.3 rad/s."""
    time = flown[side][1].time_s
    rate = np.where(time < 2.5, 0.1, -0.3) * side
    found = figures(flown[side], pitch_rate_rad_per_s=rate)
    assert found.peak_rate_rad_per_s == pytest.approx(0.1)


def test_the_peak_load_factor_of_a_push_is_the_lowest(
    flown: dict[float, tuple[Manoeuvre, Record]],
) -> None:
    """The value furthest from that in trim: 0.2 g, not the 1.3 g of the recovery."""
    time = flown[-1.0][1].time_s
    load = 1.0 - 0.8 * np.exp(-(((time - 2.2) / 0.2) ** 2))
    load += 0.3 * np.exp(-(((time - 3.2) / 0.2) ** 2))
    lowest, highest = float(load.min()), float(load.max())
    assert lowest < 0.25
    assert highest > 1.25
    assert figures(flown[-1.0], load_factor=load).peak_load_factor == lowest
    assert figures(flown[1.0], load_factor=2.0 - load).peak_load_factor == 2.0 - lowest


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_time_to_an_attitude_is_from_the_pilots_start(
    flown: dict[float, tuple[Manoeuvre, Record]], side: float
) -> None:
    """θ leaves its trim with 0.4 rad/s at the start: 0.2 rad are reached 0.5 s later."""
    manoeuvre, record = flown[side]
    frame_s = 1.0 / manoeuvre.rig.frame_rate
    pitch = 0.05 + side * 0.4 * np.maximum(record.time_s - START_s, 0.0)
    found = figures(flown[side], pitch_rad=pitch).time_to_attitude_s
    assert found == pytest.approx(CHANGE_rad / 0.4, abs=1.01 * frame_s)


def test_an_attitude_that_another_cause_gave_before_the_start_does_not_count(
    flown: dict[float, tuple[Manoeuvre, Record]],
) -> None:
    """A gust lifts the nose by 0.3 rad before the pilot's start; he needs 1 s for his 0.2 rad."""
    manoeuvre, record = flown[1.0]
    time, frame_s = record.time_s, 1.0 / manoeuvre.rig.frame_rate
    gust = 0.3 * np.exp(-(((time - 0.7) / 0.1) ** 2))
    pitch = gust + 0.2 * np.maximum(time - START_s, 0.0)
    found = figures(flown[1.0], pitch_rad=pitch).time_to_attitude_s
    assert found == pytest.approx(1.0, abs=1.01 * frame_s)


def test_a_motion_to_the_other_side_does_not_reach_the_attitude(
    flown: dict[float, tuple[Manoeuvre, Record]],
) -> None:
    time = flown[-1.0][1].time_s
    up = 0.4 * np.maximum(time - START_s, 0.0)
    assert figures(flown[-1.0], pitch_rad=up).time_to_attitude_s is None
    assert figures(flown[1.0], pitch_rad=-up).time_to_attitude_s is None
