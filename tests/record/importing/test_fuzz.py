"""Logs, maps and tables made at random: read right or refused, and nothing else raised."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.importfuzz import READERS, SEED, WRITERS, outcome

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("reader", READERS)
def test_logs_made_at_random_are_read_right_or_refused(tmp_path: Path, reader: str) -> None:
    """A few of each reader; damaged bytes, which may end a process, are left to the slow test."""
    whole = [number for number in range(24) if number % 3 < 2 or reader not in WRITERS]
    found = [outcome(reader, SEED, number, tmp_path) for number in whole]
    assert len(set(found)) > 1  # some of both


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
def test_a_thousand_logs_of_each_reader(reader: str) -> None:
    command = [sys.executable, "-m", "tests.support.importfuzz", "1000", str(SEED), reader]
    done = subprocess.run(command, check=False, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert f"{reader}: 1000 cases" in done.stdout
