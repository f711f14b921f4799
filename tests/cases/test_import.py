"""Logs that an import once read wrong without a word, or refused without a way out."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from coupled.record.record import read_record
from tests.support.commands import coupled

CASES = Path(__file__).parents[1] / "data" / "cases"


def taken(folder: Path, case: str) -> Path:
    """Copy the files of a case, and return where they are."""
    for file in (CASES / case).iterdir():
        shutil.copyfile(file, folder / file.name)
    return folder


def imported(folder: Path, log: str, rig: str = "") -> dict[str, np.ndarray]:
    """Import a log by its map, and return the channels of the record."""
    words = ["import", log, "--map", "map.toml", "-o", "r.csv", *(["--rig", rig] if rig else [])]
    done = coupled(folder, *words)
    assert done.returncode == 0, done.stderr
    record = read_record(folder / "r.csv")
    return {name: record[name] for name in record.channels}


def refused(folder: Path, log: str) -> str:
    """Import a log that is refused, and return the one line; nothing is written."""
    before = sorted(folder.iterdir())
    done = coupled(folder, "import", log, "--map", "map.toml", "-o", "r.csv")
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert sorted(folder.iterdir()) == before
    return done.stderr


def remapped(folder: Path, *edits: tuple[str, str]) -> None:
    """Change the map."""
    text = (folder / "map.toml").read_text()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new)
    (folder / "map.toml").write_text(text)


def column(folder: Path, place: int) -> np.ndarray:
    """Return a column of the log in a case's CSV, counted from 0."""
    return np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1, usecols=place)


def test_a_clock_that_goes_back_is_named_and_its_remedy_works(tmp_path: Path) -> None:
    folder = taken(tmp_path, "clock-goes-back")
    said = refused(folder, "log.csv")
    assert "log.csv: t: row 121: time goes back" in said
    for remedy in ("sort = true", "wraps_at = N", "drop_rows = [121]"):
        assert remedy in said
    remapped(folder, ("[clock]", "[clock]\nwraps_at = 160"))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_force_N"], column(folder, 1))


def test_sorting_does_not_mix_a_clock_that_was_set_back(tmp_path: Path) -> None:
    folder = taken(tmp_path, "clock-goes-back")
    head, *rows = (folder / "log.csv").read_text().splitlines()
    cells = [row.split(",") for row in rows]
    start = float(cells[60][0]) + 0.004
    again = [f"{start + i / 120:.6f},{','.join(row[1:])}" for i, row in enumerate(cells[:60])]
    (folder / "log.csv").write_text("\n".join([head, *rows[:119], *again]))
    remapped(folder, ("[clock]", "[clock]\nsort = true"))
    assert 'clock.drop_rows = ["121-180"]' in refused(folder, "log.csv")
    remapped(folder, ("sort = true", 'drop_rows = ["121-180"]'))
    assert len(imported(folder, "log.csv")["time_s"]) == 119


def test_a_row_that_is_there_twice_is_dropped_on_request(tmp_path: Path) -> None:
    folder = taken(tmp_path, "duplicate-row")
    said = refused(folder, "log.csv")
    assert "row 121 repeats the time" in said
    assert "clock.drop_duplicates = true" in said
    remapped(folder, ("[clock]", "[clock]\ndrop_duplicates = true"))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_force_N"], np.delete(column(folder, 1), 119))


def test_an_angle_that_wraps_is_followed(tmp_path: Path) -> None:
    folder = taken(tmp_path, "encoder-0-360")
    read = column(folder, 3)
    assert np.ptp(read) > 350.0
    turned_deg = np.where(read > 180.0, read - 360.0, read)
    scale = 0.010471975511965978
    record = imported(folder, "log.csv")
    np.testing.assert_allclose(record["column_deflection_m"], scale * turned_deg, atol=1e-12)
    assert np.ptp(record["column_deflection_m"]) < 0.04


def test_a_column_of_two_of_one_name_can_be_named(tmp_path: Path) -> None:
    folder = taken(tmp_path, "same-name-twice")
    assert 'give from = "Pos#1" or "Pos#2"' in refused(folder, "log.csv")
    text = (folder / "map.toml").read_text().replace('"Pos"', '"Pos#1"', 1)
    (folder / "map.toml").write_text(text.replace('"Pos"', '"Pos#2"'))
    record = imported(folder, "log.csv")
    np.testing.assert_array_equal(record["column_computed_m"], column(folder, 2))
    np.testing.assert_array_equal(record["column_deflection_m"], column(folder, 3))


def test_joints_whose_order_changes_are_read_by_name(tmp_path: Path) -> None:
    folder = taken(tmp_path, "joint-order")
    said = refused(folder, "log.mcap")
    assert "/joint_states.effort[0]: is column in one message and wheel in another" in said
    assert "give it by its name, as /joint_states.effort[column]" in said
    remapped(folder, ("[0]", "[column]"))
    record = imported(folder, "log.mcap")
    assert np.max(np.abs(record["column_deflection_m"])) < 0.02  # the wheel stands at 0.3
    assert np.max(np.abs(np.diff(record["column_deflection_m"]))) < 1e-3


def test_the_rule_behind_a_value_table_is_used(tmp_path: Path) -> None:
    record = imported(taken(tmp_path, "mdf-value-table"), "log.mf4")
    force_N = record["column_force_N"]  # 0.1·n − 400, by its default conversion
    assert force_N[0] == pytest.approx(0.1 * 4001 - 400.0, abs=1e-9)
    np.testing.assert_allclose(10.0 * force_N, np.rint(10.0 * force_N), atol=1e-6)
    assert np.max(np.abs(force_N)) < 50.0


def test_a_scale_that_the_library_does_not_know_is_refused(tmp_path: Path) -> None:
    said = refused(taken(tmp_path, "tdms-unknown-scale"), "log.tdms")
    assert "log.tdms: F: " in said
    assert "Unsupported scale type: Reciprocal" in said


def test_a_grip_is_not_taken_for_the_actuator(tmp_path: Path) -> None:
    folder = taken(tmp_path, "suggest-exchanged")
    done = coupled(folder, "import", "run17_friction.csv", "--suggest", "m.toml")
    assert done.returncode == 0, done.stderr
    channels = tomllib.loads((folder / "m.toml").read_text())["channels"]
    assert channels["column_computed_m"]["from"] == "Act Pos (in)"
    assert channels["column_deflection_m"]["from"] == "Grip LVDT (in)"
    remapped(folder, ('"?"', "-1"))  # the exchanged map, its question answered
    done = coupled(folder, "import", "run17_friction.csv", "--map", "map.toml", "-o", "r.csv")
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.replace("│", " ").split())
    assert "falls short of" in said
    assert "exchanged, or a scale?" in said


@pytest.mark.slow
def test_a_bench_with_one_gradient_needs_no_dynamic_pressure(tmp_path: Path) -> None:
    folder = taken(tmp_path, "bench-without-pressure")
    imported(folder, "log.csv", rig="rig.toml")
    done = coupled(folder, "diagnose", "r.csv", "--rig", "rig.toml", "--control", "wheel")
    assert done.returncode == 0, done.stderr
    assert "Coulomb friction" in done.stdout


@pytest.mark.parametrize("name", ["rep.csv", "dates.parquet"])
def test_stamps_that_stand_still_are_no_clock(tmp_path: Path, name: str) -> None:
    folder = taken(tmp_path, "robust-06")
    done = coupled(folder, "import", name, "--suggest", "m.toml")
    assert done.returncode == 0, done.stderr
    assert tomllib.loads((folder / "m.toml").read_text())["clock"] == {"rate_Hz": "?"}


def test_lists_of_lists_are_no_numbers(tmp_path: Path) -> None:
    folder = taken(tmp_path, "robust-06")
    done = coupled(folder, "import", "nested.parquet", "--suggest", "m.toml")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    shutil.copyfile(folder / "m-nested.toml", folder / "map.toml")
    remapped(folder, ('element = "?"', "element = 1"))
    assert "force_lbf: holds List(List(Float64))" in refused(folder, "nested.parquet")
