"""Work that holds the interpreter, by threads that would only take turns with it.

A flight of JSBSim lets no other thread of its process run. Of the calls that come while one is at
work, others are therefore done in processes beside this one. They are started by the first call
that would have to wait, and used as soon as they have loaded. Until then, and in a process that may
not have children, calls wait for each other. What a call returns does not depend on where it is
done.
"""

from __future__ import annotations

import importlib
import multiprocessing
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Any, TypeVar

T = TypeVar("T")
Place = Callable[[partial[Any]], Any]
_GONE = (EOFError, OSError)  # what a pipe raises whose other end is closed
_here = Lock()


class _LostError(Exception):
    """The process that was to do a call is gone."""


def _work_here(work: partial[T]) -> T:
    with _here:
        return work()


class Turns:
    """The places where calls are done: this process, and up to so many beside it."""

    def __init__(self, beside: int = 0) -> None:
        self._idle: SimpleQueue[Place] = SimpleQueue()
        self._idle.put(_work_here)
        self._beside = beside  # processes that may still be started
        self._started: list[tuple[Any, Connection]] = []
        self._lock = Lock()

    def call(self, work: partial[T]) -> T:
        """Return what `work` gives, and raise what it raises; here, if it cannot be pickled."""
        try:
            place = self._idle.get_nowait()
        except Empty:
            self._start(work.func.__module__)
            place = self._idle.get()
        try:
            found: T = place(work)
        except _LostError:
            return self.call(work)  # at another place
        except BaseException:
            self._idle.put(place)
            raise
        self._idle.put(place)
        return found

    def _start(self, module: str) -> None:
        """Start the processes that may still be started, and let them load a module."""
        with self._lock:
            wanted, self._beside = self._beside, 0
        for _ in range(wanted):
            Thread(target=self._start_one, args=(module,), daemon=True).start()

    def _start_one(self, module: str) -> None:
        """Start a process, in a thread of its own, and offer it as a place when it has loaded."""
        block_interruptions()
        spawn = multiprocessing.get_context("spawn")
        ours, theirs = spawn.Pipe()
        process = spawn.Process(target=_serve, args=(theirs, module), daemon=True)
        with suppress(*_GONE):
            with self._lock:
                if self._beside < 0:  # closed meanwhile
                    return
                process.start()
                self._started.append((process, ours))
            theirs.close()
            ours.recv()

            def work_beside(work: partial[T]) -> T:
                try:
                    ours.send(work)
                    found, fault = ours.recv()
                except Exception:  # the process is gone, or cannot be given the work
                    raise _LostError from None
                except BaseException:  # interrupted: the next answer would be this call's
                    ours.close()
                    raise
                if fault is not None:
                    raise fault
                result: T = found
                return result

            self._idle.put(work_beside)

    def close(self) -> None:
        """End the processes."""
        with self._lock:
            self._beside = -1
            for process, ours in self._started:
                process.kill()
                process.join()
                ours.close()


def _serve(pipe: Connection, module: str) -> None:
    """Do one call after another, until the other end of the pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    importlib.import_module(module)
    with suppress(*_GONE):
        pipe.send(None)
        while True:
            work = pipe.recv()
            answer: tuple[Any, Exception | None]
            try:
                answer = work(), None
            except Exception as error:  # raised where the call was made
                answer = None, error
            pipe.send(answer)


def block_interruptions() -> None:
    """Keep interruptions from this thread, and from the processes that it starts as they load."""
    if hasattr(signal, "pthread_sigmask"):
        resource_tracker.ensure_running()  # it would unblock them when it starts
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


@contextmanager
def turns(beside: int) -> Iterator[Turns]:
    """Give the places of a piece of work, and end their processes with it."""
    made = Turns(beside)
    try:
        yield made
    finally:
        made.close()
