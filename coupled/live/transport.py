"""CLS2Sim's connection, by TCP or UDP, and the user's data on the loader."""

from __future__ import annotations

import contextlib
import math
import select
import socket
from dataclasses import dataclass

from coupled.errors import InputError
from coupled.live.roundtrip import ask_for_stamps, receive
from coupled.live.udp import resolved


@dataclass(frozen=True)
class Given:
    """Data on a loader that no source gives and the user has to measure.

    counts_per_N  force counts per newton; negative if they count against positions
    turn          controls with reversed axis: positions and forces
    profile       gradient of the loader's own force profile, N/d, at `scale`; v2 only
    """

    counts_per_N: float
    turn: frozenset[str] = frozenset()
    profile: float = 0.0
    scale: float = 0.0


class Transport:
    """A connection by TCP or UDP."""

    def __init__(self, kind: str, host: str, port: int, name: str) -> None:
        family, address = resolved(host, port, name)
        self._stream = kind == "tcp"
        self._socket = socket.socket(
            family, socket.SOCK_STREAM if self._stream else socket.SOCK_DGRAM
        )
        self._socket.settimeout(3.0)
        try:
            self._socket.connect(address)
        except OSError as error:
            self._socket.close()
            problem = f"does not answer: {error.strerror or error}; start CLS2Sim first"
            raise InputError(name, "", problem) from None
        if self._stream:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.setblocking(False)
        self.closed = False  # by the other end of a stream
        self._stamped = ask_for_stamps(self._socket)
        self.came_s = math.nan  # arrival of the last data by the system's stamp; NaN if unknown

    def send(self, packet: bytes) -> None:
        """Send a packet; it is dropped if the connection does not accept it."""
        with contextlib.suppress(OSError):
            self._socket.send(packet)

    def receive(self) -> bytes | None:
        """Return a datagram, which may be empty, or bytes of the stream; None if none came."""
        if self.closed:
            return None
        try:
            packet, _, came_ns = receive(self._socket, 4096, self._stamped)
        except OSError:
            return None
        self.came_s = 1e-9 * came_ns if self._stamped else math.nan
        self.closed = self._stream and not packet
        return None if self.closed else packet

    def wait(self, seconds: float) -> None:
        """Wait until data arrive, at most `seconds`."""
        # A closed stream is always readable, so select would return at once.
        select.select([] if self.closed else [self._socket], [], [], max(0.0, seconds))

    def close(self) -> None:
        """Close the connection."""
        self._socket.close()
