"""`coupled live` as a user meets it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from coupled.cli.live import missing
from coupled.record.record import read_record
from tests.support.commands import coupled

ROOT = Path(__file__).parents[2]


def test_a_run_flown_in_lock_step_has_the_bytes_of_fly(tmp_path: Path) -> None:
    assert coupled(tmp_path, "fly", "capture", "-o", "batch.csv").returncode == 0
    done = coupled(tmp_path, "live", "capture", "--lockstep", "-o", "live.csv")
    assert done.returncode == 0
    assert "record: live.csv" in done.stdout
    assert (tmp_path / "live.csv").read_bytes() == (tmp_path / "batch.csv").read_bytes()


def test_a_paced_flight_takes_its_duration(tmp_path: Path) -> None:
    begun = time.monotonic()
    done = coupled(tmp_path, "live", "capture", "--duration", "0.5", "--json", "-")
    assert time.monotonic() - begun > 0.5 - 1 / 120
    live = json.loads(done.stdout)
    assert live["lateness"]["frames"] == 60
    assert sum(live["lateness"]["histogram_frames"]) == 60
    assert isinstance(live["real_time_priority"], bool)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "give a run, or --rig"),
        (["capture", "--rig", "t37"], "one of the two"),
        (["--rig", "t37"], "--hand"),
        (["--rig", "t37", "--hand", "page"], "needs --dashboard"),
        (["capture", "--loader", "serial://x:1"], "--loader"),
        (["capture", "--force-limit", "0"], "--force-limit"),
        (["capture", "--flightgear", "nowhere"], "nowhere"),
        (["capture", "-o", "x.txt"], "a record ends in"),
        (["capture", "--axes", "a"], "--axes: is for --hand stick"),
        (["capture", "--port", "8080"], "--port: needs --dashboard"),
        (["capture", "--unmeasured"], "--unmeasured: is for --loader udp://"),
        (["capture", "--rate-limit", "500"], "--rate-limit: is for a real loader"),
        (["--rig", "t37", "--dashboard", "--case", "x"], "--case: is for a run"),
        (
            ["--rig", "t37", "--loader", "udp://h:1", "--hand", "stick"],
            "--hand: is for the simulated loader",
        ),
    ],
)
def test_a_wrong_option_is_refused_in_one_line(words: list[str], said: str, tmp_path: Path) -> None:
    done = coupled(tmp_path, "live", *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 0), (signal.SIGTERM, 143)])
def test_a_signal_leaves_a_complete_record(number: int, code: int, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "coupled", "live", "tracking", "-o", "r.csv"]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen(command, cwd=tmp_path, env=env, stdout=subprocess.DEVNULL) as process:
        time.sleep(6.0)
        process.send_signal(number)
        assert process.wait(20.0) == code
    record = read_record(tmp_path / "r.csv")
    assert len(record) > 10
    assert record.manifest["live"]["stopped"]
    assert record.manifest["ended_early"] is None


def test_lost_packets_and_samples_are_said() -> None:
    live = {"dropped_packets": {"not a number": 400}, "stale_frames": 381}
    said = "400 packets dropped: not a number; 381 of 1080 frames have no new sample"
    assert missing(live, 1080) == said
    assert missing({"dropped_packets": {}, "stale_frames": 2}, 1080) == ""
    assert "frames" in missing({"dropped_packets": {}, "stale_frames": 90}, 1080)
