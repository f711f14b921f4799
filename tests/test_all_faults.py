"""A file's faults are named all at once, a line each: sweeps, maps, readings, records.toml."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from coupled.calibration.readingsfile import read_readings
from coupled.campaign.plan import read_plan
from coupled.errors import InputError
from coupled.flight.runfile import read_run
from coupled.gap.batch import jobs
from coupled.record.importing.mapping import read_map
from tests.support.commands import coupled

SWEEP = """
name = "s"
run = "worst-case"
sampels = 3
[[vary]]
key = "rig.loader.mass_kg"
valeus = [1.0]
[[vary]]
key = "rig.loader.friction_N"
steps = 1
low = 1.0
high = 2.0
"""
VALUES = """
name = "s"
run = "worst-case"
extremes = ["column_forc_N"]
[[vary]]
key = "rig.controls.column.loader.mass_k"
values = [1.0]
[[vary]]
key = "rig.controls.column.loader.friction_N"
values = [-1.0, 2.0]
"""
TOGETHER = """
name = "s"
run = "worst-case"
samples = 4
keep = ["loss", "loss"]
[[vary]]
key = "rig.controls.column.loader.friction_N"
low = 2.0
high = 1.0
[[survive]]
channel = "load_factor"
"""
MAP = """
[clock]
from = "T"
unit = "N"
[channels.column_force_N]
from = "F"
unit = "lbff"
sgin = -1
[channels.column_computd_m]
from = "D"
[channels.column_deflection_m]
from = "D"
scale = 0
unit = "kt"
"""
READINGS = """gradient_set,deflection_m,force_N,v1_V,v3_V
a,0.01,ten,1.0,1.0
a,0.02,20,2.0,
,0.03,30,3.0,3.0
a,0.04,40,4.0
a,0.05,50,5.0,5.0
a,0.05,50,5.0,5.0
"""
RECORDS = '"no" = "737"\n"b" = 3\n"../c" = "737"\n'


def faults(read: Callable[[], object]) -> dict[str, str]:
    with pytest.raises(InputError) as fault:
        read()
    return {one.key: one.problem for one in fault.value.every}


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        (SWEEP, {"sampels", "vary[0].valeus", "vary[1].steps"}),
        (VALUES, {"extremes", "vary[0]", "vary[1]"}),
        (TOGETHER, {"samples", "keep", "vary[0].steps", "vary[0].high", "survive[0]"}),
        ("vary = 3\nmethod = 'gird'\n", {"vary", "method", "name", "run"}),
    ],
    ids=["keys", "values", "together", "no list"],
)
def test_every_fault_of_a_sweep_file_is_named(tmp_path: Path, text: str, keys: set[str]) -> None:
    (tmp_path / "s.toml").write_text(text)
    assert set(faults(lambda: read_plan(tmp_path / "s.toml"))) == keys


def test_every_fault_of_an_import_map_is_named(tmp_path: Path) -> None:
    (tmp_path / "m.toml").write_text(MAP)
    found = faults(lambda: read_map(tmp_path / "m.toml"))
    assert set(found) == {"channels.column_force_N.sgin", "channels.column_computd_m"} | {
        "clock.unit",
        "channels.column_deflection_m.scale",
        "channels.column_deflection_m.unit",
    }


def test_every_fault_of_a_readings_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(READINGS)
    found = faults(lambda: read_readings(tmp_path / "r.csv", "column"))
    rows = {"row 2: force_N", "row 3: v3_V", "row 4: gradient_set", "row 5", "row 7"}
    assert set(found) == rows
    done = coupled(tmp_path, "calibrate", "r.csv")
    assert (done.returncode, done.stderr.count("error: r.csv: row")) == (2, 5)


@pytest.mark.parametrize("rig", ["", 'rig = ""', "rig = 3"], ids=["none", "empty", "number"])
def test_faults_of_a_run_file_are_named_although_its_rig_is_missing(
    tmp_path: Path, rig: str
) -> None:
    """An invalid rig name is reported once, without a list of shipped rigs."""
    (tmp_path / "r.toml").write_text(f'{rig}\nname = "r"\ncard = "c"\nduration_s = "long"\n')
    with pytest.raises(InputError) as fault:
        read_run(str(tmp_path / "r.toml"))
    assert sorted(one.key for one in fault.value.every) == ["duration_s", "rig"]


def test_a_misspelt_rig_and_a_missing_key_are_both_named(tmp_path: Path) -> None:
    """The rig is looked at, too, where each table of the run is right and only a key lacks."""
    (tmp_path / "r.toml").write_text(
        'name = "r"\nrig = "t73"\nduration_s = 1.0\n[pilot.column]\nkind = "step"\nforce_N = 1.0\n'
    )
    found = faults(lambda: read_run(str(tmp_path / "r.toml")))
    assert set(found) == {"card", "rig"}
    assert found["rig"].startswith("t73: is no shipped rig; did you mean")


def test_every_fault_of_a_records_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "records.toml").write_text(RECORDS)
    assert set(faults(lambda: jobs(tmp_path, tmp_path / "out"))) == {"no", "b", "../c"}
