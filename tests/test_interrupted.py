"""Ctrl-C: a command and its workers are gone within a second, whatever they were doing."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FrameType
from typing import Any

import pytest

from coupled.cli.process import Stop, was_interrupted
from coupled.cli.progress import MARK, progress
from coupled.parallel import SerialExecutor, as_done, executor
from tests.support.commands import coupled
from tests.support.processes import PATIENCE_s, begun
from tests.support.runs import SHORT

HELD_s = 30.0  # what a worker is busy with, far longer than an interruption may take
SWEEP = (
    'name = "s"\nrun = "short.toml"\nconfigurations = ["rigid"]\nkeep = ["loss"]\n'
    f'[[vary]]\nkey = "pilot.column.force_N"\nvalues = {[float(i) for i in range(1, 31)]}\n'
)


def alive(group: int) -> list[str]:
    """Return the commands of a group of processes that still run; a zombie does not."""
    rows = subprocess.run(
        ["ps", "-eo", "pgid=,stat=,args="], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    fields = [row.split(maxsplit=2) for row in rows]
    return [each[2] for each in fields if int(each[0]) == group and each[1][0] != "Z"]


def gone_after(process: subprocess.Popen[bytes]) -> float:
    """Interrupt a command and its workers, as a terminal does; return the seconds until all end."""
    pressed = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    process.wait(PATIENCE_s)
    while alive(process.pid) and time.monotonic() - pressed < PATIENCE_s:
        pass
    return time.monotonic() - pressed


@pytest.mark.bench
@pytest.mark.parametrize("wait_s", [0.5, 1.5, 4.0, 8.0])
@pytest.mark.parametrize(
    "words",
    [
        "fly awjsra-approach",
        "compare recovery",
        "check recovery tracking",
        "sweep sensitivity",
        "document 737",
        "stability c172p",
        "map 737",
        "bench --repeat 5000",
        "blind make trials --records 60 --rigs 1",
    ],
)
def test_ctrl_c_ends_every_command_within_a_second(
    tmp_path: Path, words: str, wait_s: float
) -> None:
    began = time.monotonic()
    process = begun(
        tmp_path, *words.split(), until=lambda: time.monotonic() - began > wait_s, may_end=True
    )
    if process.poll() is None:
        seconds = gone_after(process)
        print(f"{words} after {wait_s:g} s: gone {seconds:.2f} s later")
        assert seconds < 1.0
        assert process.returncode in (1, 130)


@pytest.mark.slow
def test_ctrl_c_ends_a_sweep_and_its_workers_and_keeps_what_is_flown(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "s.toml").write_text(SWEEP)
    journal = tmp_path / "swept" / "flights.jsonl"

    def some() -> bool:
        return journal.exists() and journal.read_bytes().count(b"\n") > 3

    process = begun(tmp_path, "sweep", "s.toml", "--folder", "swept", "-j", "2", until=some)
    assert gone_after(process) < PATIENCE_s
    assert process.returncode == 130
    done = coupled(tmp_path, "sweep", "s.toml", "--folder", "swept", "-j", "1")
    assert done.returncode == 0
    assert "flights are there already" in done.stderr
    again = coupled(tmp_path, "sweep", "s.toml", "--folder", "swept", "-j", "1")
    assert again.stderr == "all 30 flights are there already; none is flown again\n"


def hold(job: int) -> int:
    time.sleep(HELD_s if job else 0.0)
    return job


def test_workers_that_are_busy_are_not_waited_for() -> None:
    began = time.monotonic()
    with pytest.raises(KeyboardInterrupt), executor(2) as pool:
        for made in as_done(pool, hold, [(0,), (1,), (2,), (3,)], 8):
            assert made == 0
            began = time.monotonic()
            raise KeyboardInterrupt
    assert time.monotonic() - began < HELD_s / 2


class OneThread(Executor):
    """An executor of one thread, which ends with this process even where it cannot end itself."""

    def __init__(self) -> None:
        self.jobs = SimpleQueue[Any]()
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self.jobs.put((future, fn, args))
        return future

    def work(self) -> None:
        while (job := self.jobs.get()) is not None:
            future, fn, args = job
            try:
                future.set_result(fn(*args))
            except Empty as error:
                future.set_exception(error)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self.jobs.put(None)
        self.thread.join(HELD_s)
        assert not self.thread.is_alive()


def interrupted_at(step: int) -> int:
    """Interrupt work at a line, call or return of what this thread does for it.

    Returns how many steps there were. Fails where the executor does not end.
    """
    seen = 0

    def trace(frame: FrameType, _: str, __: Any) -> Any:
        nonlocal seen
        if not frame.f_code.co_filename.endswith(("parallel.py", "_base.py", "threading.py")):
            return None
        seen += 1
        if seen == step:
            sys.settrace(None)
            signal.raise_signal(signal.SIGINT)
        return trace

    before = sys.gettrace()
    with OneThread() as pool, contextlib.suppress(KeyboardInterrupt):
        made = as_done(pool, slowly, [(job,) for job in range(4)], 2)
        next(made)
        try:
            sys.settrace(trace)
            list(made)
        finally:
            sys.settrace(before)
    return seen


def slowly(job: int) -> int:
    time.sleep(0.002)
    return job


def test_an_interruption_leaves_no_lock_of_the_executor_held() -> None:
    """Wherever it comes: one that is held for ever keeps a command from ending."""
    step = 1
    while interrupted_at(step) >= step:
        step += 1
    assert step > 30


class Gone(OneThread):
    """An executor whose workers have died."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        raise BrokenExecutor("no worker is left")


@pytest.mark.parametrize("kind", [OneThread, Gone])
def test_work_leaves_no_thread_behind(kind: type[OneThread]) -> None:
    """Workers that died are reported where their work is awaited."""
    before = threading.active_count()
    with kind() as pool:
        ends = contextlib.nullcontext() if kind is OneThread else pytest.raises(BrokenExecutor)
        with ends:
            assert sorted(as_done(pool, slowly, [(1,), (2,)], 2)) == [1, 2]
    began = time.monotonic()
    while threading.active_count() > before:
        assert time.monotonic() - began < HELD_s


def test_any_exception_of_the_work_is_raised() -> None:
    """A queue that was empty within the work was taken for one in which no work is done yet."""

    def empty(_: int) -> int:
        raise Empty

    with OneThread() as pool, pytest.raises(Empty):
        list(as_done(pool, empty, [(1,)], 2))


def test_each_job_is_done_once_and_few_wait() -> None:
    asked: list[int] = []

    def jobs() -> Iterator[tuple[int]]:
        for job in range(10):
            assert len(asked) == job  # with one that may wait, no call is made before it is wanted
            yield (job,)

    def double(job: int) -> int:
        asked.append(job)
        return 2 * job

    assert list(as_done(SerialExecutor(), double, jobs(), ahead=1)) == list(range(0, 20, 2))
    assert asked == list(range(10))


def test_an_interruption_that_a_library_swallowed_ends_the_work_at_its_next_step() -> None:
    with Stop(), progress("work") as advance:
        advance("one", 1, 3)
        assert not was_interrupted()
        with contextlib.suppress(KeyboardInterrupt):  # as a library does
            signal.raise_signal(signal.SIGINT)
        assert was_interrupted()
        with pytest.raises(KeyboardInterrupt):
            advance("two", 2, 3)
    assert not was_interrupted()


def test_a_pipe_gets_a_line_every_so_often(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("coupled.cli.progress.EVERY_s", 0.05)
    with progress("loading") as advance:
        time.sleep(0.2)
        advance("a, [b]", 1, 4)
        time.sleep(0.2)
    lines = capfd.readouterr().err.splitlines()
    assert f"{MARK} loading, after 0 s" in lines
    assert f"{MARK} a, [b], 25 %, after 0 s" in lines
    assert len(lines) >= 4


@pytest.mark.parametrize("code", ["raise KeyboardInterrupt", "raise TypeError('half loaded')"])
def test_an_interruption_while_a_command_loads_is_no_traceback(tmp_path: Path, code: str) -> None:
    """An interrupted import may raise what it likes."""
    script = (
        "import sys, signal, coupled.cli, coupled.__main__ as entry\n"
        "import coupled.flight.runfile as runfile\n"
        "def loads(name):\n"
        "    try:\n"
        "        signal.raise_signal(signal.SIGINT)\n"
        "    except KeyboardInterrupt:\n"
        f"        {code}\n"
        "runfile.read_run = loads\n"
        "sys.argv = ['coupled', 'fly']\n"
        "entry.command()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], check=False, cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (130, "")


def test_work_in_the_command_s_own_process_is_interrupted_too() -> None:
    def press(_: int) -> None:
        signal.raise_signal(signal.SIGINT)

    with Stop(), pytest.raises(KeyboardInterrupt):
        list(as_done(SerialExecutor(), press, [(1,)], 1))
