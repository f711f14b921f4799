"""FMUs without their binary: variables, laws of parameters, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from coupled.exporting.fmu.description import unit
from coupled.exporting.fmu.descriptions import PARAMETERS
from coupled.exporting.fmu.laws import laws
from coupled.exporting.fmu.numbers import evaluated, parameters, place_of, words
from coupled.exporting.fmu.variables import variables
from coupled.exporting.fmu.write import left_out
from coupled.resources import shipped_rigs
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.commands import coupled, files


def shipped(name: str, **changes: Any) -> Rig:
    changes = {f"controls.column.{key}": value for key, value in changes.items()}
    return read_rig(shipped_rigs()[name]).changed(changes)


RICH: dict[str, Any] = {
    "travel_push_m": 0.06,
    "loader.friction_N": 3.0,
    "loader.friction_stiffness_N_per_m": 2e4,
    "loader.modifying_lag_s": 0.01,
    "loader.delay_s": 0.004,
    "loader.stop_aft_m": 0.05,
    "compensation.inertia_gradient_N_per_m": [500.0, 2000.0],
    "compensation.mass_factor": [1.0, 1.2],
    "sensing.gauge_frequency_Hz": 80.0,
    "sensing.word_length_bits": 12,
    "sensing.s1_V_per_m": 400.0,
    "sensing.s2_V_per_N": 0.5,
    "sensing.s3_V_per_N": 0.4,
    "services.soft_stop_m": 0.1,
}


@pytest.mark.parametrize("changes", [{}, RICH], ids=["shipped", "rich"])
def test_the_laws_give_what_pack_gives(changes: dict[str, Any]) -> None:
    rig = shipped("bench", **changes)
    data, frame_s = rig.controls["column"], 1.0 / rig.frame_rate
    memory = words(rig, "column", data)
    for place, law in laws(data, frame_s, frame_s / rig.substeps).items():
        if place.startswith("state."):
            continue
        word, whole = place_of(place)
        packed = memory[word] if whole else memory.view(float)[word]
        assert evaluated(law, data) == pytest.approx(float(packed), rel=1e-12), place


def test_a_number_may_change_where_the_laws_give_all_that_it_does() -> None:
    plain = {one.key: one.bounds for one in parameters(shipped("bench"), "column")}
    assert {"travel_m", "loader.mass_kg", "loader.friction_N", "compensation.deflection"} <= {
        *plain
    }
    assert "schedule.total_gradient_N_per_m[2]" in plain
    # An exact map over a step, a structure, a history that is not kept, a whole stage.
    constant = {"loader.servo_frequency_Hz", "sensing.word_length_bits", "loader.delay_s"}
    constant |= {"loader.modifying_lag_s", "services.soft_stop_m", "sensing.gauge_delay_s"}
    assert not constant & {*plain}
    rich = {one.key: one.bounds for one in parameters(shipped("bench", **RICH), "column")}
    for key in ("loader.delay_s", "loader.modifying_lag_s", "services.soft_stop_m"):
        assert rich[key].include(1e-3), key
    for key in ("loader.delay_s", "loader.modifying_lag_s"):
        assert not rich[key].include(0.0), key
    assert "travel_push_m" not in plain
    assert not rich["travel_push_m"].include(0.0)
    # A contact's stiffness is that of friction: without friction there is none.
    assert not rich["loader.friction_N"].include(0.0)
    assert plain["loader.friction_N"].include(0.0)


def test_each_description_is_of_a_number_of_the_rig() -> None:
    data = shipped("bench", **RICH).controls["column"]
    for name in PARAMETERS:
        section, _, field = name.rpartition(".")
        kind = type(getattr(data, section)) if section else Control
        assert field in kind.model_fields, name
    named = {n.partition("[")[0] for law in laws(data, 0.01, 0.001).values() for n in law.of if n}
    assert named <= set(PARAMETERS)


def test_variables_have_unique_names_units_and_descriptions() -> None:
    found = variables(shipped("c172p"), "wheel")
    assert len({one.name for one in found}) == len(found)
    assert all(one.description for one in found)
    by_name = {one.name: unit(one.unit).name for one in found}
    assert by_name["wheel_gradient_N_per_rad"] == "N/rad"
    assert by_name["loader.damping_N_s_per_rad"] == "N.s/rad"
    assert "alpha_rad" not in by_name
    hinge = shipped("c172p", **{"services.hinge_alpha_N_per_Pa_rad": 0.01})
    assert "alpha_rad" in {one.name for one in variables(hinge, "column")}


@pytest.mark.parametrize(
    ("key", "name", "exponents"),
    [
        ("N_per_m3", "N/m3", {"kg": 1, "m": -2, "s": -2}),
        ("N_per_Pa_rad", "N/(Pa.rad)", {"m": 2, "rad": -1}),
        ("norm_per_s", "1/s", {"s": -1}),
        ("per_Pa", "1/Pa", {"kg": -1, "m": 1, "s": 2}),
        ("N_per_g", "N", {"kg": 1, "m": 1, "s": -2}),
        ("norm", "", {}),
    ],
)
def test_a_unit_has_its_base_units(key: str, name: str, exponents: dict[str, int]) -> None:
    assert unit(key) == (name, exponents)


def test_what_is_left_out_is_told() -> None:
    rig = shipped("t37").changed(
        {
            "noise": {"column_force_N": 0.1},
            "structure.column_by_wheel_m_per_N": 1e-6,
            "controls.column.services.soft_stop_m": 0.1,
        }
    )
    assert [line.partition(":")[0] for line in left_out(rig, "column")] == [
        *("noise", "structure", "controls.column.services"),
    ]
    assert left_out(shipped("bench").changed({"noise": {}}), "column") == ()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("t37", "--fmu", "x.fmu"), "control: an FMU has one control; give one of column"),
        (("t37", "--fmu", "x.fmu", "--control", "knee"), "control: the rig has no 'knee'"),
        (("bench", "--fmu", "x.zip"), "x.zip: an FMU ends in .fmu"),
        (("bench", "--fmu", "no/x.fmu"), "no"),
        (("bench", "--fmu", "x.fmu", "--jsbsim", "out"), "--jsbsim: leave it out with --fmu"),
        (("bench", "--fmu", "x.fmu", "--run", "appendix-c"), "--run: leave it out with --fmu"),
        (("bench", "--jsbsim", "out", "--fmi", "2"), "--fmi: is for --fmu only"),
        (("bench",), "--jsbsim: is missing; give it, or --fmu"),
        (("bench", "--fmu", "x.fmu", "--fmi", "1"), "--fmi"),
    ],
)
def test_what_cannot_be_an_fmu_is_refused_in_a_line(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = coupled(tmp_path, "export", *words)
    assert done.returncode == 2
    assert said in done.stderr.replace("\n", " ")
    assert files(tmp_path) == set()


def test_without_a_compiler_it_is_said_what_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", "no-such-compiler")
    done = coupled(tmp_path, "export", "bench", "--fmu", "x.fmu")
    assert done.returncode == 2
    assert "needs a C compiler" in done.stderr.replace("\n", " ")
    assert files(tmp_path) == set()
