"""Packets of the open protocol: they return their content, and others are dropped."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coupled.live.link import Measured, Order, Reach
from coupled.live.wire import (
    ORDER,
    STATE,
    BadPacketError,
    Header,
    newer,
    pack_orders,
    pack_state,
    unpack_orders,
    unpack_state,
)

REACHES = [Reach(2500.0, 0.25)]
HEADER = Header(STATE, 1, 1, 0xDEADBEEF, 7, 6, 123456789)
GOOD = pack_state(HEADER, [Measured(12.5, 0.0625, 0.03125)])
single = st.floats(width=32, allow_nan=False, allow_infinity=False)


def test_a_state_is_laid_out_as_the_page_says() -> None:
    by_hand = b"CPLD" + bytes([1, 1, 1, 1]) + (0xDEADBEEF).to_bytes(4, "little")
    by_hand += (7).to_bytes(4, "little") + (6).to_bytes(4, "little")
    by_hand += (123456789).to_bytes(8, "little") + struct.pack("<3f", 12.5, 0.0625, 0.03125)
    assert by_hand + zlib.crc32(by_hand).to_bytes(4, "little") == GOOD
    assert len(GOOD) == 44


def test_an_order_is_laid_out_as_the_page_says() -> None:
    order = Order(1.0, 2.0, 0.5, 3.0, 4.0, 5.0, 0.25)
    packet = pack_orders(Header(ORDER, 1, 2, 1, 2, 3, 4), [order])
    assert len(packet) == 60
    assert struct.unpack_from("<7f", packet, 28) == tuple(order)
    assert unpack_orders(packet, 1) == (Header(ORDER, 1, 2, 1, 2, 3, 4), (order,))


@given(st.floats(-2500, 2500, width=32), st.floats(-0.25, 0.25, width=32))
def test_what_is_packed_comes_back(force: float, computed: float) -> None:
    for deflection in (computed, math.nan):
        packet = pack_state(HEADER, [Measured(force, computed, deflection)])
        header, sample = unpack_state(packet, REACHES)
        assert header == HEADER
        assert sample.controls[0][:2] == (force, computed)
        assert math.isnan(sample.controls[0].deflection) == math.isnan(deflection)


@given(st.binary(max_size=200))
@example(b"")
@example(GOOD[:-1])
@example(GOOD + b"\0")
def test_random_bytes_are_dropped(packet: bytes) -> None:
    with pytest.raises(BadPacketError):
        unpack_state(packet, REACHES)


@settings(max_examples=300)
@given(st.integers(0, 8 * len(GOOD) - 1), st.integers(0, 8 * len(GOOD) - 1))
def test_one_or_two_flipped_bits_are_detected(one: int, other: int) -> None:
    bits = int.from_bytes(GOOD, "little") ^ (1 << one)
    if other != one:
        bits ^= 1 << other
    with pytest.raises(BadPacketError):
        unpack_state(bits.to_bytes(len(GOOD), "little"), REACHES)


@pytest.mark.parametrize(
    ("measured", "reason"),
    [
        (Measured(math.nan, 0.0), "not a number"),
        (Measured(0.0, math.nan), "not a number"),
        (Measured(math.inf, 0.0), "not a number"),
        (Measured(2501.0, 0.0), "out of range"),
        (Measured(0.0, -0.26), "out of range"),
        (Measured(0.0, 0.0, 0.26), "out of range"),
    ],
)
def test_a_measurement_beyond_any_loader_is_dropped(measured: Measured, reason: str) -> None:
    with pytest.raises(BadPacketError, match=reason):
        unpack_state(pack_state(HEADER, [measured]), REACHES)


def test_a_clock_that_no_record_can_have_is_dropped() -> None:
    packet = pack_state(replace(HEADER, time_us=2**63), [Measured(0.0, 0.0)])
    with pytest.raises(BadPacketError, match="out of range"):
        unpack_state(packet, REACHES)


@given(st.integers(0, 2**32 - 1), st.integers(1, 2**31 - 1))
def test_a_sequence_number_wraps(last: int, ahead: int) -> None:
    assert newer((last + ahead) % 2**32, last)
    assert not newer(last, (last + ahead) % 2**32)
    assert not newer(last, last)
