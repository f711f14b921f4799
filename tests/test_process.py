"""A command among the others of a system: streams that are closed or full, names, signals."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from coupled.record.record import read_record
from tests.support.commands import ROOT, coupled, files
from tests.support.processes import PATIENCE_s, begun, stopped
from tests.support.runs import SHORT

COUPLED = f"{sys.executable} -m coupled"


def shell(folder: Path, line: str, **variables: str) -> subprocess.CompletedProcess[bytes]:
    """Run a line of bash, `coupled` in it being the command."""
    environment = {**os.environ, "COLUMNS": "80", "NO_COLOR": "1", **variables}
    words = ["bash", "-c", line.replace("coupled", COUPLED)]
    return subprocess.run(
        words, check=False, cwd=folder, env=environment, capture_output=True, timeout=PATIENCE_s
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "short.toml").write_text(SHORT)
    return tmp_path


FULL = b"error: standard output: cannot be written: No space left on device\n"
CLOSED = b"error: standard output: --json: is closed; give a file\n"


@pytest.mark.parametrize(
    ("line", "code", "says"),
    [
        ("coupled runs > /dev/full", 2, FULL),
        ("coupled runs --json - > /dev/full", 2, FULL),
        ("coupled --version > /dev/full", 2, FULL),
        ("coupled runs >&-", 0, b""),
        ("coupled runs --json - >&-", 2, CLOSED),
        ("coupled runs 2>&- >&-", 0, b""),
        ("coupled nothing 2>&-", 2, b""),
        ("coupled runs | true; exit ${PIPESTATUS[0]}", 141, b""),
        ("coupled --help | true; exit ${PIPESTATUS[0]}", 141, b""),
        ("coupled runs --json - | true; exit ${PIPESTATUS[0]}", 141, b""),
        (
            "mkdir gone; cd gone; rmdir ../gone; coupled runs",
            2,
            b"working folder: no longer exists",
        ),
    ],
)
def test_a_full_or_closed_stream_ends_the_command_without_a_traceback(
    folder: Path, line: str, code: int, says: bytes
) -> None:
    done = shell(folder, line)
    assert done.returncode == code, done.stderr
    assert says in done.stderr
    assert b"Traceback" not in done.stderr
    if says in (FULL, CLOSED, b""):
        assert done.stderr == says


def test_what_is_flown_is_kept_where_the_table_cannot_be_shown(folder: Path) -> None:
    done = shell(folder, "coupled fly short.toml -o r.csv --json t.json > /dev/full")
    assert done.returncode == 2
    assert done.stderr == FULL
    assert files(folder) == {"short.toml", "r.csv", "r.manifest.json", "t.json"}


def test_a_library_that_prints_does_not_print_into_the_record(folder: Path) -> None:
    done = shell(folder, "coupled fly short.toml -o r.csv >&- 2>&- <&-")
    assert done.returncode == 0
    assert len(read_record(folder / "r.csv")) == 240


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "latin-1"])
def test_a_terminal_that_lacks_a_character_gets_a_question_mark(
    folder: Path, encoding: str
) -> None:
    done = shell(folder, "coupled runs", PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    done.stdout.decode(encoding)
    listed = shell(folder, "coupled runs --json -", PYTHONIOENCODING=encoding)
    ours = shell(folder, "coupled runs --json -", PYTHONIOENCODING="utf-8")
    assert json.loads(listed.stdout.decode(encoding)) == json.loads(ours.stdout.decode())


@pytest.mark.slow
def test_a_file_whose_name_is_not_utf_8_is_read_and_written(folder: Path) -> None:
    (folder / os.fsdecode(b"r\xff.toml")).write_text(SHORT)
    done = shell(folder, "coupled fly $'r\\xff.toml' -o $'o\\xff.parquet' --json $'j\\xff.json'")
    assert done.returncode == 0, done.stderr
    assert b"record: o?.parquet" in done.stdout
    assert len(read_record(folder / os.fsdecode(b"o\xff.parquet"))) == 240
    done = shell(folder, "coupled plot $'o\\xff.parquet'")
    assert done.returncode == 0, done.stderr
    done = shell(folder, "coupled compare $'r\\xff.toml' --no-figure --json -")
    assert [row["configuration"] for row in json.loads(done.stdout)] == ["rigid", "compensated"]
    done = shell(folder, "coupled check $'r\\xff.toml'")
    assert done.returncode == 2
    assert done.stderr.startswith(b"error: r?.toml: ")


def test_control_characters_of_a_file_do_not_reach_the_terminal(folder: Path) -> None:
    hostile = "\\u001b]0;owned\\u0007\\u001b[2J\\u009b31m\\u202e"
    text = SHORT.replace("A short pull.", hostile)
    (folder / "short.toml").write_text(text + '\n[[case]]\nlabel = "\\u009b31m\\u202e"\n')
    done = coupled(folder, "compare", "short.toml", "--no-figure")
    assert done.returncode == 0, done.stderr
    for character in "\x1b\x07\x9b\u202e":
        assert character not in done.stdout + done.stderr
    assert "]0;owned" in done.stdout
    done = coupled(folder, "fly", "short.toml", "--case", "\x1b[2J" + "a" * 100_000)
    assert done.returncode == 2
    assert "\x1b" not in done.stderr
    assert len(done.stderr) < 4000


@pytest.mark.slow
def test_sigterm_keeps_the_flight_up_to_then_as_ctrl_c_does(folder: Path) -> None:
    (folder / "long.toml").write_text(SHORT.replace("duration_s = 2.0", "duration_s = 7200.0"))
    kept = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        name = f"r{number}.csv"
        ready = folder / f"ready{number}"
        script = (
            "import sys, coupled.flight.loop as loop, coupled.cli\n"
            "from pathlib import Path\n"
            "fly = loop.fly\n"
            "def watched(manoeuvre, progress, **more):\n"
            "    def told(done, total):\n"
            f"        Path({str(ready)!r}).touch()\n"
            "    return fly(manoeuvre, told, **more)\n"
            "loop.fly = watched\n"
            f"sys.argv = ['coupled', 'fly', 'long.toml', '-o', {name!r}]\n"
            "coupled.cli.main()\n"
        )
        process = begun(folder, script=script, until=ready.exists)
        code = stopped(process, number)
        assert code == (130 if number == signal.SIGINT else 143)
        kept[number] = json.loads((folder / f"r{number}.manifest.json").read_text())
        assert len(read_record(folder / name)) > 10
    for manifest in kept.values():
        assert manifest["ended_early"]["reason"] == "interrupted"
    assert not [name for name in files(folder) if ".coupled-" in name]


@pytest.mark.slow
def test_sigterm_keeps_the_flights_of_a_sweep(folder: Path) -> None:
    (folder / "sweep.toml").write_text(
        'name = "s"\nrun = "short.toml"\nconfigurations = ["rigid"]\nkeep = ["loss"]\n'
        f'[[vary]]\nkey = "pilot.column.force_N"\nvalues = {[float(i) for i in range(1, 301)]}\n'
    )
    journal = folder / "swept" / "flights.jsonl"

    def some() -> bool:
        return journal.exists() and journal.read_bytes().count(b"\n") > 3

    words = ("sweep", "sweep.toml", "--folder", "swept", "-j", "1")
    assert stopped(begun(folder, *words, until=some), signal.SIGTERM) == 143
    flights = [json.loads(line)["flight"] for line in journal.read_text().splitlines()[1:]]
    assert 3 <= len(flights) < 300
    assert flights == list(range(len(flights))) or flights == list(range(1, len(flights) + 1))
    assert files(folder / "swept") <= {"flights.jsonl", ".lock"}


@pytest.mark.slow
def test_sigterm_keeps_the_records_of_blind_make(folder: Path) -> None:
    done = folder / "trials" / "records"

    def some() -> bool:
        return done.is_dir() and len(list(done.glob("r*.csv"))) > 1

    words = ("blind", "make", "trials", "--records", "40", "--rigs", "1", "--seed", "3")
    assert stopped(begun(folder, *words, until=some), signal.SIGTERM) == 143
    kept = {path: path.stat().st_mtime_ns for path in done.glob("r*.csv")}
    assert 2 <= len(kept) < 40
    assert not [name for name in files(folder) if ".coupled-" in name]
    assert not (folder / "trials.key.json").exists()


@pytest.mark.slow
def test_sigterm_keeps_the_diagnoses_of_a_folder(folder: Path) -> None:
    for name in ("r1", "r2", "r3", "r4"):
        (folder / "many").mkdir(exist_ok=True)
        made = coupled(folder, "fly", "short.toml", "-o", f"many/{name}.csv")
        assert made.returncode == 0
    listed = "".join(f'r{i} = "report-column"\n' for i in range(1, 5))
    (folder / "many" / "records.toml").write_text(listed)
    out = folder / "out"

    def one() -> bool:
        return out.is_dir() and bool(list(out.glob("r*.json")))

    words = ("diagnose", "many", "--output", "out")
    assert stopped(begun(folder, *words, until=one), signal.SIGTERM) == 143
    for kept in out.glob("r*.json"):
        assert json.loads(kept.read_text())["record"] == kept.stem
    assert not [name for name in files(out) if ".coupled-" in name]


def test_json_does_not_overwrite_what_a_command_reads(folder: Path) -> None:
    (folder / "push.toml").write_text(SHORT.replace('"report-column"', '"rig.toml"'))
    rig = (ROOT / "aircraft" / "T37" / "report-column.toml").read_text(encoding="utf-8")
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    (folder / "b").mkdir()
    (folder / "link.json").symlink_to(folder / "rig.toml")
    (folder / "r.csv").write_text("time_s,column_force_N\n0,0\n1,1\n")
    (folder / "r.manifest.json").write_text("{}")
    sweep = (
        'name = "s"\nrun = "push.toml"\n[[vary]]\nkey = "pilot.column.force_N"\nvalues = [1.0]\n'
    )
    (folder / "s.toml").write_text(sweep)
    before = {path: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    for words in (
        ("fly", "push.toml", "--json", "link.json"),
        ("compare", "push.toml", "--no-figure", "--json", "b/../rig.toml"),
        ("check", "push.toml", "--json", "rig.toml"),
        ("sweep", "s.toml", "--json", "rig.toml"),
        ("bench", "--rig", "rig.toml", "--json", "link.json"),
        ("calibrate", "--plan", "--rig", "rig.toml", "--json", "b/../rig.toml"),
        ("diagnose", "r.csv", "--rig", "rig.toml", "--json", "r.manifest.json"),
        ("diagnose", "r.csv", "--rig", "rig.toml", "--improve", "b/../rig.toml"),
        ("stability", "rig.toml", "--json", "link.json"),
        ("document", "rig.toml", "--json", "b/../rig.toml"),
    ):
        done = coupled(folder, *words)
        assert done.returncode == 2, words
        assert {path: path.read_bytes() for path in folder.iterdir() if path.is_file()} == before
        if words[0] != "check":  # which finds nothing to hold this run against
            assert "of this command" in done.stderr or "this command reads" in done.stderr
