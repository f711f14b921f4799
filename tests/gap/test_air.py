"""How the air moves by kinematics: none of it in still air, however hard the aircraft is flown."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.flight.aircraft import make_aircraft
from coupled.flight.gusts import GUST_DOWN, GivenAir, Gusts
from coupled.flight.runfile import read_run
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.flown import fly_force
from coupled.gap.signals.air import vertical_air
from coupled.gap.stages.airframe import gusts_of
from coupled.record.channels import CONTROL_NAMES, motion_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.units import FOOT_m
from tests.support.airframes import motion_of, noisy, pulses
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


@pytest.mark.parametrize("across_m_per_s", [0.0, 0.5])
@pytest.mark.parametrize("name", ["t37", "c172p"])
def test_the_air_across_the_heading_is_found_in_a_banked_flight(
    name: str, across_m_per_s: float
) -> None:
    """All controls move; the rising air, found beside it, counts the bank."""
    rig = read_rig(shipped_rigs()[name])
    assert rig.flight is not None
    at_s = np.arange(2400) * FRAME_s
    across, up = (np.append(risen(at_s, size), 0.0)[1:] for size in (across_m_per_s, 0.2))
    air = Gusts(rig.flight, FRAME_s, air=GivenAir(up.tolist(), across.tolist()))
    craft = make_aircraft(rig.flight, FRAME_s, CONTROL_NAMES, [aircraft_folder()], gusts=air)
    rows = []
    for at, turned in zip(at_s, np.sin(2.0 * np.pi * 0.4 * at_s) * (at_s > 1.0), strict=True):
        rows.append([at, *craft.motion()])
        craft.step((0.1 * turned, 0.05 * turned, -0.1 * turned))
    names = ("time_s", *motion_channels(CONTROL_NAMES, flown=True))
    data, rng = np.array(rows), np.random.default_rng(5)
    for k, channel in enumerate(names):
        level = NOISE.get(channel, 3e-4 if channel.endswith(("rad", "rad_per_s")) else 0.0)
        data[:, k] += rng.normal(0.0, level, len(data))
    record = Record(names, data)
    assert np.ptp(record["roll_rad"]) > 0.05 and np.ptp(record["sideslip_rad"]) > 0.02
    model = gusts_of(Rig(**{**dict(rig), "controls": {}}), record)
    assert model is not None and model.up is not None and model.across is not None
    for found, true in ((model.across, across_m_per_s), (model.up, 0.2)):
        wrong = found.speed - risen(at_s, true)
        assert slow(wrong) < 2.0 * slow(found.error)
        assert slow(wrong) < 0.05


def slow(signal: NDArray[np.float64]) -> float:
    """Return the rms of what changes over more than a second, but for the ends."""
    window = np.hanning(122)[1:-1]
    return float(np.std(np.convolve(signal, window / window.sum(), "valid")))


@pytest.mark.slow
@pytest.mark.parametrize("rms_m_per_s", [0.5, 1.5])
@pytest.mark.parametrize("name", ["c172p", "t37"])
def test_lateral_gusts_are_named_alone(name: str, rms_m_per_s: float) -> None:
    rig = noisy(read_rig(shipped_rigs()[name]))
    real = rig.changed({"flight.lateral_gust_rms_m_per_s": rms_m_per_s})
    found = diagnose(rig, {"r": motion_of(fly_force(real, pulses(rig), seed=3))}, "column")
    (effect,) = found.effects
    (rms,) = effect.parameters
    assert (found.verdict, effect.name) == ("effect", "lateral_gust")
    assert rms.low is not None and rms.high is not None and rms.low < rms_m_per_s < rms.high
