"""The round trip time on the network: from an order to the answer that echoes it.

A loader answers at once, but the host reads only at its next frame. The time of arrival is that of
the system's stamp on the packet (Linux), otherwise that of reading, up to a frame later.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import sys
import time
from array import array
from typing import Any

import numpy as np

KEPT = 256  # orders that may still be answered
RECENT = 8192  # answers in the page's figures
_STAMP = 35  # SO_TIMESTAMPNS of Linux, option and message: seconds and ns since 1970
_SPEC = struct.Struct("@ll")
_ROOM_bytes = 64


class RoundTrips:
    """The times from the orders of a flight to their answers."""

    def __init__(self) -> None:
        self._sent: dict[int, int] = {}
        self._taken_ms: array[float] = array("f")
        self.stamped = False  # times of arrival are stamps of the system

    def record_order(self, sequence: int, at_ns: int) -> None:
        """Store the time of an order."""
        self._sent[sequence] = at_ns
        if len(self._sent) > KEPT:
            del self._sent[next(iter(self._sent))]

    def record_answer(self, echo: int, at_ns: int) -> None:
        """Store the round trip of an order that is answered, by its sequence number; once."""
        sent_ns = self._sent.pop(echo, None)
        if sent_ns is not None and at_ns >= sent_ns:  # the system's clock may have been set
            self._taken_ms.append(1e-6 * (at_ns - sent_ns))

    def as_dict(self, last: int | None = None) -> dict[str, Any] | None:
        """Return the figures of the flight, or of its last answers; None before the first."""
        taken = np.array(self._taken_ms[-(last or 0) :])  # a copy, for use by other threads
        if not taken.size:
            return None
        p50, p99, largest = np.round(np.percentile(taken, (50, 99, 100)), 4).tolist()
        figures = {"p50_ms": p50, "p99_ms": p99, "largest_ms": largest}
        return {"answers": len(taken), **figures, "stamped": self.stamped}

    def __str__(self) -> str:
        d = self.as_dict()
        if d is None:
            return "no order was answered"
        waiting = "" if self.stamped else ", with the host's wait for its next frame"
        return (
            f"round trip of {d['answers']} answers{waiting}: p50 {d['p50_ms']:.3f} ms,"
            f" p99 {d['p99_ms']:.3f} ms, largest {d['largest_ms']:.3f} ms"
        )


def ask_for_stamps(wire: socket.socket) -> bool:
    """Request time stamps of arriving packets; return whether the system gives them."""
    if sys.platform == "linux" and _SPEC.size == 16:
        with contextlib.suppress(OSError):
            wire.setsockopt(socket.SOL_SOCKET, _STAMP, 1)
            return True
    return False


def receive(wire: socket.socket, size: int, stamped: bool) -> tuple[bytes, Any, int]:
    """Return a packet, its sender, and its time of arrival in ns since 1970; raises OSError."""
    if not stamped:
        packet, sender = wire.recvfrom(size)
        return packet, sender, time.time_ns()
    packet, more, _, sender = wire.recvmsg(size, _ROOM_bytes)
    for level, kind, data in more:
        if (level, kind, len(data)) == (socket.SOL_SOCKET, _STAMP, _SPEC.size):
            seconds, ns = _SPEC.unpack(data)
            return packet, sender, seconds * 1_000_000_000 + ns
    return packet, sender, time.time_ns()
