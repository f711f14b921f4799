"""A loader with the open protocol (`wire`) over UDP."""

from __future__ import annotations

import contextlib
import secrets
import select
import socket
import time
from collections import Counter
from collections.abc import Sequence

from coupled.errors import InputError
from coupled.live.link import Order, Reach, Sample, WATCHDOG_s
from coupled.live.roundtrip import RoundTrips, ask_for_stamps, receive
from coupled.live.wire import ORDER, BadPacketError, Header, newer, pack_orders, unpack_state
from coupled.rig.rig import Rig

LARGEST_bytes = 512
# Read in one frame: more than Linux's default receive buffer contains of the smallest packets
# (212,992 bytes of 768 each), so that none waits for the next frame. It also bounds a flood.
MOST_PACKETS = 512
STRONGEST_N = 2500.0  # a larger F exceeds a person's strength and is a fault
BEYOND = 1.25  # of the travel: δ exceeds δc's stop by the bend of the structure


def reaches(rig: Rig) -> list[Reach]:
    """Return the bounds of the measurements of a rig's controls, in the rig's order."""
    return [
        Reach(STRONGEST_N, BEYOND * control.travel + 200.0 * control.loader.bend)
        for control in rig.controls.values()
    ]


def resolved(host: str, port: int, name: str) -> tuple[int, tuple[object, ...]]:
    """Return the address family and the address of a host; raises InputError."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)
    except OSError as error:
        raise InputError(name, "", f"no such host: {error.strerror or error}") from None
    family, *_, address = found[0]
    return family, address


class UdpLink:
    """The host's side of the open protocol; it binds a free port and accepts one address only.

    `deflection`: the loader measures δ. In `lockstep` only the answer to the last orders is used.
    """

    measures_force = True

    def __init__(
        self, host: str, port: int, rig: Rig, deflection: bool = True, lockstep: bool = False
    ) -> None:
        self._lockstep = lockstep
        self.name = f"udp://{host}:{port}"
        self.measures_deflection = deflection
        self.dropped: Counter[str] = Counter()
        self.round_trips = RoundTrips()
        self._reaches = reaches(rig)
        self._session = secrets.randbits(32)
        self._sequence = 0
        self._last: int | None = None  # sequence number of the last valid state
        self._echo = 0  # the order that this state answered
        self._came_s = 0.0  # its time of arrival by the host's clock
        family, self._address = resolved(host, port, self.name)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self.round_trips.stamped = ask_for_stamps(self._socket)

    def receive(self, wait_s: float) -> Sample | None:
        """Return the newest valid sample since the last call; wait for it at most so long."""
        until = time.monotonic() + wait_s
        found = self._drain()
        while found is None and (left := until - time.monotonic()) > 0.0:
            if not select.select([self._socket], [], [], left)[0]:
                return None
            found = self._drain()
        return found

    def _drain(self) -> Sample | None:
        found = None
        for _ in range(MOST_PACKETS):
            try:
                packet, sender, came_ns = receive(
                    self._socket, LARGEST_bytes + 1, self.round_trips.stamped
                )
            except BlockingIOError:
                break
            except OSError:  # the other end refused a packet: it is not running
                continue
            try:
                found = self._taken(packet, sender, came_ns)
            except BadPacketError as reason:
                self.dropped[str(reason)] += 1
        return found

    def _taken(self, packet: bytes, sender: Sequence[object], came_ns: int) -> Sample:
        if tuple(sender[:2]) != tuple(self._address[:2]):
            raise BadPacketError("from elsewhere")
        header, sample = unpack_state(packet, self._reaches)
        if header.session != self._session:
            raise BadPacketError("of another flight")
        now_s = time.monotonic()
        counts_on = self._last is None or newer(header.sequence, self._last)
        if not counts_on and not self._restarted(header, now_s):
            raise BadPacketError("replayed or late")
        self._last, self._echo, self._came_s = header.sequence, header.echo, now_s
        self.round_trips.record_answer(header.echo, came_ns)
        if self._lockstep and header.echo != self._sequence:
            raise BadPacketError("answers older orders")
        return sample

    def _restarted(self, header: Header, now_s: float) -> bool:
        """Return whether a state with an older sequence number is of a restarted loader.

        A restarted loader counts from 1 again. Its state answers an order that was sent after the
        last one answered, unlike a repeated or delayed packet. Sequence numbers may restart only
        after silence for the watchdog's time.
        """
        silent = now_s - self._came_s > WATCHDOG_s
        sent = header.echo == self._sequence or newer(self._sequence, header.echo)
        return silent and sent and newer(header.echo, self._echo)

    def own_load(self, i: int, computed: float) -> float:
        """Return 0: basic gradient, damping and breakout are the loader's own."""
        return 0.0

    def ordered_gradient(self, i: int) -> float:
        """Return 0: the basic gradient is the loader's own."""
        return 0.0

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Send the orders of a frame; they are dropped if the network does not accept them."""
        self._sequence = (self._sequence + 1) % (1 << 32)
        now = time.monotonic_ns() // 1000
        numbers = (self._session, self._sequence, self._last or 0, now)
        header = Header(ORDER, len(orders), mode, *numbers)
        packet = pack_orders(header, orders)
        self.round_trips.record_order(self._sequence, time.time_ns())
        with contextlib.suppress(OSError):
            self._socket.sendto(packet, self._address)

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
