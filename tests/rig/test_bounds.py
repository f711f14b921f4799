"""Impossible numbers of a rig are refused by their ratios, at any size of the machine."""

from __future__ import annotations

from typing import Any

import pytest

from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.bounds import pressure_doubts
from coupled.rig.rigfile import read_rig
from tests.support.rigs import bench

RATES, FORCES = "rate_m_per_s", "force_N"
SENSING, SCHEDULE = "controls.column.sensing.", "controls.column.schedule."


def refused(key: str, value: Any, more: dict[str, Any] | None = None) -> InputError:
    with pytest.raises(InputError) as error:
        bench({**(more or {}), key: value})
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


IMPOSSIBLE = [
    ("bend_m_per_N", 0.105, ""),
    ("bend_push_m_per_N", 0.105, ""),
    ("play_m", 2.0, ""),
    ("stop_aft_m", 178.0, ""),
    ("bend_curve", {"force_N": [0.0, 100.0], "bend_m": [0.0, 5.0]}, ".bend_m"),
    ("force_curve", {"deflection_m": [0.0, 50.0, 99.0], FORCES: [0, 1, 2]}, ".deflection_m"),
    (
        SENSING + "deflection_curve",
        {"deflection_m": [0.0, 0.1], "reading_m": [0.0, 10.0]},
        ".reading_m",
    ),
    (SENSING + "deflection_zero_m", -5.0, ""),
]


@pytest.mark.parametrize(("key", "value", "within"), IMPOSSIBLE)
def test_a_length_in_another_unit_is_one_line_with_its_key(
    key: str, value: Any, within: str
) -> None:
    error = refused(key, value)
    assert error.key == (key if "." in key else f"controls.column.loader.{key}") + within
    assert "is it in another unit? give at most" in error.problem


@pytest.mark.parametrize("forces", [1e-4, 1.0, 1e4])
def test_the_bounds_are_those_of_a_machine_of_any_force(forces: float) -> None:
    """All forces times a factor, and K over it: the same bends."""
    machine = {
        "mass_kg": 4.0 * forces,
        "damping_N_s_per_m": 75.0 * forces,
        "basic_gradient_N_per_m": 560.0 * forces,
        SCHEDULE + "total_gradient_N_per_m": [560.0 * forces, 2189.0 * forces],
        "controls.column.compensation.bend_m_per_N": 9e-5 / forces,
        "controls.column.travel_m": 2.0,  # of a bench, not of an aircraft's control
    }
    bench({**machine, "bend_m_per_N": 9e-5 / forces})
    refused("bend_m_per_N", 9e-2 / forces, machine)


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
