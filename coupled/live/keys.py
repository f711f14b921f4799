"""The keys of the terminal: q, Esc or Ctrl-C ends the flight, m sets a mark."""

from __future__ import annotations

import importlib
import os
import select
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from coupled.live.host import Request

if TYPE_CHECKING:
    from coupled.live.host import Host

EVERY = 12  # frames between two reads
STOP = b"qQ\x1b"


class Keys:
    """Reads single keys, if the standard input is a terminal that allows it."""

    def __init__(self) -> None:
        self._before: Any = None
        self._count = 0
        if sys.stdin is None or not sys.stdin.isatty():
            return
        try:
            self._termios = importlib.import_module("termios")
            self._before = self._termios.tcgetattr(sys.stdin)
            importlib.import_module("tty").setcbreak(sys.stdin)
        except (ImportError, OSError):
            return  # no such terminal: Ctrl-C still works

    def begin(self, host: Host) -> None:
        """Start."""

    def observe(self, host: Host, k: int) -> None:
        """Do nothing at a frame."""

    def requests(self) -> Sequence[Request]:
        """Return the requests typed since the last call."""
        self._count += 1
        if self._before is None or self._count % EVERY:
            return ()
        if not select.select([sys.stdin], [], [], 0.0)[0]:
            return ()
        typed = os.read(sys.stdin.fileno(), 64)
        if not typed or any(key in STOP for key in typed):
            return (Request("stop"),)
        return [Request("mark") for key in typed if key in b"mM"]

    def close(self) -> None:
        """Restore the terminal's settings."""
        if self._before is not None:
            self._termios.tcsetattr(sys.stdin, self._termios.TCSADRAIN, self._before)
            self._before = None
