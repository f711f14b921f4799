"""Malformed files of every kind, thrown at the commands that read them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.commands import coupled
from tests.support.mutations import cases, mutated, write_inputs

SEED = 11
FEW, MANY = 3, 60  # changed files for each file of a command


def ends_well(folder: Path, words: tuple[str, ...]) -> None:
    """Run a command in a folder; it must end by an exit code, and a refusal by one line."""
    before = sorted(folder.rglob("*"))
    done = coupled(folder, *words)
    assert done.returncode in (0, 1, 2), words
    assert "Traceback" not in done.stderr
    assert "\x1b" not in done.stdout + done.stderr
    if done.returncode == 2:
        lines = done.stderr.splitlines()  # one a fault
        assert lines, done.stderr
        assert all(line.startswith("error: ") for line in lines), done.stderr
        assert len(done.stderr) < 4000
        if words[0] != "sweep":  # finished flights are kept
            assert sorted(folder.rglob("*")) == before


def throw(folder: Path, number: int, count: int) -> None:
    words, name = cases()[number]
    write_inputs(folder)
    good = (folder / name).read_bytes()
    for i in range(count):
        content = mutated(good, np.random.default_rng([SEED, number, i]))
        (folder / name).write_bytes(content)
        ends_well(folder, words)


NUMBERS = range(len(cases()))
NAMES = [f"{words[0]} {name}" for words, name in cases()]


def test_the_unchanged_files_are_valid(tmp_path: Path) -> None:
    write_inputs(tmp_path)
    for words in dict.fromkeys(words for words, _ in cases()):
        done = coupled(tmp_path, *words)
        if words[0] == "diagnose":  # no record is there, lest a diagnosis be made
            assert "there is no r1.csv or .parquet" in done.stderr
        else:
            assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("number", NUMBERS, ids=NAMES)
def test_a_changed_file_is_read_or_refused_in_one_line(tmp_path: Path, number: int) -> None:
    throw(tmp_path, number, FEW)


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS, ids=NAMES)
def test_many_changed_files_are_read_or_refused_in_one_line(tmp_path: Path, number: int) -> None:
    throw(tmp_path, number, MANY)
