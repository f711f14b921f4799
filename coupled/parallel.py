"""Where much work is done: here, on all cores, or on a dask cluster.

The three have one face, that of `concurrent.futures`. However the parent ends, its workers end
with it. Within one piece of work, threads share what runs compiled.
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

from coupled.errors import InputError, say_warning
from coupled.turns import Turns, turns

MOST_WORKERS = 512  # processes: more than any machine has cores for
_MOST_BESIDE = 3  # processes beside the threads of one piece of work, of 150 MB each
_MOST_ON_WINDOWS = 61  # it waits for no more processes at once
PATIENCE_s = 10.0
_ATTENTIVE_s = 0.2  # a wait without end may not see an interruption before a job is done
T = TypeVar("T")
S = TypeVar("S")


class HaltedError(Exception):
    """Work in a thread is not wanted any more."""


@dataclass(frozen=True)
class _Team:
    """So many threads that may work at once, and whether they are to stop.

    `places` are the threads that may still begin: one that waits for others gives its own up.
    """

    threads: int = 1
    places: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(0))
    halt: threading.Event = field(default_factory=threading.Event)
    turns: Turns = field(default_factory=Turns)
    above: _Team | None = None  # that within whose work this one works

    @property
    def halted(self) -> bool:
        """Whether its work, or that of which it is a part, is not wanted any more."""
        return self.halt.is_set() or (self.above is not None and self.above.halted)


_ALONE = _Team()
_team: ContextVar[_Team] = ContextVar("_team", default=_ALONE)


@contextmanager
def threads(count: int) -> Iterator[None]:
    """Let `in_threads` use so many threads within; 0 is one a core.

    Linear algebra has one within: its matrices are small here, and threads of its own would take
    turns with these. So an answer does not depend on how many cores it was given either.
    """
    limits = importlib.import_module("threadpoolctl").threadpool_limits  # takes 20 ms to load
    most = cores(count)
    alone = multiprocessing.parent_process() is not None  # a worker beside others
    beside = 0 if alone else min(most - 1, _MOST_BESIDE)
    with limits(1, "blas"), turns(beside) as places:
        before = _team.set(_Team(most, threading.Semaphore(most - 1), turns=places))
        try:
            yield
        finally:
            _team.reset(before)


def in_threads(work: Callable[[S], T], items: Sequence[S]) -> list[T]:
    """Return what `work` gives of each item, in their order, by the threads that there are.

    What one raises is raised here, and halts the others (`go_on`), as an interruption does. Work
    within work takes the threads that the outer one leaves idle. Compiled stages and large arrays
    run beside each other.
    """
    outer = _team.get()
    if outer.threads < 2 or len(items) < 2:
        return [work(item) for item in items]
    team = _Team(outer.threads, outer.places, turns=outer.turns, above=outer)
    todo, done = SimpleQueue[int](), dict[int, T]()
    faults: list[BaseException] = []
    for number in range(len(items)):
        todo.put(number)

    def some() -> None:
        before = _team.set(team)
        try:
            while True:
                go_on()
                number = todo.get_nowait()
                done[number] = work(items[number])
        except (Empty, HaltedError):
            pass
        except BaseException as error:  # raised where the work was asked for
            faults.append(error)
            team.halt.set()
        finally:
            _team.reset(before)

    def help_out() -> None:
        try:
            some()
        finally:
            team.places.release()

    helpers: list[threading.Thread] = []
    try:
        while len(helpers) < len(items) - 1 and team.places.acquire(blocking=False):
            helpers.append(threading.Thread(target=help_out, daemon=True))
            helpers[-1].start()
        some()
        if helpers:
            _wait_for_all(helpers, team.places)
    finally:  # interrupted
        team.halt.set()
    for fault in faults:
        raise fault
    go_on()  # what is not done was halted from without
    return [done[number] for number in range(len(items))]


def _wait_for_all(helpers: Sequence[threading.Thread], places: threading.Semaphore) -> None:
    """Wait for threads to end; meanwhile another may work in this one's place."""
    places.release()
    for helper in helpers:
        while helper.is_alive():
            helper.join(_ATTENTIVE_s)
    places.acquire()


def in_turn(work: partial[T]) -> T:
    """Return what `work` gives, which holds the interpreter (`Turns`)."""
    return _team.get().turns.call(work)


def go_on() -> None:
    """Raise HaltedError where this thread's work is not wanted any more."""
    if _team.get().halted:
        raise HaltedError


class Here(Executor):
    """An executor that does the work at once, in this process."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Return a future that is done; what the work raises is raised here."""
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def as_done(
    pool: Executor, work: Callable[..., T], calls: Iterable[Sequence[Any]], ahead: int
) -> Iterator[T]:
    """Yield what `work` gives of each call's arguments, as soon as it is done, in any order.

    No more than `ahead` calls wait for a worker, so that their arguments are made as they are
    wanted. What a call raises is raised here. An interruption is met within a fraction of a
    second, however long a call takes.
    """
    if isinstance(pool, Here):
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
            yield future.result()  # whatever the work raises, be it Empty too

    try:
        threading.Thread(target=_hand_over, args=(pool, work, todo, done), daemon=True).start()
        for arguments in calls:
            todo.put(arguments)
            waiting += 1
            yield from finished(0.0)
            while waiting >= ahead:
                yield from finished(_ATTENTIVE_s)
        while waiting:
            yield from finished(_ATTENTIVE_s)
    finally:
        todo.put(None)


def _hand_over(
    pool: Executor,
    work: Callable[..., T],
    todo: SimpleQueue[Sequence[Any] | None],
    done: SimpleQueue[Future[T]],
) -> None:
    """Give an executor its work, in a thread of its own.

    Interruptions reach the main thread only. One that came there while a lock of the executor's
    is held would leave it locked, and the threads that end the executor would wait for it for
    ever. A worker that is begun here never gets one either.
    """
    block_interruptions()
    while (arguments := todo.get()) is not None:
        try:
            future = pool.submit(work, *arguments)
        except Exception as error:  # the workers died, or the cluster went
            future = Future()
            future.set_exception(error)
        future.add_done_callback(done.put)


def block_interruptions() -> None:
    """Keep interruptions from this thread, and from the processes that it starts as they load."""
    if hasattr(signal, "pthread_sigmask"):
        resource_tracker.ensure_running()  # it would unblock them when it starts
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


def limit_memory() -> None:
    """Let this process ask for half of the machine's memory: a small file can declare any size."""
    with suppress(ImportError, ValueError, OSError):
        resource: Any = importlib.import_module("resource")  # not on every system
        half = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 2
        resource.setrlimit(resource.RLIMIT_DATA, (half, half))


def cores(workers: int) -> int:
    """Return how many processes a number of workers means: 0 is one a core.

    Raises InputError for a number that no machine has.
    """
    if not 0 <= workers <= MOST_WORKERS:
        raise InputError(
            "workers", "", f"is {workers}; give 1 to {MOST_WORKERS}, or 0 for all cores"
        )
    wanted = workers or os.cpu_count() or 1
    return min(wanted, _MOST_ON_WINDOWS) if sys.platform == "win32" else wanted


def guarded() -> bool:
    """Tell whether new processes could load the main module without running this call again.

    A process that is spawned loads the main script anew. A call from the script's own level is
    reached then as well, unless it stands under `if __name__ == "__main__":`.
    """
    main = sys.modules.get("__main__")
    file = getattr(main, "__file__", None)
    if main is None or file is None:  # a notebook, or an interactive session
        return True
    frame, line = inspect.currentframe(), 0
    while frame is not None:
        if frame.f_globals is vars(main) and frame.f_code.co_name == "<module>":
            line = frame.f_lineno
        frame = frame.f_back
    try:
        tree = ast.parse(Path(file).read_bytes()) if line else None
    except (OSError, ValueError, SyntaxError):  # from standard input; or of an archive, a module
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
    """Give an executor of so many processes, or a cluster's where an address is given.

    Work that has not begun is dropped when it is left; on an error or an interruption the
    workers end at once, within the work that they do.
    """
    if cluster:
        with _cluster(cluster) as pool:
            yield pool
        return
    if workers > 1 and not guarded():
        script = 'this script calls it outside of `if __name__ == "__main__":`'
        print(f"note: works in one process, not in {workers}: {script}", file=sys.stderr)
        workers = 1
    if workers <= 1:
        yield Here()
        return
    # A flight's matrices are small: threads of theirs would only take turns with the other workers.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    own = multiprocessing.get_context("spawn")
    # The workers hold the reading end: it closes with the parent, however that ends.
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
        ours.close()  # interrupted, or nothing to be done with the rest: no worker is waited for
        for worker in own.active_children():  # nor one that is still loading
            worker.kill()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        ours.close()
        alive.close()


def _begin_worker(alive: Connection) -> None:
    """Leave interrupts to the parent, and end with it, even if it is killed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    warnings.showwarning = say_warning

    def follow() -> None:
        wait([alive])  # it is never written to, so that this is its end
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
    except (OSError, ValueError, TypeError, AssertionError):  # the last of a malformed address
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
