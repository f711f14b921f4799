"""The record on disk while a flight goes on: killed, on a full disk, or ended as it should be."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from coupled.errors import InputError
from coupled.flight.runfile import read_run
from coupled.live.host import Plan
from coupled.live.recording import Recording, recording_path
from coupled.live.session import LiveFlight, fly_live
from coupled.record.record import manifest_path, read_record, write_record

resource = pytest.importorskip("resource")
ROOT = Path(__file__).parents[2]


def flown(path: Path, seconds: float = 2.5) -> tuple[LiveFlight, Recording, list[str]]:
    """Fly in real time, recording; return the flight, its recording and the warnings."""
    said: list[str] = []
    recording = Recording(path, said.append)
    manoeuvre = replace(read_run("capture")[0], duration_s=seconds)
    return fly_live(manoeuvre, Plan(watchers=[recording], warn=said.append)), recording, said


def test_the_file_in_flight_is_the_beginning_of_the_record(tmp_path: Path) -> None:
    path = tmp_path / "new" / "r.csv"
    flight, recording, said = flown(path)
    assert said == []
    so_far = path.read_bytes()
    kept = read_record(path)
    assert len(kept) == 240  # of 300: all but the last second at the most
    assert kept.manifest["live"]["unfinished"] is True
    assert kept.ended_early is not None
    write_record(flight.record, path)
    recording.forget()
    assert path.read_bytes().startswith(so_far)
    assert "unfinished" not in read_record(path).manifest["live"]
    assert sorted(p.name for p in path.parent.iterdir()) == ["r.csv", "r.manifest.json"]


def test_a_line_that_was_torn_by_a_loss_of_power_is_left_out(tmp_path: Path) -> None:
    flown(path := tmp_path / "r.csv")
    whole = path.read_bytes()
    lines = whole.splitlines(keepends=True)
    for tail in (lines[-1][:-3], b"2.0", b"\0" * 40):
        path.write_bytes(whole + tail)
        assert read_record(path).data.shape == (len(lines) - 1, len(lines[0].split(b",")))
    table = json.loads(manifest_path(path).read_text())
    del table["live"]["unfinished"]  # of a record that is said to be whole nothing is dropped
    manifest_path(path).write_text(json.dumps(table))
    path.write_bytes(whole + b"abc")
    with pytest.raises(InputError, match="no number"):
        read_record(path)


@pytest.mark.slow
def test_a_parquet_record_grows_in_a_csv_file_beside_it(tmp_path: Path) -> None:
    flight, recording, _ = flown(path := tmp_path / "r.parquet")
    growing = recording_path(path)
    assert len(read_record(growing)) == 240
    write_record(flight.record, path)
    recording.forget()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.manifest.json", "r.parquet"]


@contextmanager
def full_after(size: int) -> Iterator[None]:
    """Let no file grow beyond so many bytes, as on a disk that is full."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.slow
def test_a_full_disk_ends_the_recording_and_not_the_flight(tmp_path: Path) -> None:
    flown(tmp_path / "first.csv", 1.5)
    second_bytes = (tmp_path / "first.csv").stat().st_size
    path = tmp_path / "r.csv"
    with full_after(round(1.5 * second_bytes)):
        flight, recording, said = flown(path)
        assert len(flight.record) == 300
        (line,) = said
        assert "the recording ended: File too large" in line
        assert "the flight continues" in line
        with pytest.raises(InputError, match="File too large") as fault:
            write_record(flight.record, path)
        error = recording.instead_of(fault.value)
        assert f"{path} keeps the first 1 s" in str(error)
    assert len(read_record(path)) == 120
    assert path.read_bytes().endswith(b"\n")


@pytest.mark.slow
def test_a_host_that_is_killed_leaves_all_but_the_last_second(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "coupled", "live", "tracking", "-o", "r.csv"]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    path = tmp_path / "r.csv"
    with subprocess.Popen(command, cwd=tmp_path, env=env, stdout=subprocess.DEVNULL) as process:
        deadline = time.monotonic() + 120.0
        while not path.exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        flying_s = time.monotonic()
        time.sleep(3.4)
        process.send_signal(signal.SIGKILL)
        process.wait(20.0)
        flown_s = 1.0 + time.monotonic() - flying_s
    record = read_record(path)
    assert record.time_s[-1] > flown_s - 2.2  # a second of rows, and what writing them takes
    assert record.manifest["live"]["unfinished"] is True
