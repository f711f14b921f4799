"""Work that holds the interpreter: where it is done, its faults, and the end of its processes."""

from __future__ import annotations

import io
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import redirect_stderr
from functools import partial
from pathlib import Path

import pytest

from coupled.callpool import call_pool
from coupled.errors import InputError
from coupled.parallel import in_threads, in_turn, threads


def where(_: int = 0) -> int:
    time.sleep(0.02)
    return os.getpid()


def refused(number: int) -> int:
    time.sleep(0.02)
    raise InputError("a.toml", f"key{number}", "is wrong")


def fallen(number: int) -> int:
    """Return the number; a process beside the one that asked falls."""
    time.sleep(0.02)
    if os.getppid() == number:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def places(work: Callable[[int], int], number: int = 0) -> set[int]:
    return set(in_threads(lambda _: in_turn(partial(work, number)), range(8)))


def until_beside(seconds: float = 30.0) -> int:
    """Work by two threads until a process beside this one has worked; return its number."""
    until_s = time.monotonic() + seconds
    while time.monotonic() < until_s:
        if beside := places(where) - {os.getpid()}:
            (number,) = beside
            return number
    raise AssertionError("no process has worked")


def alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def test_a_call_that_would_wait_is_done_beside_by_a_process_that_ends_with_the_work() -> None:
    with threads(2):
        beside = until_beside()
        assert places(where) == {os.getpid(), beside}
        assert alive(beside)
    assert not alive(beside)


@pytest.mark.parametrize("rounds", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_work_may_end_while_a_process_still_loads(rounds: int) -> None:
    """On a busy machine the thread that waited for it read from a closed pipe, now and then."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(4)]
    try:
        for pause_s in rounds * (0.0, 0.03, 0.1, 0.3):
            with threads(2):
                places(where)
                time.sleep(pause_s)
    finally:
        for process in busy:
            with process:
                process.kill()


def test_one_thread_starts_no_process() -> None:
    with threads(1):
        assert places(where) == {os.getpid()}
    with threads(2), call_pool(0) as none:
        assert none.call(partial(where)) == os.getpid()


def test_a_fault_is_raised_where_the_call_was_made() -> None:
    with threads(2):
        until_beside()
        for _ in range(4):  # wherever it is done
            with pytest.raises(InputError, match=r"a\.toml.*key3.*is wrong"):
                places(refused, 3)
        assert len(places(where)) == 2  # and what comes next has its own answer


def test_the_call_of_a_process_that_falls_is_done_here() -> None:
    with threads(2):
        until_beside()
        assert places(fallen, os.getpid()) == {os.getpid()}
        assert places(where) == {os.getpid()}


def test_work_that_cannot_be_pickled_is_done_here() -> None:
    with threads(2):
        until_beside()
        here = in_threads(lambda _: in_turn(partial(lambda: where(1))), range(8))
        assert set(here) == {os.getpid()}


@pytest.mark.parametrize("by", ["file", "standard input"])
def test_a_script_is_not_run_again_by_the_process_beside_it(by: str, tmp_path: Path) -> None:
    script = """
from pathlib import Path
from coupled.parallel import threads
from tests.test_callpool import until_beside
with Path("runs").open("a") as runs:
    runs.write("once ")
with threads(2):
    until_beside()
"""
    written = tmp_path / "script.py"
    written.write_text(script if by == "file" else "")
    command = [sys.executable, str(written) if by == "file" else "-"]
    path = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    run = partial(subprocess.run, cwd=tmp_path, env=path, input=script, text=True)
    done = run(command, stderr=subprocess.PIPE, check=True)
    assert done.stderr == ""
    assert (tmp_path / "runs").read_text() == "once "


def test_a_process_that_may_have_no_children_works_alone() -> None:
    """A worker of a user's own pool: the start of another process was an error in a thread."""
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        inner, said = pool.apply(within_a_pool)
    assert inner == 1
    assert said == ""


def within_a_pool() -> tuple[int, str]:
    """Return how many processes worked, and what threads printed."""
    said = io.StringIO()
    with redirect_stderr(said), threads(2):
        return len(places(where) | places(where)), said.getvalue()
