"""A rig changed in memory is checked as a rig file is: same keys, same faults."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import change, read_rig, rig_from_table
from coupled.schema import load_toml
from tests.support.rigs import BENCH, amounts, bench

LOADER = "controls.column.loader"
HOST = "controls.column.compensation"

# A change, and the key and words of the fault that it makes.
REFUSED: list[tuple[dict[str, Any], str, str]] = [
    ({f"{LOADER}.masss_kg": 4.0}, f"{LOADER}.masss_kg", "mass_kg"),
    ({f"{LOADER}.mass_kg": -1.0}, f"{LOADER}.mass_kg", "greater than 0"),
    ({f"{LOADER}.mass_kg": "4"}, f"{LOADER}.mass_kg", "valid number"),
    ({f"{LOADER}.play_mm": 1.0}, f"{LOADER}.play_mm", "wrong unit: give play_m"),
    ({f"{LOADER}.mass_kg.x": 1.0}, f"{LOADER}.mass_kg.x", "not a table"),
    ({f"{HOST}.bend_m_per_N": 1e-3}, f"{HOST}.bend_m_per_N", "K·G_T"),
    ({"controls.wheel.loader.play_rad": 0.1}, "controls.wheel", "has no wheel"),
    ({"noise": {"column_force": 1.0}}, "noise.column_force", "no such channel"),
    ({"frame_rate_Hz": 1e13}, "frame_rate_Hz", "larger than any real one"),
    ({"rate_Hz": 60.0}, "rate_Hz", "unknown key"),
    ({LOADER: {"mass_kg": 1.0}}, f"{LOADER}.damping_N_s_per_m", "is missing"),
]


@pytest.mark.parametrize(("changes", "key", "words"), REFUSED)
def test_a_change_is_refused_as_in_a_file(changes: dict[str, Any], key: str, words: str) -> None:
    with pytest.raises(InputError) as fault:
        bench().changed(changes)
    assert fault.value.key == key
    assert words in fault.value.problem
    assert fault.value.file == "test-bench"


@given(st.floats(0.1, 10.0), amounts(0.01), st.booleans())
def test_a_changed_rig_is_that_of_the_changed_file(mass: float, play: float, on: bool) -> None:
    changes = {
        f"{LOADER}.mass_kg": mass,
        f"{LOADER}.play_m": play,
        "controls.column.compensation.deflection": on,
        "noise.column_force_N": 0.1,
    }
    table = copy.deepcopy(BENCH)
    for key, value in changes.items():
        change(table, key, value)
    assert bench().changed(changes) == rig_from_table(table, "test")


@pytest.mark.parametrize("name", shipped_rigs())
def test_every_value_of_a_shipped_rig_may_be_given_back(name: str) -> None:
    path = shipped_rigs()[name]
    rig = read_rig(path)

    def leaves(table: dict[str, Any], path: str = "") -> dict[str, Any]:
        found: dict[str, Any] = {}
        for key, value in table.items():
            dotted = f"{path}.{key}" if path else key
            table_of_sections = isinstance(value, dict) and key not in ("properties", "noise")
            found |= leaves(value, dotted) if table_of_sections else {dotted: value}
        return found

    assert rig.changed(leaves(load_toml(path))) == rig


def test_what_is_left_alone_is_the_same_object() -> None:
    rig = bench()
    other = rig.changed({f"{LOADER}.mass_kg": 5.0})
    assert other.controls["column"].schedule is rig.controls["column"].schedule
    assert rig.controls["column"].loader.mass == 4.0
    assert other.controls["column"].loader.mass == 5.0


def test_a_control_alone_has_no_aircraft_and_no_noise() -> None:
    rig = read_rig(shipped_rigs()["c172p"])
    wheel = rig.only("wheel")
    assert list(wheel.controls) == ["wheel"]
    assert wheel.flight is None
    assert not wheel.noise
    assert rig.changed({"flight": None, "noise": {}}).only("column") == rig.only("column")
    with pytest.raises(InputError, match="has no rudder"):
        rig.only("rudder")


def test_controls_are_taken_whole() -> None:
    rig = bench()
    column = rig.controls["column"]
    assert rig.changed({"controls": {"column": column}}) == rig
    assert rig.changed({"controls.column": BENCH["controls"]["column"]}) == rig
    with pytest.raises(InputError, match=r"controls.stick: unknown key"):
        rig.changed({"controls": {"stick": column}})
    assert isinstance(rig.changed({}), Rig)
