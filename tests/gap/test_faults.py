"""Records and folders that once ended in a traceback, a silent answer or a file elsewhere."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rich.console import Console

from coupled.cli.tables import print_table
from coupled.errors import InputError
from coupled.gap import batch
from coupled.gap.batch import jobs, run_all
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.result import FORMAT, StageResult
from coupled.record.channels import ControlName
from coupled.record.record import Record, write_record
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import rig_text
from coupled.tables.gaps import stages_table
from tests.support.cluster import cluster
from tests.support.commands import ROOT, coupled
from tests.support.gaps import made, nominal_rig

Floats = NDArray[np.float64]
RIG = nominal_rig(False)


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return made(tmp_path_factory.mktemp("clean"), RIG, {}, 4).between(0.0, 15.0)


def spoiled(record: Record, channel: str, change: Callable[[Floats], Floats]) -> Record:
    data = record.data.copy()
    at = record.channels.index(channel)
    data[:, at] = change(data[:, at])
    return Record(record.channels, data)


@pytest.mark.parametrize(
    "change",
    [lambda f: 0.22 * f, lambda f: -f, lambda f: np.concatenate((f[:1], f[:-1]))],
    ids=["x 0.22", "x -1", "a frame late"],
)
def test_a_wrong_modifying_force_is_a_gap_of_the_loader(
    clean: Record, change: Callable[[Floats], Floats]
) -> None:
    """Of the library only the digital product shows there, which has no number to fit."""
    found = diagnose(RIG, {"r": spoiled(clean, "column_modifying_force_N", change)})
    assert found.verdict == "unexplained"
    assert "loader" in found.guilty


@pytest.mark.slow
def test_a_deflection_of_64_levels_is_diagnosed_and_written(clean: Record) -> None:
    def coarse(x: Floats) -> Floats:
        step = np.ptp(x) / 64.0
        return np.asarray(np.round(x / step) * step)

    found = diagnose(RIG, {"r": spoiled(clean, "column_computed_m", coarse)})
    assert isinstance(found.stage("compensation").guilty, bool)
    json.dumps(found.as_dict(), allow_nan=False)


def test_sensing_is_not_given_a_gap_that_nobody_measured(clean: Record) -> None:
    found = diagnose(RIG, {"r": clean})
    assert found.stage("sensing").as_dict() == {
        "judged": False,
        "missing": [],
        "why": "see loader, linkage",
    }
    assert "sensing" not in found.summary  # its neighbours were judged


def test_a_stage_within_its_settings_is_told_by_its_own_limit() -> None:
    def printed(gap: float, settled: float) -> str:
        console = Console(file=io.StringIO(), width=80)
        print_table(console, stages_table([StageResult("loader", gap, settled, 1.4, settled)]))
        assert isinstance(console.file, io.StringIO)
        return console.file.getvalue()

    assert "within its tolerances" in printed(1.5, 1.3)
    assert "within its tolerances" not in printed(1.3, 1.1)  # within its limit as it is
    assert "within its tolerances" not in printed(1.5, 1.45)


def folder_of(tmp_path: Path, record: Record, *names: str) -> Path:
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "mine.toml").write_text(rig_text(RIG, "a bench"))
    for name in names:
        write_record(record, tmp_path / f"{name}.csv")
    (tmp_path / "records.toml").write_text("".join(f'{name} = "mine"\n' for name in names))
    return tmp_path


@pytest.mark.slow
def test_a_folder_is_diagnosed_on_the_control_that_was_asked_for(
    tmp_path: Path, clean: Record
) -> None:
    folder_of(tmp_path, clean, "a")
    done = coupled(tmp_path, "diagnose", ".", "--output", "out", "--control", "wheel")
    assert done.returncode == 2
    assert "no record could be diagnosed" in done.stdout
    found = json.loads((tmp_path / "out" / "a.json").read_text())
    assert (found["verdict"], found["made"]["control"]) == ("refused", "wheel")
    assert "the rig has no wheel" in found["why"]
    wrong = coupled(tmp_path, "diagnose", ".", "--output", "out", "--control", "stick")
    assert wrong.returncode == 2
    assert "one of column, wheel, pedals" in wrong.stderr


def test_a_record_whose_diagnosis_fails_leaves_the_others_theirs(
    tmp_path: Path, clean: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    todo = jobs(folder_of(tmp_path, clean, "a", "b"), tmp_path / "out")

    def fails_on_the_first(
        rig: Rig, records: dict[str, Record], control: ControlName | None, workers: int
    ) -> Diagnosis:
        if next(iter(records)).endswith("a.csv"):
            raise ZeroDivisionError("division by zero")
        return diagnose(rig, records, control, workers=workers)

    with monkeypatch.context() as patched:
        patched.setattr(batch, "diagnose", fails_on_the_first)
        rows = run_all(todo, lambda *_: None, workers=1)
    assert [row.verdict for row in rows] == ["failed", "no_gap"]
    assert "ZeroDivisionError" in rows[0].why
    assert json.loads((tmp_path / "out" / "a.json").read_text())["format"] == FORMAT
    assert [line.split(",")[2] for line in batch.summary(rows).splitlines()[1:]] == [
        "failed",
        "no_gap",
    ]
    before = (tmp_path / "out" / "b.json").stat().st_mtime_ns
    assert run_all(todo, lambda *_: None, workers=1) == rows  # all is there: nothing is done anew
    assert (tmp_path / "out" / "b.json").stat().st_mtime_ns == before


def test_a_record_that_cannot_be_read_is_refused_beside_the_others(
    tmp_path: Path, clean: Record
) -> None:
    todo = jobs(folder_of(tmp_path, clean, "a", "b"), tmp_path / "out")
    (tmp_path / "a.csv").write_text("time_s\nnonsense\n")
    seen: list[tuple[str, int, int]] = []
    rows = run_all(todo, lambda *said: seen.append(said), workers=1)
    assert [row.verdict for row in rows] == ["refused", "no_gap"]
    assert seen == [("a", 1, 2), ("b", 2, 2)]


def test_a_missing_rig_is_refused_with_the_places_of_rigs(tmp_path: Path, clean: Record) -> None:
    folder_of(tmp_path, clean, "a")
    (tmp_path / "records.toml").write_text('a = "yours.toml"\n')
    with pytest.raises(InputError, match=r"no rigs/yours\.toml\.toml here or a folder up"):
        jobs(tmp_path, tmp_path / "out")


def test_workers_of_another_version_are_refused(
    tmp_path: Path, clean: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    todo = jobs(folder_of(tmp_path, clean, "a"), tmp_path / "out")
    monkeypatch.setattr(batch, "answer", lambda number, *_: (number, "another", {}))
    with pytest.raises(InputError, match=r"--cluster: its workers have another version"):
        run_all(todo, lambda *_: None, workers=1)
    assert not (tmp_path / "out" / "a.json").exists()


@pytest.mark.slow
def test_a_cluster_diagnoses_as_this_machine_does(tmp_path: Path, clean: Record) -> None:
    folder_of(tmp_path, clean, "a", "b", "c")
    here = run_all(jobs(tmp_path, tmp_path / "here"), lambda *_: None, workers=1)
    with cluster(tmp_path, 2) as address:
        done = coupled(tmp_path, "diagnose", ".", "--output", "there", "--cluster", address)
        assert done.returncode == 0, done.stderr
    assert [row.verdict for row in here] == ["no_gap"] * 3
    for name in "abc":
        ours, theirs = (tmp_path / place / f"{name}.json" for place in ("here", "there"))
        assert ours.read_bytes() == theirs.read_bytes()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["a.csv", "--rig", "rigs/mine.toml", "-j", "2"], "--workers: is for a folder"),
        (["a.csv", "--rig", "rigs/mine.toml", "--cluster", "x"], "--cluster: is for a folder"),
        ([".", "--output", "o", "--cluster", "x", "-j", "2"], "--workers: a cluster has its own"),
    ],
)
def test_where_a_folder_is_diagnosed_is_for_folders(
    tmp_path: Path, clean: Record, words: list[str], says: str
) -> None:
    folder_of(tmp_path, clean, "a")
    done = coupled(tmp_path, "diagnose", *words)
    assert done.returncode == 2
    assert says in done.stderr


@pytest.mark.parametrize("name", ["../evil", "a/b", "", ".hidden", "/evil"])
def test_a_record_outside_the_folder_is_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "records.toml").write_text(f'"{name}" = "737"\n')
    (tmp_path / "evil.csv").write_text("time_s\n0\n")
    with pytest.raises(InputError, match=r"letters, digits, dots and dashes"):
        jobs(tmp_path / "in", tmp_path / "out" / "deep")
    (tmp_path / "in" / "records.toml").write_text('r = "../mine"\n')
    with pytest.raises(InputError, match="no folder"):
        jobs(tmp_path / "in", tmp_path / "out")


def test_no_module_of_the_package_is_taken_for_a_test() -> None:
    names = [path.stem for path in (ROOT / "coupled").rglob("*.py")]
    assert not [n for n in names if n.startswith("test_") or n.endswith("_test")]
