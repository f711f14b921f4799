"""Calls of code that holds the GIL, run in parallel by worker processes.

A flight of JSBSim holds the global interpreter lock, so threads cannot run flights in parallel.
`CallPool` runs one call in this process and further simultaneous calls in worker processes. The
workers start when a call would first have to wait, and are used as soon as they have loaded. The
result of a call does not depend on the process.

A worker imports the module of the first call only. Workers of `multiprocessing` would also import
the main module, and so run the top level of a user's script again.
"""

from __future__ import annotations

import importlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Any, TypeVar

T = TypeVar("T")
Place = Callable[[partial[Any]], Any]
_BEGIN = "import sys; sys.path[:] = {path}; from coupled.callpool import serve; serve({module!r})"
_this_process = Lock()


class _LostError(Exception):
    """The worker process of a call has ended."""


def _call_in_this_process(work: partial[T]) -> T:
    with _this_process:
        return work()


class CallPool:
    """A pool of this process and at most `workers` worker processes, one call in each at a time."""

    def __init__(self, workers: int = 0) -> None:
        self._idle: SimpleQueue[Place] = SimpleQueue()
        self._idle.put(_call_in_this_process)
        self._beside = workers  # workers that may still be started
        self._started: list[subprocess.Popen[bytes]] = []
        self._starting: list[Thread] = []
        self._lock = Lock()

    def call(self, work: partial[T]) -> T:
        """Return `work()`, or raise its exception; unpicklable work runs in this process."""
        try:
            place = self._idle.get_nowait()
        except Empty:
            self._start(work.func.__module__)
            place = self._idle.get()
        try:
            found: T = place(work)
        except _LostError:
            return self.call(work)  # in another process
        except BaseException:
            self._idle.put(place)
            raise
        self._idle.put(place)
        return found

    def _start(self, module: str) -> None:
        """Start the remaining workers, which load a module."""
        with self._lock:
            wanted, self._beside = self._beside, 0
            for _ in range(wanted):
                self._starting.append(Thread(target=self._start_one, args=(module,), daemon=True))
                self._starting[-1].start()

    def _start_one(self, module: str) -> None:
        """Start a worker from a thread, and add it to the idle callers when it has loaded."""
        path = [str(one) for one in sys.path]
        command = [sys.executable, "-c", _BEGIN.format(path=path, module=module)]
        apart: dict[str, Any] = {"start_new_session": True}  # no Ctrl-C from the terminal
        if sys.platform == "win32":
            apart = {"creationflags": subprocess.CREATE_NO_WINDOW}
        pipe = subprocess.PIPE
        with suppress(OSError, EOFError):  # the worker cannot be started, or ends while loading
            with self._lock:
                if self._beside < 0:  # closed in the meantime
                    return
                process = subprocess.Popen(command, stdin=pipe, stdout=pipe, **apart)
                self._started.append(process)
            asked, answered = process.stdin, process.stdout
            assert asked is not None and answered is not None
            pickle.load(answered)

            def call_in_worker(work: partial[T]) -> T:
                try:
                    asked.write(pickle.dumps(work))
                    asked.flush()
                    found, fault = pickle.load(answered)
                except Exception:  # the worker has ended, or the work cannot be pickled
                    raise _LostError from None
                except BaseException:  # interrupted: the answer would be read by the next call
                    process.kill()
                    raise
                if fault is not None:
                    raise fault
                result: T = found
                return result

            self._idle.put(call_in_worker)

    def close(self) -> None:
        """Kill the workers."""
        with self._lock:
            self._beside = -1
        for process in self._started:
            process.kill()
        for thread in self._starting:
            thread.join()
        for process in self._started:
            with suppress(OSError), process:  # closes the pipes and waits for the process
                pass


def serve(module: str) -> None:
    """Run calls read from standard input until it is closed; the main function of a worker."""
    asked, answered = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # prints of a library go to stderr
    importlib.import_module(module)

    def answer(found: Any, fault: Exception | None) -> None:
        answered.write(pickle.dumps((found, fault)))
        answered.flush()

    with suppress(EOFError, OSError):
        answer(None, None)
        while True:
            work = pickle.load(asked)
            try:
                found, fault = work(), None
            except Exception as error:  # raised again in the calling process
                found, fault = None, error
            answer(found, fault)


@contextmanager
def call_pool(workers: int) -> Iterator[CallPool]:
    """Give a pool with at most `workers` workers, and close it at the end of the block."""
    made = CallPool(workers)
    try:
        yield made
    finally:
        made.close()
