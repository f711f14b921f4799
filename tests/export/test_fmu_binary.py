"""FMUs as FMPy runs them: beside the package's own flights, and against misuse."""

from __future__ import annotations

import shutil
import subprocess
from ctypes import c_double, c_int, c_uint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from coupled.exporting.fmu.build import COMPILERS
from coupled.exporting.fmu.numbers import Place, parameters, place_of, words
from coupled.resources import shipped_rigs
from coupled.rig.control import CONTROL
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.fmus import (
    Loaded,
    assert_follows,
    flown,
    give,
    inputs_of,
    loaded,
    simulated,
)

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not any(map(shutil.which, COMPILERS)), reason="needs a C compiler"),
]

SHIPPED = sorted(shipped_rigs())
# Rigs with most effects at once: of the first, all work on a bench; the second is in flight.
RICH: dict[str, dict[str, Any]] = {
    "bench": {
        "controls.column.loader.friction_N": 3.0,
        "controls.column.loader.breakaway_N": 5.0,
        "controls.column.loader.friction_stiffness_N_per_m": 2e4,
        "controls.column.loader.cubic_N_per_m3": 3e4,
        "controls.column.loader.relaxing_stiffness_N_per_m": 200.0,
        "controls.column.loader.delay_s": 0.0031,
        "controls.column.loader.modifying_lag_s": 0.01,
        "controls.column.loader.play_m": 1e-3,
        "controls.column.loader.play_stiffness_N_per_m": 5e4,
        "controls.column.loader.bend_hysteresis_share": 0.3,
        "controls.column.loader.bend_hysteresis_width_N": 8.0,
        "controls.column.sensing.hum_m": 1e-4,
        "controls.column.sensing.gauge_frequency_Hz": 80.0,
        "controls.column.sensing.gauge_mass_kg": 0.4,
        "controls.column.sensing.computed_skew_s": 0.002,
        "controls.column.compensation.missed_share": 0.2,
        "controls.column.rigging.lag_s": 0.05,
        "controls.column.rigging.play_norm": 0.01,
        "controls.column.schedule.pressure_lag_s": 0.3,
    },
    "c172p": {
        "controls.column.loader.multiplier": "digital",
        "controls.column.loader.bob_weight_N_per_g": 12.0,
        "controls.column.services.hinge_alpha_N_per_Pa_rad": 0.05,
        "controls.column.services.envelope_above_g": 1.05,
        "controls.column.services.envelope_N_per_g": 30.0,
        "controls.column.sensing.deflection_scale": 1.02,
    },
}


def shipped(name: str) -> Rig:
    return read_rig(shipped_rigs()[name])


@pytest.fixture(scope="module", params=[2, 3], ids=["FMI 2", "FMI 3"])
def bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Loaded:
    return loaded(shipped("bench"), tmp_path_factory.mktemp("fmu"), fmi=request.param)


@pytest.mark.parametrize("name", SHIPPED)
def test_each_shipped_rig_is_valid_and_does_as_it_flies(name: str, tmp_path: Path) -> None:
    """Every control, by FMI 2 and 3."""
    rig = shipped(name)
    made = {}
    for seed, control in enumerate(rig.controls):
        record = flown(rig, control, 4.0, seed)
        for fmi in (2, 3):
            one = loaded(rig, tmp_path, control, fmi)
            give(one, inputs_of(record, one.made))
            made[one.file.stem] = (one.made, record)
    found = simulated(tmp_path)
    assert set(found) == set(made)
    for stem, (fmu, record) in made.items():
        assert found[stem]["problems"].size == 0, found[stem]["problems"]
        assert_follows(found[stem], record, fmu)


@pytest.mark.parametrize("name", RICH)
def test_effects_are_those_that_fly(name: str, tmp_path: Path) -> None:
    rig = shipped(name).changed(RICH[name])
    record = flown(rig, "column", 4.0, 7)
    one = loaded(rig, tmp_path, "column", 3)
    assert ("alpha_rad" in one.made.inputs) == (name == "c172p")
    give(one, inputs_of(record, one.made))
    assert_follows(simulated(tmp_path)[one.file.stem], record, one.made)


def test_parameters_make_one_rig_another(tmp_path: Path) -> None:
    """The FMU of the shipped bench, with the other rig's numbers set, does as the other flies."""
    changes: dict[str, Any] = {
        "loader.mass_kg": 5.0,
        "loader.damping_N_s_per_m": 90.0,
        "loader.friction_N": 2.0,
        "loader.bend_m_per_N": 6e-5,
        "loader.offset_N": 1.5,
        "compensation.bend_m_per_N": 3e-5,
        "compensation.gradient": 0.0,
        "schedule.pressure_lag_s": 0.2,
        "sensing.modifying_scale": 1.1,
        "rigging.lag_s": 0.1,
        "travel_m": 0.15,
    }
    other = shipped("bench").changed(
        {f"controls.column.{key}": value for key, value in changes.items() if value}
        | {"controls.column.compensation.gradient": False}
    )
    record = flown(other, "column", 3.0, 3)
    one = loaded(shipped("bench"), tmp_path)
    give(one, inputs_of(record, one.made) | changes)
    assert_follows(simulated(tmp_path)[one.file.stem], record, one.made)


def test_a_parameter_set_in_flight_is_that_of_the_rig(bench: Loaded) -> None:
    """All parameters at once: the control's numbers in the saved state are those of `pack`."""
    rig = bench.made.rig
    data = rig.controls["column"]
    one = bench.instance()
    bench.run(one, 0, np.full(30, 20.0))
    changes = {}
    for each in parameters(rig, "column"):
        if not each.whole and not each.rises and "[" not in each.key:
            changes[each.key] = 1.01 * each.start if each.start else 0.0
    bench.set(one, **changes)
    one.doStep(30 * bench.made.frame_s, bench.made.frame_s)
    wanted = words(
        rig,
        "column",
        rig.changed({f"controls.column.{key}": value for key, value in changes.items()}).controls[
            "column"
        ],
    )
    state = serialized(bench, one)
    found = np.frombuffer(state[-8 * len(wanted) :], np.int64)
    last = CONTROL["parameters"].itemsize // 8
    assert not np.array_equal(found[:last], words(rig, "column", data)[:last])
    np.testing.assert_allclose(
        found[:last].view(np.float64), wanted[:last].view(np.float64), rtol=1e-12
    )
    mass = place_of("state.loader.mass")
    assert mass == Place(mass.word, False)
    assert found.view(np.float64)[mass.word] == pytest.approx(1.01 * data.loader.mass)


def serialized(bench: Loaded, one: Any) -> bytes:
    if bench.made.fmi == 2:
        return bytes(one.serializeFMUstate(bench.saved(one)))
    return bytes(one.serializeFMUState(bench.saved(one)))


def test_two_instances_share_nothing(bench: Loaded) -> None:
    rng = np.random.default_rng(0)
    pull, push = 30.0 * rng.random(60), -30.0 * rng.random(60)
    alone = [bench.run(bench.instance(), 0, forces) for forces in (pull, push)]
    assert alone[0] != alone[1]
    first, second = bench.instance(), bench.instance()
    together: tuple[list[list[float]], list[list[float]]] = ([], [])
    for k in range(60):
        together[0].extend(bench.run(first, k, pull[k : k + 1]))
        together[1].extend(bench.run(second, k, push[k : k + 1]))
    assert list(together) == alone


def test_a_saved_state_steps_back(bench: Loaded) -> None:
    forces = 25.0 * np.sin(0.2 * np.arange(80))
    one = bench.instance()
    bench.run(one, 0, forces[:40])
    state, content = bench.saved(one), serialized(bench, one)
    ahead = bench.run(one, 40, forces[40:])
    bench.restore(one, state)
    assert bench.run(one, 40, forces[40:]) == ahead
    other = bench.instance()
    read = other.deSerializeFMUstate if bench.made.fmi == 2 else other.deserializeFMUState
    bench.restore(other, read(content))
    assert bench.run(other, 40, forces[40:]) == ahead
    one.reset()
    assert bench.get(one, "time", "column_force_N") == [0.0, 0.0]


def test_a_step_of_several_frames_is_several_steps(bench: Loaded) -> None:
    values: dict[str, Any] = {"column_force_N": 5.0, "column_force_rate_N_per_s": 60.0}
    one, other = bench.instance(**values), bench.instance(**values)
    T = bench.made.frame_s
    one.doStep(0.0, 6 * T)
    for k in range(6):
        bench.set(other, column_force_N=5.0 + 60.0 * (k * T))
        other.doStep(k * T, T)
    assert bench.get(one) == bench.get(other)
    assert bench.get(one, "time") == [6 * T]


@pytest.mark.parametrize("rounded", [1e-12, -4e-10])
def test_an_importer_s_rounding_of_the_frame_adds_up(bench: Loaded, rounded: float) -> None:
    """As of the step that the export prints, or of times that are added up."""
    one, step, time = bench.instance(column_force_N=5.0), bench.made.frame_s + rounded, 0.0
    for _ in range(20000):
        one.doStep(time, step)
        time += step
    assert bench.get(one, "time") == [time]


def test_the_derivative_of_the_force_by_fmi_2_is_its_rate(bench: Loaded) -> None:
    if bench.made.fmi == 3:
        pytest.skip("FMI 3 has no derivatives of inputs")
    one, other = bench.instance(), bench.instance()
    references, order = (c_uint * 1)(bench.at["column_force_N"]), (c_int * 1)(1)
    one.fmi2SetRealInputDerivatives(one.component, references, 1, order, (c_double * 1)(90.0))
    bench.set(other, column_force_rate_N_per_s=90.0)
    assert bench.run(one, 0, np.full(5, 3.0)) == bench.run(other, 0, np.full(5, 3.0))
    second = (c_int * 1)(2)
    with pytest.raises(FMICallException):
        one.fmi2SetRealInputDerivatives(one.component, references, 1, second, (c_double * 1)(0.0))
    assert "a derivative of order 2" in bench.said[-1]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"column_force_N": np.nan}, "column_force_N is not finite"),
        ({"dynamic_pressure_Pa": -1.0}, "dynamic_pressure_Pa = -1 is outside its range"),
        ({"loader.mass_kg": 0.0}, "loader.mass_kg = 0 is outside its range, above 0"),
        ({"compensation.gradient": 0.5}, "compensation.gradient = 0.5; should be 0 or 1"),
        ({"column_estimate_m": 0.0}, "column_estimate_m is no input or parameter"),
    ],
)
def test_a_value_that_cannot_be_is_refused(
    bench: Loaded, values: dict[str, float], said: str
) -> None:
    one = bench.instance()
    before = bench.get(one, *bench.at)
    with pytest.raises(FMICallException) as caught:
        bench.set(one, load_factor=2.0, **values)
    assert caught.value.status == 3
    assert said in bench.said[-1]
    assert bench.get(one, *bench.at) == before


@pytest.mark.parametrize(
    ("time", "step", "said"),
    [
        (0.0, -1.0, "a step of -1 frame; "),
        (0.0, 0.0, "a step of 0 s; should be a positive multiple of the frame"),
        (0.0, 1.5, "should be a positive multiple of the frame"),
        (0.0, np.nan, "should be a positive multiple of the frame"),
        (3.0, 1.0, "the instance is at 0 s"),
        (np.nan, 1.0, "the instance is at 0 s"),
    ],
)
def test_a_step_that_cannot_be_is_refused(
    bench: Loaded, time: float, step: float, said: str
) -> None:
    one, T = bench.instance(), bench.made.frame_s
    with pytest.raises(FMICallException) as caught:
        one.doStep(time * T, step * T)
    assert caught.value.status == 3
    assert said.replace("-1 frame", f"{-T:.9g} s") in bench.said[-1]
    one.doStep(0.0, T)


def test_parameters_that_contradict_each_other_are_refused_until_they_do_not(
    bench: Loaded,
) -> None:
    one, T = bench.instance(), bench.made.frame_s
    rows = [name for name in bench.at if name.startswith("schedule.dynamic_pressure")]
    low, high = bench.get(one, *rows[:2])
    for bad, good, said in (
        ({rows[0]: high, rows[1]: low}, {rows[0]: low, rows[1]: high}, "is not above"),
        ({"compensation.bend_m_per_N": 1.0}, {"compensation.bend_m_per_N": 1e-5}, "the gradient"),
    ):
        bench.set(one, **bad)
        time = bench.get(one, "time")[0]
        with pytest.raises(FMICallException):
            one.doStep(time, T)
        assert said in bench.said[-1]
        bench.set(one, **good)
        one.doStep(time, T)


def test_an_unknown_reference_a_wrong_token_and_another_order_are_refused(bench: Loaded) -> None:
    one = bench.instance()
    with pytest.raises(FMICallException) as caught:
        (one.getReal if bench.made.fmi == 2 else one.getFloat64)([9999])
    assert caught.value.status == 3
    assert "value reference 9999 is unknown" in bench.said[-1]
    early = bench.instance(initialized=False)
    with pytest.raises(FMICallException):
        early.doStep(0.0, bench.made.frame_s)
    assert "before the initialization" in bench.said[-1]
    ended = bench.instance()
    ended.terminate()
    with pytest.raises(FMICallException):
        ended.doStep(0.0, bench.made.frame_s)
    assert "the instance is terminated; reset it" in bench.said[-1]
    early.guid = "{other}"
    with pytest.raises(Exception, match="instantiate"):
        bench._instantiate(early)
    assert "the token is not that of this FMU" in bench.said[-1]
    with pytest.raises(FMICallException):
        read = one.deSerializeFMUstate if bench.made.fmi == 2 else one.deserializeFMUState
        read(b"another state")
    assert "are no state of this FMU" in bench.said[-1]


def test_10000_instances_leak_nothing(bench: Loaded, tmp_path: Path) -> None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("needs valgrind")
    source, program = Path(__file__).parent / "cycles.c", tmp_path / "cycles"
    subprocess.run(["cc", "-g", str(source), "-o", str(program), "-ldl"], check=True)
    check = [valgrind, "--quiet", "--leak-check=full", "--error-exitcode=9"]
    words = [str(bench.library), str(bench.made.fmi), bench.described.guid, "10000"]
    done = subprocess.run(
        [*check, str(program), *words], check=False, capture_output=True, text=True, timeout=900
    )
    assert done.returncode == 0, done.stderr[-2000:]
