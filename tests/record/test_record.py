"""A record's file: its columns are numbers, its manifest has a format."""

from __future__ import annotations

import json
import os
from datetime import datetime
from pathlib import Path

import numpy as np
import polars as pl
import pytest

import coupled
from coupled.errors import InputError
from coupled.record.record import (
    FORMAT,
    Record,
    manifest_path,
    read_record,
    record_of,
    write_record,
)

TIME = [0.0, 0.1, 0.2]
RECORD = Record(("time_s", "a"), np.column_stack([TIME, [1.0, np.pi, 3.0]]), {"seed": 3})


@pytest.mark.parametrize("name", ["r.csv", "r.parquet"])
def test_a_record_comes_back_to_the_last_bit_with_its_format(tmp_path: Path, name: str) -> None:
    write_record(RECORD, tmp_path / name)
    back = read_record(tmp_path / name)
    assert back.channels == RECORD.channels
    np.testing.assert_array_equal(back.data, RECORD.data)
    assert back.manifest == {"seed": 3, "format": FORMAT}


@pytest.mark.parametrize(
    "column",
    [
        pl.Series([[1.0], [2.0], [3.0]]),
        pl.Series([np.ones(2)] * 3, dtype=pl.Array(pl.Float64, 2)),
        pl.Series([b"1", b"2", b"3"]),
        pl.Series(["1", "2", "1"], dtype=pl.Categorical),
        pl.Series(["1", "2", "1"], dtype=pl.Enum(["1", "2"])),
        pl.Series([{"x": 1.0}] * 3),
        pl.Series([datetime(2026, 1, 1)] * 3),
    ],
    ids=lambda column: str(column.dtype).split("(")[0],
)
def test_a_column_that_holds_no_numbers_is_refused(tmp_path: Path, column: pl.Series) -> None:
    path = tmp_path / "r.parquet"
    pl.DataFrame({"time_s": TIME, "a": column}).write_parquet(path)
    with pytest.raises(InputError, match=r"r\.parquet: a: holds .*, no numbers"):
        read_record(path)


@pytest.mark.parametrize(("mark", "name"), [(";", "semicolons"), ("\t", "tabs")])
def test_another_separator_is_named(tmp_path: Path, mark: str, name: str) -> None:
    rows = ("time_s", "column_force_N"), ("0.0", "NaN"), ("0,1", "1.5")
    (tmp_path / "r.csv").write_text("\n".join(mark.join(row) for row in rows))
    with pytest.raises(InputError, match=rf"r\.csv: is separated by {name}; .* coupled import"):
        read_record(tmp_path / "r.csv")


def test_an_old_manifest_is_read_and_a_newer_one_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    write_record(RECORD, path)
    manifest = manifest_path(path)
    manifest.write_text('{"seed": 3}')
    assert read_record(path).manifest == {"seed": 3}
    manifest.write_text("[1")  # another program's file of that name
    assert read_record(path).manifest == {}
    manifest.write_text(json.dumps({"format": FORMAT + 1}))
    with pytest.raises(InputError, match=r"r\.manifest\.json: format: this record is of format 2"):
        read_record(path)
    manifest.unlink()
    os.mkfifo(manifest)
    with pytest.raises(InputError, match="is a pipe or a device"):
        read_record(path)


def test_a_record_and_its_manifest_are_written_together(tmp_path: Path) -> None:
    (tmp_path / "r.manifest.json").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_record(RECORD, tmp_path / "r.csv")
    assert [path.name for path in tmp_path.iterdir()] == ["r.manifest.json"]


def test_cells_may_have_spaces_about_their_numbers(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("time_s,a,b\n0.0, 1.5,2\n0.1,-2.5 ,3\n0.2,\t3.5\t,4\n", encoding="utf-8")
    np.testing.assert_array_equal(read_record(path)["a"], [1.5, -2.5, 3.5])
    path.write_text("time_s,a,b\n0.0,1.5,2\n0.1,  ,3\n0.2,3.5,4\n", encoding="utf-8")
    np.testing.assert_array_equal(read_record(path)["a"], [1.5, np.nan, 3.5])  # a gap


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ("wheel_comptued_rad", "wheel_computed_rad"),  # two letters exchanged
        ("wheel_computed_deg", "wheel_computed_rad"),  # another unit
        ("Wheel_Force_n", "wheel_force_N"),  # upper and lower case
        ("wheel_force", "wheel_force_N"),  # no unit
        ("roll_rate_deg_per_s", "roll_rate_rad_per_s"),
        ("dynamic_pressure_psf", "dynamic_pressure_Pa"),
    ],
)
def test_a_mistyped_channel_is_refused_with_its_name(wrong: str, right: str) -> None:
    columns = {"time_s": np.array([0.0, 0.1]), wrong: np.array([1.0, 2.0])}
    with pytest.raises(InputError, match=f"{wrong}.*rename it to {right}"):
        record_of(columns, "record.csv")


@pytest.mark.parametrize("own", ["room_C", "wheel_force_reserve", "pitch_trim_norm", "note"])
def test_a_channel_of_the_users_own_is_kept(own: str) -> None:
    columns = {"time_s": np.array([0.0, 0.1]), own: np.array([1.0, 2.0])}
    assert own in record_of(columns, "record.csv")


def test_a_second_sensor_beside_the_first_is_kept() -> None:
    names = ("time_s", "wheel_force_N", "wheel_force_2_N")
    assert record_of(dict.fromkeys(names, np.array([0.0, 0.1])), "record.csv").channels == names


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (Record(("time_s", "column_force_N"), np.zeros((0, 2))), "holds no channel over time"),
        (Record(("time_s", "column_force_N"), np.ones((9, 2))), "time_s: must rise"),
        (Record(("time_s", "column_force_lb"), np.arange(8.0).reshape(4, 2)), "rename it to"),
    ],
)
def test_a_record_that_no_file_could_hold_is_shown_and_refused(
    tmp_path: Path, record: Record, said: str
) -> None:
    assert repr(record).startswith("Record(")
    with pytest.raises(InputError, match=said):
        write_record(record, tmp_path / "r.csv")
    with pytest.raises(InputError, match=said):
        coupled.diagnose("report-column", record)
    assert not list(tmp_path.iterdir())


def test_a_manifest_that_is_no_json_is_refused_with_its_key(tmp_path: Path) -> None:
    record = Record(("time_s", "a"), np.arange(8.0).reshape(4, 2), {"b": 1, "c": np.arange(3)})
    with pytest.raises(InputError, match=r"manifest\.c: is of type ndarray"):
        write_record(record, tmp_path / "r.csv")
    assert not list(tmp_path.iterdir())
