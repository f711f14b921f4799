"""Faults that once got through: results that JSON cannot hold, full disks, hostile letters."""

from __future__ import annotations

import json
import os
import sqlite3
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import polars as pl
import pytest

import coupled
from coupled.authority.stability.limits import disagreement
from coupled.authority.stability.planes import Crossing, Plane
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.plan import stations
from coupled.errors import say_warning
from coupled.files import clear_temporary, json_text, temporary_folder, unfinished_name
from coupled.flight.airframe import packaged_models
from coupled.flight.altered import ALTERATIONS
from coupled.flight.modelfile import loadable
from coupled.gap.batch import jobs, known_row, made_by
from coupled.outputs import Outputs
from coupled.parallel import cores
from coupled.plots.saving import BOX, save, svg_text
from coupled.reports.page import Provenance, Report, Section, Text, Verdict, render
from tests.support.commands import coupled as command
from tests.support.rigs import bench

CALL: Any = coupled  # as a program without types calls it
HOSTILE = "a\x1b[31mb\u202ec"


def test_json_has_no_number_that_is_not_finite() -> None:
    table = {"a": [1.0, float("inf"), (float("nan"),)], "b": {"c": -float("inf"), "d": "inf"}}
    assert json.loads(json_text(table)) == {"a": [1.0, None, [None]], "b": {"c": None, "d": "inf"}}


def plane(*crossings: Crossing) -> Plane:
    empty = np.zeros((0, 0))
    line = np.zeros(0)
    return Plane("column", "frame", line, line, empty, empty, line, line, empty, crossings)


def test_a_limit_that_theory_lacks_is_counted_and_not_infinitely_far() -> None:
    both, alone = Crossing(0.1, 1.02, 1.0), Crossing(0.2, 3.0, None)
    found = disagreement([plane(both, alone)])
    assert (found.limits, found.alone) == (2, 1)
    assert found.worst == pytest.approx(0.02)
    assert "1 of which linear theory does not have" in found.words
    none = disagreement([plane(alone)])
    assert none.most is None
    assert none.worst is None
    assert "nan" not in none.words


def test_a_loader_that_friction_holds_gives_no_nulls() -> None:
    """The voltmeter reads 0 V there, and nothing brings 0 V back: no number is written."""
    rig = bench().changed({"controls.column.loader.friction_N": 400.0})
    tools = usual_instruments("column")
    readings = take_readings(
        CalibrationBench(rig, "column", stations(rig, "column", 2, 2), tools, nulls=4), seed=1
    )
    assert len(readings.null_row) == 0
    free = bench()
    readings = take_readings(
        CalibrationBench(free, "column", stations(free, "column", 2, 2), tools, nulls=4), seed=1
    )
    assert len(readings.null_row) == 4
    assert np.isfinite(readings.null_v2).all()


def test_letters_that_no_font_has_are_drawn_as_boxes_without_a_warning(tmp_path: Path) -> None:
    record = coupled.Record(("time_s", "a"), np.array([[0.0, 1.0], [1.0, 2.0]]))
    with (
        patch("coupled.plots.saving.OTHER_FONTS", ()),
        warnings.catch_warnings(record=True) as said,
    ):
        figure = record.plot("a", title=f"漢字 {HOSTILE}")
        figure.axes[0].set_xticks([0.0, 1.0], labels=["字", "b"])
        save(figure, tmp_path / "f.png")
        text = svg_text(figure)
    assert said == []
    assert figure.get_suptitle() == f"{BOX * 2} a?[31mb?c"
    assert "\x1b" not in text
    assert "\u202e" not in text


def test_a_report_shows_no_letter_that_acts_on_a_page() -> None:
    made = Provenance(HOSTILE, (("coupled", HOSTILE),), ())
    section = Section(HOSTILE, (Text((HOSTILE,)),))
    text = render(Report("check", HOSTILE, Verdict(HOSTILE), (section,), (("a", HOSTILE),), made))
    assert "a?[31mb?c" in text
    for letter in "\x1b\u202e":
        assert letter not in text


def test_a_library_s_warning_is_a_line_without_a_path(capsys: pytest.CaptureFixture[str]) -> None:
    say_warning(UserWarning("two\nlines"), UserWarning, "/home/x/y.py", 3)
    assert capsys.readouterr().err == "note: two lines\n"


@contextmanager
def full_disk() -> Iterator[None]:
    """Let each file take 20 kB, as a disk that is full: what is too large raises as there."""
    resource = pytest.importorskip("resource")  # not on Windows
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("suffix", ["pdf", "png", "svg"])
def test_a_figure_on_a_full_disk_is_one_line(tmp_path: Path, suffix: str) -> None:
    rng = np.random.default_rng(1)
    data = np.column_stack((np.arange(4000.0), rng.standard_normal(4000)))
    figure = coupled.Record(("time_s", "a"), data).plot("a")
    path = tmp_path / f"f.{suffix}"
    with full_disk(), pytest.raises(coupled.InputError, match="cannot be written: File too large"):
        save(figure, path)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_on_a_full_disk_is_named(tmp_path: Path) -> None:
    """Not the standard output, which has nothing to do with it."""
    with (
        full_disk(),
        pytest.raises(coupled.InputError, match="export: cannot be written: File too large"),
        Outputs() as outputs,
    ):
        outputs.at(tmp_path / "export" / "a.xml").write_bytes(b"x" * 30_000)
    assert list(tmp_path.iterdir()) == []


def test_the_root_of_the_file_system_is_no_folder_for_diagnoses(tmp_path: Path) -> None:
    (tmp_path / "r1.csv").write_text("time_s,a\n0,1\n1,2\n")
    (tmp_path / "records.toml").write_text('r1 = "report-column"\n')
    done = command(tmp_path, "diagnose", ".", "--output", "/")
    assert done.returncode == 2
    assert done.stderr == "error: /: is the root of the file system; give a folder of its own\n"
    assert not Path("/r1.json").exists()


@pytest.mark.parametrize(
    "damage",
    [
        lambda known: known | {"effects": 3},
        lambda known: known | {"effects": [{"name": 1}]},
        lambda known: known | {"rivals": [1]},
        lambda known: known | {"stages": {"loader": 1}},
        lambda known: known | {"shrink": []},
        lambda known: [known],
    ],
)
def test_an_old_diagnosis_that_is_damaged_is_made_again(tmp_path: Path, damage: Any) -> None:
    (tmp_path / "r1.csv").write_text("time_s,a\n0,1\n1,2\n")
    (tmp_path / "records.toml").write_text('r1 = "report-column"\n')
    [job] = jobs(tmp_path, tmp_path / "out")
    made = made_by(job)
    known = {"record": "r1", "format": 3, "verdict": "refused", "why": "x", "stages": {}}
    known |= {"effects": [], "rivals": [], "shrink": {}, "made": made}
    job.out.parent.mkdir()
    job.out.write_text(json.dumps(known))
    row = known_row(job, made)
    assert row is not None
    assert row.verdict == "refused"
    job.out.write_text(json.dumps(damage(known)))
    assert known_row(job, made) is None


def plan(name: str = "s") -> dict[str, Any]:
    bend = {"key": "rig.controls.column.loader.bend_m_per_N", "values": [1e-5]}
    return {"name": name, "run": "appendix-c", "configurations": ["rigid"], "vary": [bend]}


def test_a_sweep_leaves_nothing_in_another_s_folder(tmp_path: Path) -> None:
    (tmp_path / "flights.jsonl").write_text('{"sweep": "another"}\n')
    with pytest.raises(coupled.InputError, match="holds another sweep"):
        coupled.sweep(plan(), tmp_path, workers=1)
    assert [path.name for path in tmp_path.iterdir()] == ["flights.jsonl"]


def test_a_lock_that_cannot_be_written_is_not_another_sweep(tmp_path: Path) -> None:
    def full(*_: Any, **__: Any) -> Any:
        error = sqlite3.OperationalError("database or disk is full")
        error.sqlite_errorcode = sqlite3.SQLITE_FULL
        lock = connect(":memory:")
        return _Failing(lock, error)

    connect = sqlite3.connect
    with (
        patch("sqlite3.connect", full),
        pytest.raises(coupled.InputError, match="cannot be written: database or disk is full"),
    ):
        coupled.sweep(plan(), tmp_path / "new", workers=1)


class _Failing:
    """A data base that cannot be written to."""

    def __init__(self, lock: sqlite3.Connection, error: sqlite3.Error) -> None:
        self._lock, self._error = lock, error

    def execute(self, _: str) -> None:
        """Fail, as on a full disk."""
        raise self._error

    def close(self) -> None:
        """Close it."""
        self._lock.close()


@pytest.mark.parametrize("workers", [-1, 513, 10**9])
def test_a_number_of_workers_that_no_machine_has_is_refused(workers: int) -> None:
    with pytest.raises(coupled.InputError, match="give 1 to 512, or 0 for all cores"):
        cores(workers)


def test_models_takes_no_more_processes_than_there_are_cores(tmp_path: Path) -> None:
    done = command(tmp_path, "models", "T37", "-j", "100000")
    assert done.returncode == 2
    assert "512" in done.stderr


def test_what_a_killed_load_left_is_removed_by_the_next(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    with patch.object(tempfile, "tempdir", str(tmp_path)):
        gone = unfinished_name("").replace(f"-{os.getpid()}-", f"-{process.pid}-")
        (tmp_path / gone / "T37").mkdir(parents=True)
        ours = temporary_folder()
        clear_temporary(again=True)
        assert list(tmp_path.iterdir()) == [ours]
        ours.rmdir()
        part = ALTERATIONS[0].part
        with loadable(packaged_models()["T37"] / "T37" / "T37.xml", [part]) as folder:
            assert folder.parent == tmp_path
        assert list(tmp_path.iterdir()) == []


FRAME = {"time_s": [0.0, 0.1, 0.2], "column_force_N": [1.0, None, 3.0]}


def test_a_data_frame_is_a_record(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    expected = np.array([[0.0, 1.0], [0.1, np.nan], [0.2, 3.0]])
    polars_frame, pandas_frame = pl.DataFrame(FRAME), pandas.DataFrame(FRAME)
    for number, frame in enumerate((polars_frame, pandas_frame, pandas_frame.set_index("time_s"))):
        record = coupled.Record.from_frame(frame)
        assert record.channels == ("time_s", "column_force_N")
        np.testing.assert_array_equal(record.data, expected)
        path = tmp_path / f"{number}.csv"
        coupled.write_record(frame, path)
        np.testing.assert_array_equal(coupled.read_record(path).data, expected)


@pytest.mark.parametrize(
    ("frame", "says"),
    [
        (pl.DataFrame({"a": [1.0]}), "DataFrame: time_s: is missing"),
        (pl.DataFrame({"time_s": [1.0, 0.0], "a": [1, 2]}), "must rise from row to row"),
        (pl.DataFrame({"time_s": [0.0, 1.0], "a": ["x", "y"]}), "row 0: a: 'x' is no number"),
        (pl.DataFrame({"time_s": [0.0, 1.0], "a": [True, False]}), "a: holds bool; give numbers"),
    ],
)
def test_a_data_frame_that_is_no_record_is_one_line(frame: pl.DataFrame, says: str) -> None:
    with pytest.raises(coupled.InputError) as caught:
        coupled.Record.from_frame(frame)
    assert says in str(caught.value)


@pytest.mark.slow
def test_a_diagnosis_of_a_data_frame_is_that_of_its_record() -> None:
    rig = bench()
    pressure = coupled.PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
    worn = rig.changed({"controls.column.loader.bend_m_per_N": 4e-4})
    sweep = coupled.FrequencySweep(force_N=40, start_s=0.2, duration_s=4.5)
    record = coupled.fly(worn, column=sweep, duration_s=5.2, dynamic_pressure_Pa=pressure).record
    by_record = coupled.diagnose(rig, record)
    by_frame = coupled.diagnose(rig, {"worn": record.to_polars()})
    assert by_frame.improved == by_record.improved
    assert by_frame.verdict == "effect"


def test_a_channel_that_is_not_there_is_an_input_error_and_a_key_error() -> None:
    record = coupled.Record.from_frame(pl.DataFrame(FRAME))
    for kind in (KeyError, coupled.InputError):
        with pytest.raises(kind) as caught:
            _ = record["column_forse_N"]
        assert "did you mean column_force_N?" in str(caught.value)


CALLS: list[tuple[Any, type[Exception], str]] = [
    (
        lambda: CALL.fly(5),
        coupled.InputError,
        "coupled.fly: what: is 5; give a Manoeuvre, a Rig",
    ),
    (CALL.fly, TypeError, "coupled.fly: missing a required argument: 'what'"),
    (lambda: CALL.Step(3), TypeError, "coupled.Step: takes its values by name; give force_N=…"),
    (lambda: CALL.Rig(name=3), coupled.InputError, "coupled.Rig: name: should be text, is 3"),
    (lambda: CALL.compare([]), coupled.InputError, "what: needs at least one manoeuvre"),
    (lambda: CALL.check([]), coupled.InputError, "runs: needs at least one"),
    (lambda: CALL.diagnose("t37", {}), coupled.InputError, "records: needs at least one"),
    (
        lambda: CALL.diagnose("t37", 3),
        coupled.InputError,
        "records: is 3; give a Record, a DataFrame, text, a path, a list of such or a",
    ),
    (
        lambda: CALL.Record(("a", "b"), np.zeros((2, 3))),
        coupled.InputError,
        "coupled.Record: data: has the shape (2, 3); give (rows, 2)",
    ),
]


@pytest.mark.parametrize(("call", "kind", "says"), CALLS)
def test_a_wrong_call_names_argument_value_and_remedy(
    call: Any, kind: type[Exception], says: str
) -> None:
    with pytest.raises(kind) as caught:
        call()
    assert says in str(caught.value)
