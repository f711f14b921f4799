"""Files are read if they are files, and written whole, together, or not at all."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import coupled.files
from coupled.errors import LONGEST, InputError, nearest, shown
from coupled.files import (
    check_format,
    check_target,
    check_targets,
    json_text,
    read_bytes,
    read_text,
    sha256,
    unfinished_name,
    write_text,
    write_whole,
)
from coupled.outputs import Outputs
from coupled.record.csvfile import read_columns
from coupled.schema import MOST_TOML_bytes, load_toml, loads_toml

READERS = [read_bytes, sha256, read_columns, load_toml, lambda path: read_text(path, "")]


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


@pytest.mark.parametrize("read", READERS)
def test_a_pipe_a_device_and_a_folder_are_refused_at_once(tmp_path: Path, read: object) -> None:
    assert callable(read)
    os.mkfifo(tmp_path / "pipe.toml")
    for path, says in (
        (tmp_path / "pipe.toml", "is a pipe or a device"),
        (Path("/dev/zero"), "is a pipe or a device"),
        (tmp_path, "is a folder"),
        (tmp_path / "none", "No such file"),
        (tmp_path / ("x" * 400), "File name too long"),
    ):
        with pytest.raises(InputError, match=says):
            read(path)


def test_a_file_without_end_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    with path.open("wb") as file:
        file.truncate(2**40)  # no disk holds it: the file is a hole
    with pytest.raises(InputError, match="is larger than 4 GiB"):
        read_columns(path)
    with pytest.raises(InputError, match="is larger than 64 MiB"):
        read_text(path, "")
    path.write_bytes(b"x" * 11)
    assert read_bytes(path, 11) == b"x" * 11
    with pytest.raises(InputError, match="is larger than"):
        read_bytes(path, 10)


def test_a_toml_of_many_megabytes_is_refused_before_it_is_parsed(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text("a = 1\n" * 8_000_000)
    with pytest.raises(InputError, match="is larger than 1 MiB"):
        load_toml(path)
    path.write_text("#" * (MOST_TOML_bytes - 6) + "\na = 1")
    assert load_toml(path) == {"a": 1}


@pytest.mark.parametrize(
    "line", ["a." * 200_000 + "b = 1", "[" + "'x'." * 101 + "y]", "k = {" + "a . " * 101 + "a = 1}"]
)
def test_a_key_of_hundreds_of_parts_is_refused(line: str) -> None:
    with pytest.raises(InputError, match=r"line 2: a key of more than 100 parts"):
        loads_toml("x = 1\n" + line, "f")


def test_a_value_with_many_points_is_not_a_deep_key() -> None:
    numbers = ", ".join(["0.5"] * 500)
    told = loads_toml(f'x = [{numbers}]\ncard = "{"... " * 90}"', "f")
    assert len(told["x"]) == 500


def test_a_record_of_a_newer_format_is_refused() -> None:
    assert check_format(None, 2, "f", "record") == 0
    assert check_format(1, 2, "f", "record") == 1
    assert check_format(2, 2, "f", "record") == 2
    with pytest.raises(InputError, match=r"f: format: this record is of format 3, .* up to 2"):
        check_format(3, 2, "f", "record")
    for wrong in (0, -1, True, "1", 1.0):
        with pytest.raises(InputError, match="should be a whole number from 1 to 2"):
            check_format(wrong, 2, "f", "record")


def test_a_target_is_known_under_every_name(tmp_path: Path) -> None:
    record = tmp_path / "a.csv"
    record.write_text("x")
    (tmp_path / "b").mkdir()
    (tmp_path / "link.csv").symlink_to(record)
    os.link(record, tmp_path / "hard.csv")
    (tmp_path / "folder").symlink_to(tmp_path)
    for same in ("a.csv", "b/../a.csv", "link.csv", "hard.csv", "folder/a.csv", "./a.csv"):
        with pytest.raises(InputError, match="is a file that this command reads"):
            check_target(tmp_path / same, [record])
    with pytest.raises(InputError, match="would be written twice"):
        check_targets([tmp_path / "n.csv", tmp_path / "folder" / "n.csv"], [record])
    check_targets([tmp_path / "n.csv", tmp_path / "m.csv"], [record])
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="is a pipe or a device"):
        check_target(tmp_path / "pipe")


def test_outputs_appear_together(tmp_path: Path) -> None:
    with Outputs() as outputs:
        write_text(outputs.at(tmp_path / "new" / "a.txt"), "a")
        write_text(outputs.at(tmp_path / "b.txt"), "b")
        assert not any(name.endswith(".txt") and "coupled" not in name for name in names(tmp_path))
    assert names(tmp_path) == ["b.txt", "new", "new/a.txt"]


def test_a_fault_leaves_everything_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "b.txt").write_text("old")
    with pytest.raises(KeyboardInterrupt), Outputs() as outputs:
        write_text(outputs.at(tmp_path / "new" / "deep" / "a.txt"), "a")
        write_text(outputs.at(tmp_path / "b.txt"), "b")
        raise KeyboardInterrupt
    assert names(tmp_path) == ["b.txt"]
    assert (tmp_path / "b.txt").read_text() == "old"


def test_a_move_that_fails_takes_the_others_back(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text("old")
    with pytest.raises(InputError, match=r"z: cannot be written"), Outputs() as outputs:
        for name in ("a.txt", "m.txt", "z"):
            write_text(outputs.at(tmp_path / name), "new")
        (tmp_path / "z").mkdir()  # made by another process meanwhile
    assert names(tmp_path) == ["a.txt", "z"]
    assert (tmp_path / "a.txt").read_text() == "old"


def test_a_fault_names_the_file_that_the_user_knows(tmp_path: Path) -> None:
    def fill(part: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError) as fault, Outputs() as outputs:
        write_whole(outputs.at(tmp_path / "a.txt"), fill)
    assert str(fault.value) == f"{tmp_path}/a.txt: cannot be written: No space left on device"
    assert names(tmp_path) == []


def test_what_a_killed_process_left_is_cleared_and_nothing_else(tmp_path: Path) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    mine = unfinished_name(".csv")
    dead = mine.replace(f"-{os.getpid()}-", f"-{ended.pid}-")
    alive = mine.replace(f"-{os.getpid()}-", f"-{os.getppid()}-")
    elsewhere = mine.replace(".coupled-", ".coupled-another_host_").replace(
        f"-{os.getpid()}-", f"-{ended.pid}-"
    )
    for name in (mine, dead, alive, elsewhere, ".coupled-notes", "a.csv"):
        (tmp_path / name).write_text("")
    folder = dead.removesuffix(".csv")
    (tmp_path / folder).mkdir()
    (tmp_path / folder / "half.csv").write_text("")
    write_text(tmp_path / "b.txt", "b")
    kept = {mine, alive, elsewhere, ".coupled-notes", "a.csv", "b.txt"}
    assert set(names(tmp_path)) == kept


def test_a_partial_file_of_an_earlier_process_with_this_id_is_removed(tmp_path: Path) -> None:
    left = tmp_path / unfinished_name("")
    left.write_text("")
    an_hour_ago = time.time() - 3600.0
    os.utime(left, (an_hour_ago, an_hour_ago))
    coupled.files.clear(tmp_path)
    assert names(tmp_path) == []


FULL = """
import resource, sys, numpy as np
from pathlib import Path
from coupled.errors import InputError
from coupled.record.record import Record, write_record
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
data = np.random.default_rng(1).standard_normal((20_000, 3)).cumsum(axis=0)
try:
    data[:, 0] = np.arange(20_000) / 120
    write_record(Record(("time_s", "a", "b"), data), Path(sys.argv[1]))
except InputError as error:
    print(error)
"""


@pytest.mark.parametrize("name", ["r.csv", "r.parquet"])
def test_a_full_disk_leaves_no_part_of_a_record(tmp_path: Path, name: str) -> None:
    words = [sys.executable, "-c", FULL, str(tmp_path / name)]
    done = subprocess.run(words, check=True, capture_output=True, text=True)
    assert done.stderr == ""
    assert done.stdout.startswith(f"{tmp_path / name}: cannot be written: ")
    assert "File too large" in done.stdout
    assert names(tmp_path) == []


def test_a_message_is_one_printable_line_of_bounded_length() -> None:
    hostile = "\x1b]0;x\x07" + "a" * 100_000 + "\u202e\x9b31m"
    fault = str(InputError(hostile, hostile, f"is {hostile!r}, {hostile} " * 100))
    assert fault.isprintable()
    assert len(fault) < 4000
    assert shown("a" * 1000) == "a" * LONGEST + "…"
    assert shown("q̄ is 3 µm\n") == "q̄ is 3 µm?"


def test_a_hint_among_100_000_names_is_short_and_quick() -> None:
    known = [f"column_{i}" + "x" * 1000 for i in range(100_000)]
    hint = nearest("y" * 100_000, known)
    assert len(InputError("f", "k", hint).problem) < 3100
    assert nearest("forse", ["force", "rate"]) == "did you mean force?"
    assert nearest("zzz", ["b", "a"]) == "known: a, b"


def test_a_file_name_that_is_not_utf_8_is_kept_in_json_and_text(tmp_path: Path) -> None:
    name = os.fsdecode(b"r\xff.csv")
    assert json.loads(json_text({name: "q̄"})) == {name: "q̄"}
    assert "q̄" in json_text({"a": "q̄"})
    write_text(tmp_path / "a", name)
    assert (tmp_path / "a").read_text() == "r?.csv"
