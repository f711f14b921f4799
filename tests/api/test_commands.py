"""Each function gives what its command gives."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import polars as pl
import pytest

import coupled
from coupled.calibration.estimate import usual_instruments
from coupled.errors import InputError
from coupled.files import finite
from coupled.rig.rigfile import read_rig
from coupled.schema import load_toml
from tests.support.commands import coupled as command
from tests.support.commands import files


def told(folder: Path, *words: str, code: int = 0) -> Any:
    """Give a command with --json, and return the JSON."""
    done = command(folder, *words, "--json", "told.json")
    assert done.returncode == code, done.stderr
    return json.loads((folder / "told.json").read_text())


def as_json(table: object) -> Any:
    return json.loads(json.dumps(finite(table)))


def test_bench_takes_the_commands_readings(tmp_path: Path) -> None:
    words = ("bench", "--gradients", "3", "--deflections", "3", "--seed", "4", "-o", "told.csv")
    done = command(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    readings = coupled.bench(gradients=3, deflections=3, seed=4, file=tmp_path / "own.csv")
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "told.csv").read_bytes()
    assert readings.to_polars()["v1_V"].to_list() == readings.v1.tolist()
    for wrong, said in (
        ({"control": "wheel"}, "the rig has no wheel"),
        ({"file": tmp_path / "own.txt"}, r"ends in \.csv"),
        ({"onse": True}, "did you mean once"),
    ):
        with pytest.raises(coupled.InputError, match=said):
            coupled.bench(**wrong)


def test_plan_is_the_commands(tmp_path: Path) -> None:
    words = ("calibrate", "--plan", "--precision", "8", "--once", "--write", "told.csv")
    wanted = told(tmp_path, *words)
    plan = coupled.plan(precision=0.08, once=True, file=tmp_path / "own.csv")
    assert as_json(plan.as_dict()) == wanted
    assert (tmp_path / "own.csv").read_bytes() == (tmp_path / "told.csv").read_bytes()


def test_models_are_the_commands(tmp_path: Path) -> None:
    found = coupled.models(["T37", "L17"])
    assert as_json(found.as_dict()) == told(tmp_path, "models", "T37", "L17")
    with pytest.raises(coupled.InputError, match="T73: is no JSBSim model"):
        coupled.models(["T73"])


def test_export_writes_the_commands_files(tmp_path: Path) -> None:
    wanted = told(tmp_path, "export", "bench", "--jsbsim", "told", "--run", "appendix-c")
    made = coupled.export("bench", tmp_path / "own", runs=["appendix-c"])
    assert as_json(made.as_dict()) == wanted
    assert files(tmp_path / "own") == files(tmp_path / "told")
    assert made.within
    with pytest.raises(coupled.InputError, match="no case 'exakt'"):
        coupled.export("bench", tmp_path / "new", runs=["appendix-c"], case="exakt")


@pytest.mark.slow
def test_a_new_rig_is_the_commands(tmp_path: Path) -> None:
    done = command(tmp_path, "new", "rig", "OV10", "first.toml")
    assert done.returncode == 0, done.stderr
    rig = coupled.new_rig("OV10", "first")
    assert rig.to_toml() == (tmp_path / "first.toml").read_text()
    assert rig == read_rig(tmp_path / "first.toml")


@pytest.mark.slow
def test_fit_is_the_commands(tmp_path: Path) -> None:
    rig = coupled.load_rig("t37")
    heavy = rig.changed({"controls.column.loader.mass_kg": 7.0})
    sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=8)
    record = coupled.fly(heavy, column=sweep, duration_s=10).record
    coupled.write_record(record, tmp_path / "well.parquet")
    words = ("fit", "well.parquet", "--rig", "t37", "--free", "loader.mass_kg")
    wanted = told(tmp_path, *words, "--output", "told.toml")
    found = coupled.fit(rig, {"well.parquet": record}, ["loader.mass_kg"])
    assert as_json(found.as_dict()) == wanted
    assert found.rig.controls == coupled.load_rig(tmp_path / "told.toml").controls
    for frame in (record.to_polars(), record.to_pandas()):
        again = coupled.fit(rig, frame, ["loader.mass_kg"])
        assert again.numbers == found.numbers


@pytest.mark.slow
def test_a_dataframe_is_diagnosed_as_its_record() -> None:
    rig = coupled.load_rig("t37")
    worn = rig.changed({"controls.column.loader.bend_m_per_N": 4e-4})
    sweep = coupled.FrequencySweep(force_N=40, start_s=0.5, duration_s=8)
    record = coupled.fly(worn, column=sweep, duration_s=10).record
    bends = []
    for frame in (record.to_polars(), record.to_pandas(), record.to_pandas().set_index("time_s")):
        found = coupled.diagnose(rig, frame)
        assert [effect.name for effect in found.effects] == ["bend"]
        bends.append(found.improved["controls.column.loader.bend_m_per_N"])
    assert bends == pytest.approx([4e-4] * 3, rel=1e-3)


@pytest.mark.slow
def test_the_authority_map_is_the_commands(tmp_path: Path) -> None:
    done = command(tmp_path, "map", "bench", "-o", "told.png")
    assert done.returncode == 0, done.stderr
    found = coupled.map_authority("bench")
    assert found.to_polars().equals(pl.read_csv(tmp_path / "told.csv"))
    assert found.feel is None
    flight = coupled.fly(
        "bench", column=coupled.Step(force_N=20), duration_s=1, dynamic_pressure_Pa=2000.0
    )
    flown = coupled.map_authority("bench", flight.record)
    assert flown.flown["column"].shape == (2, len(flight.record))
    with pytest.raises(coupled.InputError, match="dynamic_pressure_Pa: no such channel"):
        coupled.map_authority("bench", pl.DataFrame({"time_s": [0.0, 1.0], "a": [0.0, 1.0]}))


@pytest.mark.slow
def test_stability_is_the_commands(tmp_path: Path) -> None:
    wanted = told(tmp_path, "stability", "bench", "-o", "told.png")
    found = coupled.stability("bench")
    assert as_json(found.as_dict()) == wanted
    rows = pl.read_csv(tmp_path / "told.csv")
    assert found.to_polars().equals(rows)
    rigid = coupled.load_rig("bench").changed({"controls.column.loader.bend_m_per_N": 0.0})
    with pytest.raises(coupled.InputError, match="nothing bends"):
        coupled.stability(rigid)


@pytest.mark.slow
def test_the_document_is_the_commands(tmp_path: Path) -> None:
    wanted = told(tmp_path, "document", "bench", "--output", "told", code=1)
    found = coupled.document("bench", folder=tmp_path / "own")
    assert as_json(found.as_dict()) == wanted
    assert not found.passed
    assert files(tmp_path / "own") == files(tmp_path / "told")
    stiff = {"controls.column.schedule.total_gradient_N_per_m": [400.0, 1600.0]}
    changed = coupled.document(coupled.load_rig("bench").changed(stiff), specified="bench")
    assert changed.issue.rig_file == "bench.toml, changed"
    assert changed.issue.reference == "what bench.toml specifies"


def test_calibration_goes_into_a_rig(tmp_path: Path) -> None:
    coupled.bench(gradients=3, deflections=3, file=tmp_path / "own.csv")
    words = ("calibrate", "own.csv", "--write", "told.toml", "--date", "2031-05-17")
    done = command(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    found = coupled.calibrate(tmp_path / "own.csv")
    rig = coupled.load_rig("report-column")
    calibrated = coupled.with_calibration(rig, "column", found, "2031-05-17")
    calibrated.save(tmp_path / "own.toml")
    told_rig, own_rig = (load_toml(tmp_path / f"{name}.toml") for name in ("told", "own"))
    for section in ("sensing", "compensation", "calibration"):
        assert own_rig["controls"]["column"][section] == told_rig["controls"]["column"][section]
    assert coupled.load_rig(tmp_path / "own.toml") == coupled.load_rig(tmp_path / "told.toml")


def test_a_calibration_of_another_control_goes_into_no_rig() -> None:
    found = coupled.calibrate(coupled.bench(gradients=3, deflections=3))
    with pytest.raises(InputError, match="the calibration is of the column, not of the wheel"):
        coupled.with_calibration(coupled.load_rig("t37"), "wheel", found)
    with pytest.raises(InputError, match="the rig has no wheel"):
        coupled.with_calibration(coupled.load_rig("report-column"), "wheel", found)


@pytest.mark.parametrize(
    ("name", "value"),
    [("precision", -1.0), ("precision", nan), ("strongest_N", nan), ("crossed_N", -1.0)],
)
def test_a_plan_refuses_numbers_out_of_range(name: str, value: float) -> None:
    asked: Any = {name: value}
    with pytest.raises(InputError, match=rf"coupled\.plan: {name}: is .*; give "):
        coupled.plan("report-column", **asked)
    with pytest.raises(InputError, match=rf"coupled\.bench: {name}: is .*; give "):
        coupled.bench("report-column", **asked)


@pytest.mark.parametrize("error", [-1.0, nan, inf])
def test_an_instrument_has_no_error_below_0(error: float) -> None:
    with pytest.raises(InputError, match=r"instruments: meter: is .*; give 0, or"):
        replace(usual_instruments("column"), meter=error)
