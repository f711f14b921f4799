"""A loader's end of the open protocol, version 1, in Python's standard library alone.

Copy this file. Give `Loader` a function that measures and one that acts:

    loader = Loader(port=5760, controls=1)
    while True:
        loader.step(measure=lambda: [(force_N, computed_m, deflection_m)], act=print)

`step` answers each of the host's packets at once. After 100 ms without a packet, or if the host's
mode is "off", the orders passed to `act` are zero: the loader's own gradient remains.
"""

from __future__ import annotations

import math
import socket
import struct
import time
import zlib
from collections.abc import Callable, Sequence

MAGIC, VERSION, STATE, ORDER = b"CPLD", 1, 1, 2
RUN, FADING, OFF = 1, 2, 3
HEADER, CRC = struct.Struct("<4sBBBBIIIQ"), struct.Struct("<I")
STATE_BLOCK, ORDER_BLOCK = struct.Struct("<3f"), struct.Struct("<7f")
WATCHDOG_s = 0.1

Block = tuple[float, ...]
Measure = Callable[[], Sequence[tuple[float, float, float]]]  # F in N, δc, δ (NaN: not measured)
# ΔG, ΔG beyond the break, δc of the break, breakout, F_mod, G_T, trim, of each control
Act = Callable[[Sequence[Block]], object]


class Loader:
    """Answers one host; binds to loopback by default."""

    def __init__(self, port: int, controls: int = 1, address: str = "127.0.0.1") -> None:
        self.controls = controls
        self.dropped = 0
        self.mode = OFF
        self.fresh = False  # the orders came with the last step
        self._zero: list[Block] = [(0.0,) * 7] * controls
        self._orders = list(self._zero)
        self._session = self._last = -1
        self._sequence = 0
        self._heard = -math.inf
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((address, port))
        self.port = int(self._socket.getsockname()[1])

    def step(self, measure: Measure, act: Act, wait_s: float = WATCHDOG_s) -> bool:
        """Wait for a packet of the host, act on it, answer; return whether one came."""
        self._socket.settimeout(wait_s)
        try:
            packet, host = self._socket.recvfrom(512)
        except (TimeoutError, ConnectionError):
            packet, host = b"", None
        heard = self.fresh = host is not None and self._take(packet)
        if time.monotonic() - self._heard > WATCHDOG_s or self.mode == OFF:
            self._orders = list(self._zero)
        act(self._orders)
        if heard:
            self._socket.sendto(self._state(measure()), host)
        return heard

    def _take(self, packet: bytes) -> bool:
        """Take the orders of a packet; return whether it is valid and new."""
        size = HEADER.size + self.controls * ORDER_BLOCK.size + CRC.size
        if len(packet) != size or CRC.unpack(packet[-4:])[0] != zlib.crc32(packet[:-4]):
            self.dropped += 1
            return False
        magic, version, kind, controls, mode, session, sequence, _, _ = HEADER.unpack_from(packet)
        orders = [
            ORDER_BLOCK.unpack_from(packet, HEADER.size + i * ORDER_BLOCK.size)
            for i in range(self.controls)
        ]
        known = (magic, version, kind, controls) == (MAGIC, VERSION, ORDER, self.controls)
        quiet = time.monotonic() - self._heard > WATCHDOG_s  # then another host may begin
        mine = session == self._session or quiet or self.mode == OFF
        late = session == self._session and not 0 < (sequence - self._last) % 2**32 < 2**31
        finite = all(math.isfinite(value) for order in orders for value in order)
        if not known or not mine or late or not finite or mode not in (RUN, FADING, OFF):
            self.dropped += 1
            return False
        self._session, self._last, self.mode = session, sequence, mode
        self._orders, self._heard = list(orders), time.monotonic()
        return True

    def _state(self, measured: Sequence[tuple[float, float, float]]) -> bytes:
        self._sequence = (self._sequence + 1) % 2**32
        now = time.monotonic_ns() // 1000
        head = HEADER.pack(
            *(MAGIC, VERSION, STATE, self.controls, self.mode),
            *(self._session, self._sequence, self._last, now),
        )
        whole = head + b"".join(STATE_BLOCK.pack(*one) for one in measured)
        return whole + CRC.pack(zlib.crc32(whole))

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
