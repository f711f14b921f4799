"""The open protocol between host and loader, version 1: its packets, packed and checked.

All numbers are little-endian, floats of 32 bits in SI. A packet is a header of 28 bytes, one block
for each control in the rig's order, and the CRC-32 (IEEE 802.3, as zlib's) of all before it.

    header   magic "CPLD" · version u8 · kind u8 · controls u8 · mode u8 · session u32
             · sequence u32 · echo u32, the other's last sequence · time u64 in µs of the sender
    state    kind 1, loader → host: F, δc, δ (NaN where it is not measured)
    order    kind 2, host → loader: ΔG, ΔG beyond the break, δc of the break, breakout, F_mod,
             G_T, trim

The host draws a session number for each flight, and the loader repeats it; the sequence rises by
one or more from packet to packet. `docs/live.md` documents the protocol.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

from coupled.live.link import Measured, Order, Reach, Sample
from coupled.schema import LARGEST

MAGIC, VERSION = b"CPLD", 1
STATE, ORDER = 1, 2
HEADER = struct.Struct("<4sBBBBIIIQ")
_STATE, _ORDER, _CRC = struct.Struct("<3f"), struct.Struct("<7f"), struct.Struct("<I")
HALF = 1 << 31  # a sequence number less than half its range ahead is newer


class BadPacketError(ValueError):
    """A packet that is not used; its text is the reason under which it is counted."""


@dataclass(frozen=True)
class Header:
    """The header of a packet."""

    kind: int
    controls: int
    mode: int
    session: int
    sequence: int
    echo: int
    time_us: int


def newer(sequence: int, last: int) -> bool:
    """Return whether a sequence number is newer than another; it wraps after 2³² − 1."""
    return 0 < (sequence - last) % (1 << 32) < HALF


def _pack(header: Header, blocks: bytes) -> bytes:
    h = header
    head = HEADER.pack(
        *(MAGIC, VERSION, h.kind, h.controls, h.mode),
        *(h.session, h.sequence % (1 << 32), h.echo, h.time_us % (1 << 64)),
    )
    return head + blocks + _CRC.pack(zlib.crc32(head + blocks))


def pack_state(header: Header, measured: Sequence[Measured]) -> bytes:
    """Return a loader's packet."""
    return _pack(header, b"".join(_STATE.pack(*one) for one in measured))


def pack_orders(header: Header, orders: Sequence[Order]) -> bytes:
    """Return a host's packet."""
    return _pack(header, b"".join(_ORDER.pack(*one) for one in orders))


def _header(packet: bytes, kind: int, controls: int) -> Header:
    """Return a packet's header after a check of length and CRC; raises BadPacketError."""
    block = (_STATE if kind == STATE else _ORDER).size
    if len(packet) < HEADER.size + _CRC.size or packet[:4] != MAGIC:
        raise BadPacketError("no packet of the protocol")
    _, version, found, count, mode, *numbers = HEADER.unpack_from(packet)
    if version != VERSION:
        raise BadPacketError("another version")
    if found != kind or count != controls:
        raise BadPacketError("another kind or number of controls")
    if len(packet) != HEADER.size + block * controls + _CRC.size:
        raise BadPacketError("wrong length")
    (crc,) = _CRC.unpack_from(packet, len(packet) - _CRC.size)
    if crc != zlib.crc32(packet[: -_CRC.size]):
        raise BadPacketError("damaged")
    return Header(found, count, mode, *numbers)


def unpack_state(packet: bytes, reaches: Sequence[Reach]) -> tuple[Header, Sample]:
    """Return the content of a loader's packet; raises BadPacketError if it cannot be used.

    `reaches` has the bounds of each control's measurements.
    """
    header = _header(packet, STATE, len(reaches))
    found = []
    for i, reach in enumerate(reaches):
        measured = Measured(*_STATE.unpack_from(packet, HEADER.size + i * _STATE.size))
        if not reach.holds(measured):
            finite = math.isfinite(measured.force) and math.isfinite(measured.computed)
            raise BadPacketError("out of range" if finite else "not a number")
        found.append(measured)
    time_s = 1e-6 * header.time_us
    if time_s > LARGEST:  # no record with it could be read
        raise BadPacketError("out of range")
    return header, Sample(tuple(found), time_s)


def unpack_orders(packet: bytes, controls: int) -> tuple[Header, tuple[Order, ...]]:
    """Return the content of a host's packet; raises BadPacketError if it cannot be used."""
    header = _header(packet, ORDER, controls)
    orders = tuple(
        Order(*_ORDER.unpack_from(packet, HEADER.size + i * _ORDER.size)) for i in range(controls)
    )
    if not all(math.isfinite(value) for order in orders for value in order):
        raise BadPacketError("not a number")
    return header, orders
