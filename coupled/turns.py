"""Work that holds the interpreter, by threads that would only take turns with it.

A flight of JSBSim lets no other thread of its process run. Of the calls that come while one is at
work, others are therefore done in processes beside this one. They are started by the first call
that would have to wait, and used as soon as they have loaded. Until then calls wait for each other.
What a call returns does not depend on where it is done.

Those processes load the module of the first call only. Those of `multiprocessing` load the main
module too, which would run the outermost lines of a user's script again.
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
_BEGIN = "import sys; sys.path[:] = {path}; from coupled.turns import serve; serve({module!r})"
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
        self._started: list[subprocess.Popen[bytes]] = []
        self._starting: list[Thread] = []
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
                self._starting.append(Thread(target=self._start_one, args=(module,), daemon=True))
                self._starting[-1].start()

    def _start_one(self, module: str) -> None:
        """Start a process, in a thread of its own, and offer it as a place when it has loaded."""
        path = [str(one) for one in sys.path]
        command = [sys.executable, "-c", _BEGIN.format(path=path, module=module)]
        apart: dict[str, Any] = {"start_new_session": True}  # the terminal interrupts this one only
        if sys.platform == "win32":
            apart = {"creationflags": subprocess.CREATE_NO_WINDOW}
        pipe = subprocess.PIPE
        with suppress(OSError, EOFError):  # it cannot be started, or ends as it loads
            with self._lock:
                if self._beside < 0:  # closed meanwhile
                    return
                process = subprocess.Popen(command, stdin=pipe, stdout=pipe, **apart)
                self._started.append(process)
            asked, answered = process.stdin, process.stdout
            assert asked is not None and answered is not None
            pickle.load(answered)

            def work_beside(work: partial[T]) -> T:
                try:
                    asked.write(pickle.dumps(work))
                    asked.flush()
                    found, fault = pickle.load(answered)
                except Exception:  # the process is gone, or cannot be given the work
                    raise _LostError from None
                except BaseException:  # interrupted: the next answer would be this call's
                    process.kill()
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
        for process in self._started:
            process.kill()
        for thread in self._starting:
            thread.join()
        for process in self._started:
            with suppress(OSError), process:  # closes its pipes and waits for it
                pass


def serve(module: str) -> None:
    """Do one call after another, until the other end of the pipe is closed."""
    asked, answered = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
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
            except Exception as error:  # raised where the call was made
                found, fault = None, error
            answer(found, fault)


@contextmanager
def turns(beside: int) -> Iterator[Turns]:
    """Give the places of a piece of work, and end their processes with it."""
    made = Turns(beside)
    try:
        yield made
    finally:
        made.close()
