"""Malformed files of every kind, thrown at the commands that read them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from coupled.cli import main
from tests.support.commands import coupled
from tests.support.mutations import cases, mutated, write_inputs

SEED = 11
FEW, MANY = 3, 60  # changed files for each file of a command


def ends_well(folder: Path, words: tuple[str, ...], capfd: pytest.CaptureFixture[str]) -> None:
    """Run a command here; it must end by an exit code, and a refusal by one line."""
    before = sorted(folder.rglob("*"))
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capfd.readouterr()
    assert ended.value.code in (0, 1, 2), words
    assert "Traceback" not in printed.err
    assert "\x1b" not in printed.out + printed.err
    if ended.value.code == 2:
        lines = printed.err.splitlines()  # one a fault
        assert lines, printed.err
        assert all(line.startswith("error: ") for line in lines), printed.err
        assert len(printed.err) < 4000
        if words[0] != "sweep":  # finished flights are kept
            assert sorted(folder.rglob("*")) == before


def throw(folder: Path, number: int, count: int, capfd: pytest.CaptureFixture[str]) -> None:
    words, name = cases()[number]
    write_inputs(folder)
    good = (folder / name).read_bytes()
    for i in range(count):
        content = mutated(good, np.random.default_rng([SEED, number, i]))
        (folder / name).write_bytes(content)
        ends_well(folder, words, capfd)


NUMBERS = range(len(cases()))
NAMES = [f"{words[0]} {name}" for words, name in cases()]


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NO_COLOR", "1")
    return tmp_path


def test_the_unchanged_files_are_valid(here: Path) -> None:
    write_inputs(here)
    for words in dict.fromkeys(words for words, _ in cases()):
        done = coupled(here, *words)
        if words[0] == "diagnose":  # no record is there, lest a diagnosis be made
            assert "there is no r1.csv or .parquet" in done.stderr
        else:
            assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("number", NUMBERS, ids=NAMES)
def test_a_changed_file_is_read_or_refused_in_one_line(
    here: Path, number: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["coupled", *cases()[number][0]])
    throw(here, number, FEW, capfd)


@pytest.mark.slow
@pytest.mark.parametrize("number", NUMBERS, ids=NAMES)
def test_many_changed_files_are_read_or_refused_in_one_line(
    here: Path, number: int, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["coupled", *cases()[number][0]])
    throw(here, number, MANY, capfd)
