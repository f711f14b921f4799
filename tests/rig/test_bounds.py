"""A travel beyond the reach of a hand, and friction that drives it, are refused."""

from __future__ import annotations

from typing import Any

import pytest

from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.bounds import pressure_doubts
from coupled.rig.rigfile import read_rig
from tests.support.rigs import bench

RATES, FORCES = "rate_m_per_s", "force_N"
SCHEDULE = "controls.column.schedule."


def refused(key: str, value: Any) -> InputError:
    with pytest.raises(InputError) as error:
        bench({key: value})
    assert "\n" not in str(error.value)
    return error.value


@pytest.mark.parametrize(
    ("curve", "key", "said"),
    [
        ({RATES: [0.0, 0.005], FORCES: [5.0, 4.0]}, ".force_N", "below 0 from 0.04 m/s"),
        ({RATES: [0.0, 0.1], FORCES: [5.0, -5.0]}, ".force_N", "falls on beyond 0.1 m/s"),
        ({RATES: [0.0, 0.1, 0.2], FORCES: [0.0, -8.0, 0.0]}, ".force_N", "is -8 at 0.1 m/s"),
        (
            {RATES: [0.0, 0.01], FORCES: [5.0, 5.0], "force_push_N": [5.0, 4.0]},
            ".force_push_N",
            "drives the hand",
        ),
    ],
)
def test_a_friction_curve_that_drives_the_hand_is_refused(
    curve: dict[str, list[float]], key: str, said: str
) -> None:
    error = refused("friction_curve", curve)
    assert error.key == f"controls.column.loader.friction_curve{key}"
    assert said in error.problem


@pytest.mark.parametrize(
    "curve",
    [
        {RATES: [0.0, 0.005, 0.01], FORCES: [5.0, 4.0, 4.0]},
        {RATES: [0.0, 0.1], FORCES: [5.0, 0.0]},  # the damping of 75 N·s/m exceeds its fall
        {RATES: [0.0, 0.1], FORCES: [0.0, -7.5]},  # in place of all of the damping
        {RATES: [0.0, 1.0], FORCES: [50.0, -26.0]},  # below 0 beyond all rates that are reached
    ],
)
def test_a_falling_friction_curve_that_dissipates_is_accepted(
    curve: dict[str, list[float]],
) -> None:
    bench({"friction_curve": curve})


@pytest.mark.parametrize(
    ("key", "most"), [("controls.column.travel_m", "1 m"), ("controls.wheel.travel_rad", "6.28")]
)
def test_the_travel_of_an_aircraft_s_control_is_within_reach(key: str, most: str) -> None:
    rig = read_rig(shipped_rigs()["t37"])
    with pytest.raises(InputError, match=f"a hand reaches {most}") as error:
        rig.changed({key: 60.0})
    assert error.value.key == key
    bench({"controls.column.travel_m": 1000.0})  # a bench without stops


def test_a_schedule_far_from_the_flight_is_doubtful() -> None:
    for file in shipped_rigs().values():
        assert pressure_doubts(read_rig(file)) == []
    rig = read_rig(shipped_rigs()["report-column"])
    rows = {
        SCHEDULE + "dynamic_pressure_Pa": [20.0, 400.0],
        SCHEDULE + "total_gradient_N_per_m": [1000.0, 2000.0],
    }
    (doubt,) = pressure_doubts(rig.changed(rows))
    assert "dynamic_pressure_Pa goes from 20 to 400, and the flight is at " in doubt
    one = {SCHEDULE + "dynamic_pressure_Pa": [0.0], SCHEDULE + "total_gradient_N_per_m": [1000.0]}
    assert pressure_doubts(rig.changed(one)) == []
