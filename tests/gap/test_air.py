"""How the air moves by kinematics: none of it in still air, however hard the aircraft is flown."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.flight.aircraft import make_aircraft
from coupled.flight.gusts import GUST_DOWN
from coupled.flight.runfile import read_run
from coupled.gap.signals.air import vertical_air
from coupled.record.channels import motion_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.units import FOOT_m
from tests.support.records import NOISE

FRAME_s = 1.0 / 120.0
HARD = 0.35  # of the elevator's travel
RUNS = ("pull-up-t37", "pull-up-737")  # a C172P banks under its propeller, which no channel tells


@cache
def flown(run: str, gust_m_per_s: float) -> Record:
    """Return a hard sweep of the elevator through air that rises and sinks, as a log has it."""
    flight = read_run(run)[0].rig.flight
    assert flight is not None
    craft = make_aircraft(flight, FRAME_s, ["column"], [aircraft_folder()])
    down, rows = craft.lever(GUST_DOWN).set, []
    for k in range(2400):
        at = k * FRAME_s
        rows.append([at, *craft.motion()])
        down(-risen(at + FRAME_s, gust_m_per_s) / FOOT_m)
        push = 0.0 if at < 1.0 else HARD * math.sin(2.0 * math.pi * 0.25 * (at - 1.0))
        craft.step((push, 0.0, 0.0))
    channels = ("time_s", *motion_channels(["column"], flown=True))
    data, rng = np.array(rows)[:, : len(channels)], np.random.default_rng(5)
    for name, level in NOISE.items():
        if name in channels:
            data[:, channels.index(name)] += rng.normal(0.0, level, len(data))
    return Record(channels, data)


def risen(at_s: Any, size_m_per_s: float) -> Any:
    """Return how fast the air rises, m/s."""
    return size_m_per_s * np.sin(2.0 * np.pi * 0.4 * at_s)


@pytest.mark.parametrize("gust_m_per_s", [0.0, 0.2])
@pytest.mark.parametrize("run", RUNS)
def test_the_air_is_found_as_it_was_in_a_hard_manoeuvre(run: str, gust_m_per_s: float) -> None:
    """Half a frame of the load factor would be 0.04 m/s for each g: as much as a gentle gust."""
    record = flown(run, gust_m_per_s)
    assert np.ptp(record["load_factor"]) > 0.8
    air = vertical_air(record, FRAME_s)
    assert air is not None
    wrong = air.speed - risen(record["time_s"], gust_m_per_s)
    assert slow(wrong) < 1.6 * slow(air.error)


def slow(signal: NDArray[np.float64]) -> float:
    """Return the rms of what changes over more than a second, but for the ends."""
    window = np.hanning(122)[1:-1]
    return float(np.std(np.convolve(signal, window / window.sum(), "valid")))
