"""The Python interface: short calls from a notebook, and the cost of `import coupled`."""

from __future__ import annotations

import doctest
import inspect
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coupled
from coupled.flight.pilot import PILOTS
from coupled.flight.runfile import manoeuvres_from_table
from tests.support.rigs import G_STIFF, K_REPORT, bench

PULL = coupled.Clamp(deflection_m=0.02)
STICK: Any = "stick"


def loaded_after(code: str) -> set[str]:
    """Return the libraries that a new interpreter has loaded after some code."""
    code += "; import sys, json; print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    return {name.split(".")[0] for name in json.loads(done.stderr)}


def test_importing_loads_nothing_heavy() -> None:
    heavy = {"numpy", "numba", "scipy", "jsbsim", "polars", "matplotlib", "pydantic"}
    assert not loaded_after("import coupled") & heavy


def test_help_loads_nothing_heavy() -> None:
    call = "import sys; sys.argv = ['coupled', '--help']\n"
    call += "try:\n from coupled.cli import main; main()\nexcept SystemExit: pass\n"
    heavy = {"jsbsim", "numba", "scipy", "matplotlib", "polars"}
    assert not loaded_after(f"exec({call!r})") & heavy


def test_every_public_name_is_there_and_on_the_map() -> None:
    assert coupled.__all__ == sorted(coupled.__all__)
    assert coupled.__doc__ is not None
    for name in coupled.__all__:
        assert getattr(coupled, name) is not None
        assert name in dir(coupled)
        assert name in coupled.__doc__, name
    with pytest.raises(AttributeError, match="no attribute 'flie'"):
        _ = coupled.flie
    kinds = {kind.__name__ for kind in PILOTS.values()}
    assert kinds <= set(coupled.__all__)


LONG = {
    "bench",
    "calibrate",
    "diagnose",
    "document",
    "fit",
    "map_authority",
    "stability",
    "with_calibration",
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if name in LONG else [])
        for name in coupled.__all__
    ],
)
def test_every_public_name_has_an_example_that_runs(name: str) -> None:
    thing = getattr(coupled, name)
    assert inspect.getdoc(thing)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE | doctest.IGNORE_EXCEPTION_DETAIL
    tests = doctest.DocTestFinder(recurse=False).find(thing, name)
    assert any(test.examples for test in tests), f"{name} has no example"
    for test in tests:
        failed, _ = doctest.DocTestRunner(optionflags=flags).run(test)
        assert not failed


def test_a_flight_without_files_is_the_run_file_s_flight(tmp_path: Path) -> None:
    table: dict[str, Any] = {
        "name": "same",
        "card": "A pull.",
        "rig": "t37",
        "duration_s": 3.0,
        "seed": 4,
        "pilot": {"column": {"kind": "step", "force_N": 30.0, "duration_s": 1.0}},
        "gust": {"at_s": 1.0, "rise_s": 0.5, "up_m_per_s": 4.0},
    }
    [case] = manoeuvres_from_table(dict(table), tmp_path / "same.toml")
    there = coupled.fly(case)
    here = coupled.fly(
        "t37",
        column=coupled.Step(force_N=30.0, duration_s=1.0),
        duration_s=3.0,
        seed=4,
        gust=table["gust"],
        name="same",
    )
    assert np.array_equal(here.record.data, there.record.data)
    assert here.outcome == there.outcome
    manifests = [dict(flight.record.manifest) for flight in (here, there)]
    assert manifests[0].pop("inputs_sha256") == {}
    assert manifests[1].pop("inputs_sha256").keys() == {"t37.toml"}
    assert manifests[0] == manifests[1]


def test_a_force_table_of_arrays_is_that_of_a_file(tmp_path: Path) -> None:
    times = np.linspace(0.0, 1.0, 61)
    forces = 30.0 * np.sin(6.0 * times)
    rows = "".join(f"{t!r},{f!r}\n" for t, f in zip(times.tolist(), forces.tolist(), strict=True))
    path = tmp_path / "push.csv"
    path.write_text("time_s,column_force_N\n" + rows)
    pilots = coupled.ForceTable(time_s=times, force_N=forces), coupled.ForceTable(file=str(path))
    one, other = (coupled.fly("t37", column=pilot, duration_s=1.5).record for pilot in pilots)
    assert np.array_equal(one.data, other.data)
    assert np.max(np.abs(one["column_force_N"])) > 20.0


def test_a_comparison_is_asked_by_configuration_and_case() -> None:
    rig = bench()
    one = coupled.Manoeuvre(
        rig,
        {"column": PULL},
        duration_s=4.0,
        bench=coupled.PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0]),
        label="whole",
        configurations=("uncompensated", "compensated"),
    )
    half = {"controls.column.loader.bend_m_per_N": 0.5 * K_REPORT}
    half["controls.column.compensation.bend_m_per_N"] = 0.5 * K_REPORT
    table = coupled.compare([one, replace(one, rig=rig.changed(half), label="half")])
    assert len(table) == 4
    assert [flight.configuration for flight in table[:2]] == ["uncompensated", "compensated"]
    # K·G_T over 1 + K·G_T is lost of what is asked, and nothing with both corrections.
    for case, bend in (("whole", K_REPORT), ("half", 0.5 * K_REPORT)):
        share = bend * G_STIFF
        assert table.loss("uncompensated", case) == pytest.approx(share / (1 + share), rel=1e-3)
        assert table.loss("compensated", case) == pytest.approx(0.0, abs=1e-4)
        assert table.felt_ratio("compensated", case) == pytest.approx(1.0, abs=1e-3)
    frame = table.to_polars()
    assert frame["loss"].to_list() == [flight.outcome.loss for flight in table]
    for asked, says in (
        (("uncompensated",), "case: is needed; one of: whole, half"),
        (("uncompensated", "whol"), "did you mean whole?"),
        (("rigid", "whole"), "no 'rigid' was flown"),
    ):
        with pytest.raises(coupled.InputError, match=says.replace("?", r"\?")):
            table.loss(*asked)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (coupled.Step, "coupled.Step: force_N: is missing"),
        (lambda: coupled.Step(force_N=9e9), "coupled.Step: force_N: input should be less"),
        (
            lambda: fly(column=coupled.Clamp(deflection_m=1.0)),
            "pilot.column.deflection_m: 1 is bey",
        ),
        (lambda: fly(column=coupled.Clamp(deflection_rad=0.1)), "give deflection_m instead"),
        (lambda: fly(column=coupled.Clamp()), "pilot.column.deflection_m: is missing"),
        (lambda: fly(seed=1), "manoeuvre: pilot: needs at least one of column"),
        (lambda: fly(column=30.0), "coupled.fly: column: is 30.0; give a pilot (as coupled.Step"),
        (lambda: fly(column=PULL, duration_s=None), "manoeuvre: duration_s: is missing"),
        (lambda: fly(column=PULL, duration_s=-1), "duration_s: input should be greater than 0"),
        (lambda: fly(column=PULL, sead=1), "sead: unknown key; did you mean seed?"),
        (lambda: fly(colunm=PULL), "colunm: unknown key; did you mean column?"),
        (lambda: fly(column=PULL, name="pull", seed=-1), "pull: seed: input should be greater"),
        (
            lambda: fly(column=PULL, configuration="stiff"),
            "configuration: is 'stiff'; known",
        ),
        (lambda: fly(column=PULL, dynamic_pressure_Pa=9.0), "t37 has an aircraft, which gives q̄"),
        (lambda: fly(column=PULL, wind={"time_s": [0.0]}), "wind.along_m_per_s: is missing"),
        (lambda: fly(column=PULL, record_properties=["no/such"]), "has no property 'no/such'"),
        (lambda: fly(column=PULL, record_properties=["a/b", "a/b"]), "names a/b twice"),
        (
            lambda: fly(column=coupled.ForceTable(time_s=[0.0, 0.0], force_N=[0.0, 1.0])),
            "pilot.column.time_s: must rise: row 1 does not",
        ),
        (
            lambda: fly(column=coupled.ForceTable(time_s=[0.0, 1.0], force_N=[0.0])),
            "pilot.column.force_N: has 1 values, time_s 2",
        ),
        (lambda: fly(column=coupled.ForceTable()), "needs a file, or time_s and force_N"),
        (lambda: fly(column=coupled.ForceTable(file="no/such.csv")), "no/such.csv: cannot be read"),
        (lambda: fly(what="pull-up-t37"), "is no shipped rig; it is a shipped run"),
        (lambda: fly(what=case(), column=PULL), "is given by the manoeuvre itself"),
        (lambda: coupled.diagnose("t37", []), "records: needs at least one"),
        (
            lambda: coupled.diagnose("t37", "no.csv", control=STICK),
            "control: is 'stick'; known",
        ),
    ],
)
def test_a_fault_from_python_is_the_run_file_s_one_line(make: Any, says: str) -> None:
    with pytest.raises(coupled.InputError) as caught:
        make()
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def fly(what: Any = "t37", duration_s: Any = 1.0, **given: Any) -> coupled.Record:
    if isinstance(what, coupled.Manoeuvre):
        duration_s = None
    return coupled.fly(what, duration_s=duration_s, **given).record


def case() -> coupled.Manoeuvre:
    return coupled.Manoeuvre(coupled.load_rig("t37"), {"column": PULL}, duration_s=1.0)


def test_a_fault_of_the_rig_names_the_rig_where_there_is_no_file() -> None:
    nowhere = coupled.load_rig("t37").changed({"flight.model": "no-such-aircraft"})
    with pytest.raises(coupled.InputError, match=r"^t37: flight\.model: ") as caught:
        fly(nowhere, column=PULL)
    assert "no-such-aircraft" in str(caught.value)


def test_a_record_lists_its_channels_and_draws_them() -> None:
    record = fly(column=PULL)
    assert repr(record).startswith("Record(120 rows, 1 s at 120 Hz; 46 channels: time_s, ")
    frame = record.to_polars()
    assert frame.shape == (120, 46)
    assert np.array_equal(frame["pitch_rad"].to_numpy(), record["pitch_rad"])
    figure = record.plot("column_force_N", "pitch_rate_rad_per_s")
    assert [axes.get_ylabel() for axes in figure.axes] == ["column force, N", "pitch rate, °/s"]
    [drawn] = figure.axes[1].get_lines()
    assert drawn.get_ydata() == pytest.approx(np.degrees(record["pitch_rate_rad_per_s"]))
    assert len(record.plot().axes) > 6
    with pytest.raises(coupled.InputError, match="did you mean pitch_rad"):
        record.plot("pitch_rads")


def test_a_missing_pandas_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(coupled.InputError, match="pandas: is not installed: pip install pandas"):
        fly(column=PULL).to_pandas()


@pytest.mark.slow
def test_a_record_is_diagnosed_from_a_file_as_from_memory(tmp_path: Path) -> None:
    rig = coupled.load_rig("t37")
    worn = rig.changed({"controls.column.loader.bend_m_per_N": 4e-4})
    sweep = coupled.FrequencySweep(force_N=40, start_s=0.2, duration_s=5)
    record = coupled.fly(worn, column=sweep, duration_s=5.5).record
    path = tmp_path / "worn.csv"
    coupled.write_record(record, path)
    found = coupled.diagnose(rig, path)
    bend = found.improved.controls["column"].loader.bend
    assert bend == pytest.approx(4e-4, rel=0.02)
    assert coupled.diagnose("t37", {"worn": record}).improved == found.improved


def test_the_backlash_of_an_eight_second_flight_is_found() -> None:
    """From a rig's name to a diagnosis, without a file: the way in that the package promises."""
    rig = coupled.load_rig("t37").changed({"controls.column.loader.play_m": 1e-3})
    flight = coupled.fly(rig, column=coupled.Step(force_N=50), duration_s=8)
    found = coupled.diagnose("t37", flight.record)
    assert found.verdict == "effect"
    assert [effect.name for effect in found.effects] == ["backlash"]
    assert found.effects[0].value == pytest.approx(1e-3, rel=0.02)
    assert found.improved.controls["column"].loader.play == pytest.approx(1e-3, rel=0.02)
    assert found.as_dict()["verdict"] == found.verdict


def test_a_plot_leaves_out_what_rests() -> None:
    """A column's pull on a rig of three controls: no panels of zeros, and the figure says so."""
    flight = coupled.fly("t37", column=coupled.Step(force_N=20, start_s=0.1), duration_s=0.5)
    figure = flight.record.plot()
    labels = [axes.get_ylabel() for axes in figure.axes if axes.get_visible()]
    assert "column force, N" in labels
    assert not [label for label in labels if label.startswith(("wheel", "pedals"))]
    assert figure.get_supxlabel() == "at rest, not drawn: wheel, pedals"
