"""Streams, signals and exit code of a command's process."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import signal
import sys
import warnings
from types import FrameType

from coupled.errors import say_warning

REFUSED = 2  # input that cannot be used
INTERRUPTED = 130  # as in a shell after Ctrl-C: 128 plus the number of SIGINT
PIPE_CLOSED = 141  # likewise of SIGPIPE: the output's pipe was closed
_STREAM_FAULTS = (errno.ENOSPC, errno.EIO, errno.EBADF, errno.EFBIG, errno.EDQUOT)


class Stop:
    """Makes SIGTERM and SIGHUP end a command as Ctrl-C does: finished work is kept.

    `exit_code` is that of the signal received, or 0; `received` is true after any signal, Ctrl-C
    included, since a library may swallow the exception.
    """

    def __init__(self) -> None:
        self.exit_code, self.received = 0, False
        wanted = [getattr(signal, name, None) for name in ("SIGTERM", "SIGHUP")]
        # An ignored signal, as with nohup, stays ignored.
        self._signals = [n for n in wanted if n and signal.getsignal(n) == signal.SIG_DFL]

    def __enter__(self) -> Stop:
        for number in self._signals:
            signal.signal(number, self._handle_signal)
        self._before = signal.getsignal(signal.SIGINT)
        if self._before == signal.default_int_handler:
            signal.signal(signal.SIGINT, self._handle_signal)
        return self

    def __exit__(self, *error: object) -> None:
        for number in self._signals:
            signal.signal(number, signal.SIG_DFL)
        signal.signal(signal.SIGINT, self._before)

    def _handle_signal(self, number: int, frame: FrameType | None) -> None:
        self.received = True
        if number != signal.SIGINT:  # the command decides how it ends
            self.exit_code = 128 + number
        raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Return whether a signal was received within a `Stop`."""
    stop = getattr(signal.getsignal(signal.SIGINT), "__self__", None)
    return isinstance(stop, Stop) and stop.received


def prepare_streams() -> None:
    """Make the standard streams safe to use.

    A closed stream is opened on the null device, or the next file would take its number and receive
    the prints of libraries. A character that the terminal's encoding lacks is shown as a question
    mark instead of an error.
    """
    for number in (0, 1, 2):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest free number: this one
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def prepare_threads() -> None:
    """Let linear algebra use one thread, unless the user sets another number.

    The matrices are small, and its threads would mostly wait for one another; long work is
    distributed to processes. This has an effect only before numpy is loaded.
    """
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


def prepare_warnings() -> None:
    """Print warnings of libraries as one line, without the code location."""
    warnings.showwarning = say_warning


def silence_streams() -> None:
    """Discard buffered output of a closed stream."""
    for stream in (sys.stdout, sys.stderr):
        if stream is None:
            continue
        try:
            stream.flush()
        except OSError:
            with contextlib.suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, stream.fileno())
                os.close(nowhere)


def error_text(error: OSError | MemoryError) -> str:
    """Return the message for an OSError that no reader or writer has handled."""
    if isinstance(error, MemoryError):
        return "out of memory: shorter records, or fewer workers, need less"
    why = error.strerror or str(error)
    if error.filename is not None:
        return f"{error.filename}: {why}"
    place = "standard output: cannot be written: " if error.errno in _STREAM_FAULTS else ""
    return place + why
