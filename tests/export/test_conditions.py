"""The adverse conditions in an exported script, compared with our own flight of the same run."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.flight.conditions import Conditions, build_conditions
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Step
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.exported import both

# {what: (rig, changes of it, conditions, channel that it moves, by at least, and off by at most)}
BEFALLS: dict[str, tuple[str, dict[str, float], dict[str, Any], str, float, float]] = {
    "an updraught": (
        "t37",
        {},
        {"wind": {"time_s": [0.0, 0.5, 1.0], "along_m_per_s": [0.0] * 3, "up_m_per_s": [0, 0, 4]}},
        "load_factor",
        0.3,
        0.01,
    ),
    "a gust that falls more slowly than it rises": (
        "t37",
        {},
        {"gust": {"at_s": 0.5, "rise_s": 0.2, "hold_s": 0.1, "fall_s": 1.0, "up_m_per_s": 4.0}},
        "load_factor",
        0.3,
        0.01,
    ),
    "turbulence near the ground": (
        "t37",
        {"flight.altitude_m": 200.0},
        {"turbulence": {"wind_at_6m_m_per_s": 8.0}},
        "load_factor",
        0.1,
        0.02,
    ),
    "a trim that runs away": (
        "t37",
        {"flight.elevator_effectiveness": 1.5},
        {"event": {"e": {"at_s": 0.5, "over_s": 0.5, "trim": "column", "by_norm": 0.1}}},
        "load_factor",
        0.2,
        0.02,
    ),
    "a trim that jumps": (
        "t37",
        {},
        {"event": {"e": {"at_s": 0.5, "trim": "column", "by_norm": -0.1}}},
        "load_factor",
        0.2,
        0.02,
    ),
    "the right engine stops": (
        "t37",
        {},
        {"event": {"e": {"at_s": 0.2, "engine_out": 1}}},
        "yaw_rate_rad_per_s",
        0.002,
        0.0002,
    ),
    "the piston engine stops": (
        "c172p",
        {},
        {"event": {"e": {"at_s": 0.2, "engine_out": 0}}},
        "true_airspeed_m_per_s",
        0.5,
        0.05,
    ),
    "a descent with another elevator": (
        "t37",
        {"flight.flight_path_rad": -0.05, "flight.elevator_effectiveness": 0.6},
        {},
        "altitude_m",
        10.0,
        0.1,
    ),
}


@pytest.mark.parametrize("what", BEFALLS)
def test_a_script_has_the_wind_and_events_of_our_own_flight(what: str) -> None:
    rig_name, changes, conditions, channel, moved, off = BEFALLS[what]
    rig = read_rig(shipped_rigs()[rig_name]).changed(changes)
    conditions = dict(conditions)
    build_conditions(conditions, "test")
    pull = Step(force_N=10.0, start_s=0.3)
    run = Manoeuvre(rig, {"column": pull}, 2.0, conditions=Conditions(**conditions))
    ours, alone, said = both(run)
    assert said == ""
    assert np.ptp(ours[channel]) > moved
    assert alone[channel] == pytest.approx(ours[channel], abs=off)
