"""Starters: each is what its command reads, as it was written."""

from __future__ import annotations

import csv
import shlex
import shutil
from pathlib import Path

import pytest

from coupled import load_rig, new_rig
from coupled.authority.firstrun import first_run
from coupled.calibration.form import starting_form
from coupled.calibration.readingsfile import read_readings
from coupled.campaign.plan import read_plan
from coupled.errors import InputError
from coupled.flight.pilot import Step
from coupled.flight.runfile import read_run
from coupled.record.importing.mapping import CHANNELS, read_map
from coupled.resources import shipped_rigs
from tests.support.commands import coupled, files


def test_a_new_run_passes_its_own_expectations(tmp_path: Path) -> None:
    made = coupled(tmp_path, "new", "run", "pull.toml")
    assert made.stdout.splitlines() == ["written: pull.toml", "next: coupled compare pull.toml"]
    checked = coupled(tmp_path, "check", "./pull.toml")
    assert checked.returncode == 0, checked.stdout
    assert "4 of 4 expectations hold" in checked.stdout


@pytest.mark.parametrize("rig", ["bench", pytest.param("c172p", marks=pytest.mark.slow)])
def test_a_new_run_of_a_rig_passes_its_own_expectations(tmp_path: Path, rig: str) -> None:
    made = coupled(tmp_path, "new", "run", "pull.toml", "--rig", rig)
    assert made.returncode == 0, made.stderr
    cases = read_run(str(tmp_path / "pull.toml"))
    for case in cases:
        column = case.rig.controls["column"]
        pull = case.pilots["column"]
        assert isinstance(pull, Step)
        assert pull.force_N > column.loader.breakout + column.loader.friction
    speeds = [case.rig.flight.calibrated_airspeed for case in cases if case.rig.flight]
    assert len(speeds) == (0 if rig == "bench" else 3)
    assert speeds == sorted(set(speeds))
    checked = coupled(tmp_path, "check", "./pull.toml")
    assert checked.returncode == 0, checked.stdout


def test_a_run_of_a_rig_names_it_from_the_runs_own_place(tmp_path: Path) -> None:
    (tmp_path / "rigs").mkdir()
    (tmp_path / "runs").mkdir()
    shutil.copy(shipped_rigs()["bench"], tmp_path / "rigs" / "mine.toml")
    words = ("new", "run", "runs/pull.toml", "--rig", "rigs/mine.toml")
    assert coupled(tmp_path, *words).returncode == 0
    (case,) = read_run(str(tmp_path / "runs" / "pull.toml"))
    assert case.rig.name == "bench"


def test_a_rig_that_no_run_suits_is_refused_and_nothing_written(tmp_path: Path) -> None:
    text = shipped_rigs()["bench"].read_text(encoding="utf-8")
    setpoint = text.replace("travel_m", 'drive = "setpoint"\ntravel_m', 1)
    (tmp_path / "mine.toml").write_text(setpoint, encoding="utf-8")
    done = coupled(tmp_path, "new", "run", "pull.toml", "--rig", "./mine.toml")
    assert done.returncode == 2
    assert "controls.column.drive: a setpoint has no loader that a force moves" in done.stderr
    assert files(tmp_path) == {"mine.toml"}


def test_a_run_without_a_speed_that_trims_is_refused_with_the_reason(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse(*given: object) -> None:
        raise InputError("t37", "flight.calibrated_airspeed_m_per_s", "T37 does not trim level")

    monkeypatch.setattr("coupled.authority.firstrun.speed_range", lambda *given: (40.0, 60.0))
    monkeypatch.setattr("coupled.authority.firstrun.fly_and_judge", refuse)
    with pytest.raises(InputError, match="calibrated_airspeed_m_per_s: T37 does not trim level"):
        first_run(load_rig("t37"), "column", "t37", "pull")


def test_a_rig_may_be_an_aircraft_alone(tmp_path: Path) -> None:
    made = coupled(tmp_path, "new", "rig", "T37", "air.toml", "--airframe-only")
    then = "next: coupled diagnose RECORD --rig air.toml"
    assert made.stdout.splitlines() == ["written: air.toml", then]
    rig = load_rig(tmp_path / "air.toml")
    assert (rig.controls, rig.flight and rig.flight.model) == ({}, "T37")
    assert new_rig("T37", "air", airframe_only=True).to_toml() == rig.to_toml()
    turned = rig.changed({"flight.roll_damping": 0.7, "flight.terms": {"aero/coefficient/Clr": 2}})
    turned.save(tmp_path / "turned.toml")
    assert load_rig(tmp_path / "turned.toml") == turned
    (tmp_path / "run.toml").write_text(
        'name = "x"\ncard = "x"\nrig = "air.toml"\nduration_s = 2\n'
        '[pilot.column]\nkind = "step"\nforce_N = 20\n'
    )
    (tmp_path / "sweep.toml").write_text(
        'name = "x"\nrun = "run.toml"\n[[vary]]\nkey = "rig.flight.mass"\nvalues = [1.0, 1.1]\n'
    )
    known = files(tmp_path)
    for words in (
        *(("map", "air.toml"), ("stability", "air.toml"), ("document", "air.toml")),
        *(("bench", "--rig", "air.toml"), ("calibrate", "--plan", "--rig", "air.toml")),
        *(("new", "run", "n.toml", "--rig", "air.toml"), ("export", "air.toml", "--jsbsim", "o")),
        *(("export", "air.toml", "--fmu", "a.fmu"),),
        *(("compare", "./run.toml"), ("fly", "./run.toml"), ("check", "./run.toml")),
        *(("sweep", "sweep.toml"), ("live", "./run.toml")),
    ):
        done = coupled(tmp_path, *words)
        assert done.returncode == 2, words
        assert done.stderr.endswith(
            "air.toml: controls: the rig has an aircraft only;"
            " give a rig with a control ([controls.column])\n"
        ), (words, done.stderr)
        assert done.stderr.count("\n") == 1, done.stderr
    assert files(tmp_path) == known


def test_a_rig_with_neither_control_nor_aircraft_is_refused(tmp_path: Path) -> None:
    (tmp_path / "none.toml").write_text('name = "none"\nframe_rate_Hz = 120.0\n')
    with pytest.raises(InputError, match=r"controls: needs at least one of column, .*\[flight\]"):
        load_rig(tmp_path / "none.toml")
    with pytest.raises(InputError, match=r"controls: a rig needs a control or an aircraft"):
        new_rig("T37", airframe_only=True).changed({"flight": None})
    done = coupled(tmp_path, "new", "rig", "--bench", "b.toml", "--airframe-only")
    assert done.returncode == 2
    assert "--airframe-only: a bench has no aircraft" in done.stderr


def test_a_new_sweep_is_planned_as_its_comments_say(tmp_path: Path) -> None:
    assert coupled(tmp_path, "new", "sweep").returncode == 0
    plan = read_plan(tmp_path / "my-sweep.toml")
    assert len(plan.keys) == 2
    assert [len(plan.sweep.vary[1].values or ()), plan.sweep.vary[0].steps] == [2, 4]


def test_a_new_map_names_channels_of_a_record(tmp_path: Path) -> None:
    assert coupled(tmp_path, "new", "map", "m.toml").returncode == 0
    found = read_map(tmp_path / "m.toml")
    assert {"column_force_N", "column_computed_m", "column_deflection_m"} <= set(found.channels)
    text = (tmp_path / "m.toml").read_text(encoding="utf-8")
    named = [
        line.split(".", 1)[1].split("]")[0] for line in text.splitlines() if "[channels." in line
    ]
    assert len(named) == 8
    assert set(named) <= set(CHANNELS)


@pytest.mark.parametrize("control", ["column", "wheel", "pedals"])
@pytest.mark.parametrize("inches", [False, True])
def test_new_readings_are_read_once_they_are_filled_in(
    tmp_path: Path, control: str, inches: bool
) -> None:
    rows = list(csv.DictReader(starting_form(control, inches).splitlines()))
    empty = tmp_path / "form.csv"
    empty.write_text(starting_form(control, inches), encoding="utf-8")
    with pytest.raises(InputError, match="row 2"):
        read_readings(empty, control)
    for i, row in enumerate(rows):
        loaded = row["remark"].startswith(("softest", "stiffest"))
        numbers = [
            head for head in row if head.split("_")[0] in ("deflection", "force", "v1", "v3")
        ]
        row.update({head: str(1 + i) for head in numbers if loaded or head in ("v1_V", "v3_V")})
        row["v2_V"] = "" if loaded else "2"
    with empty.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    found = read_readings(empty, control)
    assert len(found.row) == 8
    assert len(found.null_row) == 4
    assert sorted(set(found.null_side)) == [-1.0, 1.0]


def test_nothing_is_overwritten_and_endings_are_held(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("precious")
    for words, said in (
        (("run", "mine.toml"), "mine.toml: is there already; give the name of a new file"),
        (("sweep", "mine"), "mine: give a name that ends in .toml"),
        (("readings", "x.csv", "--control", "stick"), "--control: no 'stick'"),
    ):
        done = coupled(tmp_path, "new", *words)
        assert done.returncode == 2
        assert done.stderr.startswith("error: ")
        assert said in done.stderr
    assert files(tmp_path) == {"mine.toml"}
    assert (tmp_path / "mine.toml").read_text() == "precious"


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ('Rück 7 "b"', "Ruck-7-b"),
        (r"a\b", "a-b"),
        ("two\nlines", "two-lines"),
        ("it's <b>", "it-s-b"),
        ("😀", "unnamed"),
        ("n" * 90, "n" * 80),
    ],
)
def test_a_file_of_any_name_is_valid(tmp_path: Path, stem: str, name: str) -> None:
    bench = ("--set", "travel=0.1", "--set", "gradient=500", "--set", "servo=no")
    rig, run = f"{stem}.toml", f"r {stem}.toml"
    for words in (("rig", "--bench", rig, *bench), ("run", run, "--rig", rig)):
        done = coupled(tmp_path, "new", *words)
        assert done.returncode == 0, done.stderr
    assert load_rig(tmp_path / rig).name == name
    (case,) = read_run(str(tmp_path / run))
    assert case.rig.name == name


def test_the_next_command_can_be_copied(tmp_path: Path) -> None:
    done = coupled(tmp_path, "new", "map", "it's a (map).toml")
    said = done.stdout.replace("\n", " ").partition("next: ")[2]
    assert shlex.split(said)[-1] == "it's a (map).toml"
