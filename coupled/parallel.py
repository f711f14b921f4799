"""Parallel execution: in this process, on all cores, or on a dask cluster.

All three have the interface of `concurrent.futures`. Workers end whenever their parent ends. Within
one task, threads run compiled code in parallel.
"""

from __future__ import annotations

import ast
import importlib
import inspect
import logging
import multiprocessing
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from coupled.callpool import CallPool, call_pool
from coupled.errors import InputError, say_warning

MOST_WORKERS = 512  # more than any machine has cores
_MOST_WORKERS_PER_TASK = 3  # worker processes of one task, of 150 MB each
_MOST_ON_WINDOWS = 61  # Windows waits for no more processes at once
PATIENCE_s = 10.0
_POLL_s = 0.2  # polling interval: an unlimited wait cannot be interrupted
T = TypeVar("T")
S = TypeVar("S")


class WorkCancelledError(Exception):
    """The work of this thread was cancelled."""


@dataclass(frozen=True)
class _ThreadTeam:
    """A limit on the number of threads, and a flag that stops them.

    `places` counts the threads that may still start; a waiting thread releases its place.
    """

    threads: int = 1
    places: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))
    halt: threading.Event = field(default_factory=threading.Event)
    calls: CallPool = field(default_factory=CallPool)
    above: _ThreadTeam | None = None  # the team whose work contains this work

    @property
    def halted(self) -> bool:
        """Whether this work, or the work that contains it, has been cancelled."""
        return self.halt.is_set() or (self.above is not None and self.above.halted)


_SINGLE_THREAD = _ThreadTeam()
_team: ContextVar[_ThreadTeam] = ContextVar("_team", default=_SINGLE_THREAD)


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let `in_threads` use up to `count` threads in this context; 0 means one per core.

    BLAS uses one thread: the matrices are small, and BLAS threads would compete with these. Results
    therefore do not depend on the number of cores.
    """
    limits = importlib.import_module("threadpoolctl").threadpool_limits  # takes 20 ms to load
    most = cores(count)
    alone = multiprocessing.parent_process() is not None  # a worker among others
    beside = 0 if alone else min(most - 1, _MOST_WORKERS_PER_TASK)
    with limits(1, "blas"), call_pool(beside) as places:
        before = _team.set(_ThreadTeam(most, threading.Semaphore(most - 1), calls=places))
        try:
            yield
        finally:
            _team.reset(before)


def in_threads(work: Callable[[S], T], items: Sequence[S]) -> list[T]:
    """Return `[work(item) for item in items]`, computed by the available threads.

    An exception of one item is raised here and cancels the others (`go_on`), as an interruption
    does. Nested calls use the threads that the outer call leaves idle. Compiled code and operations
    on large arrays run in parallel.
    """
    outer = _team.get()
    if outer.threads < 2 or len(items) < 2:
        return [work(item) for item in items]
    team = _ThreadTeam(outer.threads, outer.places, calls=outer.calls, above=outer)
    todo, done = SimpleQueue[int](), dict[int, T]()
    faults: list[BaseException] = []
    for number in range(len(items)):
        todo.put(number)

    def run_items() -> None:
        before = _team.set(team)
        try:
            while True:
                go_on()
                number = todo.get_nowait()
                done[number] = work(items[number])
        except (Empty, WorkCancelledError):
            pass
        except BaseException as error:  # raised in the calling thread
            faults.append(error)
            team.halt.set()
        finally:
            _team.reset(before)

    def run_and_release() -> None:
        try:
            run_items()
        finally:
            team.places.release()

    helpers: list[threading.Thread] = []
    try:
        while len(helpers) < len(items) - 1 and team.places.acquire(blocking=False):
            helpers.append(threading.Thread(target=run_and_release, daemon=True))
            helpers[-1].start()
        run_items()
        if helpers:
            _wait_for_all(helpers, team.places)
    finally:  # interrupted
        team.halt.set()
    for fault in faults:
        raise fault
    go_on()  # cancelled by the outer work
    return [done[number] for number in range(len(items))]


def _wait_for_all(helpers: Sequence[threading.Thread], places: threading.Semaphore) -> None:
    """Wait for threads to end; release the place of this thread meanwhile."""
    places.release()
    for helper in helpers:
        while helper.is_alive():
            helper.join(_POLL_s)
    places.acquire()


def in_turn(work: partial[T]) -> T:
    """Return `work()` for work that holds the GIL (`CallPool`)."""
    return _team.get().calls.call(work)


def go_on() -> None:
    """Raise WorkCancelledError if the work of this thread has been cancelled."""
    if _team.get().halted:
        raise WorkCancelledError


class SerialExecutor(Executor):
    """An executor that runs work immediately, in this process."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return a finished future; exceptions of the work are raised here."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def as_done(
    pool: Executor, work: Callable[..., T], calls: Iterable[Sequence[Any]], ahead: int
) -> Iterator[T]:
    """Yield the result of `work(*arguments)` for each call as soon as it is done, in any order.

    At most `ahead` calls wait for a worker, so arguments are generated when they are needed. An
    exception of a call is raised here. An interruption is handled within a fraction of a second,
    however long a call takes.
    """
    if isinstance(pool, SerialExecutor):
        for arguments in calls:
            yield work(*arguments)
        return
    todo, done, waiting = SimpleQueue[Sequence[Any] | None](), SimpleQueue[Future[T]](), 0

    def finished(patience_s: float) -> Iterator[T]:
        nonlocal waiting
        while True:
            try:
                future = done.get(timeout=patience_s)
            except Empty:
                return
            waiting, patience_s = waiting - 1, 0.0
            yield future.result()  # may raise any exception of the work, also Empty

    try:
        threading.Thread(target=_submit_calls, args=(pool, work, todo, done), daemon=True).start()
        for arguments in calls:
            todo.put(arguments)
            waiting += 1
            yield from finished(0.0)
            while waiting >= ahead:
                yield from finished(_POLL_s)
        while waiting:
            yield from finished(_POLL_s)
    finally:
        todo.put(None)


def _submit_calls(
    pool: Executor,
    work: Callable[..., T],
    todo: SimpleQueue[Sequence[Any] | None],
    done: SimpleQueue[Future[T]],
) -> None:
    """Submit calls to an executor from a thread.

    Only the main thread receives interruptions. An interruption while it holds a lock of the
    executor would leave the lock held, and the threads that end the executor would wait forever.
    Workers that start here ignore interruptions too.
    """
    block_interruptions()
    while (arguments := todo.get()) is not None:
        try:
            future = pool.submit(work, *arguments)
        except Exception as error:  # the workers ended, or the cluster was lost
            future = Future()
            future.set_exception(error)
        future.add_done_callback(done.put)


def block_interruptions() -> None:
    """Block SIGINT in this thread, and in the processes that it starts while they load."""
    if hasattr(signal, "pthread_sigmask"):
        resource_tracker.ensure_running()  # it would unblock the signal when it starts
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


def limit_memory() -> None:
    """Limit this process to half of the machine's memory: a small file can declare any size."""
    with suppress(ImportError, ValueError, OSError):
        resource: Any = importlib.import_module("resource")  # not on all systems
        half = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
        resource.setrlimit(resource.RLIMIT_DATA, (half, half))


def cores(workers: int) -> int:
    """Return the number of processes for a `workers` option: 0 means one per core.

    Cores are those that this process may use, or `PYTHON_CPU_COUNT` if it is set, which Python
    obeys from 3.13 on. Raises InputError for a negative number or more than `MOST_WORKERS`.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise InputError(
            "workers", "", f"is {workers}; give 1 to {MOST_WORKERS}, or 0 for all cores"
        )
    wanted = workers or _usable_cores()
    return min(wanted, _MOST_ON_WINDOWS) if sys.platform == "win32" else wanted


def _usable_cores() -> int:
    given = os.environ.get("PYTHON_CPU_COUNT", "")
    if given.isdecimal() and int(given) > 0:
        return int(given)
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def main_is_guarded() -> bool:
    """Return whether new processes can import the main module without repeating this call.

    A spawned process imports the main script. It repeats a call at the top level of the script,
    unless the call is under `if __name__ == "__main__":`.
    """
    main = sys.modules.get("__main__")
    file = getattr(main, "__file__", None)
    if main is None or file is None:  # a notebook or an interactive session
        return True
    frame, line = inspect.currentframe(), 0
    while frame is not None:
        if frame.f_globals is vars(main) and frame.f_code.co_name == "<module>":
            line = frame.f_lineno
        frame = frame.f_back
    try:
        tree = ast.parse(Path(file).read_bytes()) if line else None
    except (OSError, ValueError, SyntaxError):  # from standard input, or a module in an archive
        return getattr(main, "__spec__", None) is not None
    if tree is None:
        return True
    return any(
        isinstance(node, ast.If)
        and "__name__" in ast.unparse(node.test)
        and node.lineno <= line <= (node.end_lineno or line)
        for node in tree.body
    )


@contextmanager
def executor(workers: int, cluster: str = "") -> Iterator[Executor]:
    """Give an executor with `workers` processes, or the executor of a cluster if it has an address.

    At the end, work that has not started is cancelled. After an exception or an interruption the
    workers are killed.
    """
    if cluster:
        with _cluster(cluster) as pool:
            yield pool
        return
    if workers > 1 and not main_is_guarded():
        script = 'this script calls it outside of `if __name__ == "__main__":`'
        print(f"note: works in one process, not in {workers}: {script}", file=sys.stderr)
        workers = 1
    if workers <= 1:
        yield SerialExecutor()
        return
    # The matrices of a flight are small: BLAS threads would compete with the other workers.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    own = multiprocessing.get_context("spawn")
    # Workers hold the reading end: it closes when the parent ends, also if it is killed.
    alive, ours = own.Pipe(duplex=False)
    pool = ProcessPoolExecutor(
        workers, mp_context=own, initializer=_begin_worker, initargs=(alive,)
    )
    try:
        yield pool
    except BrokenExecutor:
        problem = "a worker died; what is finished is kept, and the same command goes on"
        raise InputError("--workers", "", problem) from None
    except BaseException:
        ours.close()  # interrupted, or the rest is not needed: do not wait for workers
        for worker in own.active_children():  # also those that are still loading
            worker.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        ours.close()
        alive.close()


def _begin_worker(alive: Connection) -> None:
    """Ignore SIGINT in a worker, and end it with its parent, even if the parent is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.showwarning = say_warning

    def follow() -> None:
        wait([alive])  # nothing is written to it, so this returns when it closes
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    try:
        distributed: Any = importlib.import_module("distributed")
    except ImportError:
        problem = "needs dask.distributed: pip install 'coupled[cluster]'"
        raise InputError("--cluster", "", problem) from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        client = distributed.Client(address, timeout=PATIENCE_s, set_as_default=False)
    except (OSError, ValueError, TypeError, AssertionError):  # AssertionError: a malformed address
        raise InputError("--cluster", "", f"{address} does not answer") from None
    try:
        client.wait_for_workers(1, timeout=PATIENCE_s)
    except TimeoutError:
        client.close()
        raise InputError("--cluster", "", f"{address} has no workers") from None
    pool = client.get_executor(pure=False)
    try:
        yield pool
    except (distributed.KilledWorker, CancelledError, OSError):
        problem = f"{address} was lost; what is finished is kept, and the same command goes on"
        raise InputError("--cluster", "", problem) from None
    finally:
        pool.shutdown(wait=False)
        client.close()
