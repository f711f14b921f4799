"""Brunner's remote control, as far as it is published: bytes, refusals, and flights with a fake."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from coupled.api.gaps import diagnose
from coupled.api.rigs import load_rig
from coupled.errors import InputError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.attach import open_link
from coupled.live.cls2sim import FORCES, POSITIONS
from coupled.live.hands import LiveHand
from coupled.live.host import Plan
from coupled.live.link import RUN, Link, Order
from coupled.live.session import fly_live
from coupled.record.record import Record
from tests.support.loaders import fake_loader

RIG = load_rig("report-column")
TURNED = "counts_per_N=10&turn=column"
V2 = "protocol=v2&counts_per_N=100&profile_N_per_d=1000&scale=100"


def fly_with(kind: str, words: str, seconds: float, **numbers: float) -> Record:
    with fake_loader(kind, **numbers) as (port, _):
        url = f"cls2sim://127.0.0.1:{port}?{words}"
        link = open_link(url, RIG, lockstep=True, deflection=False)
        manoeuvre = Manoeuvre(RIG, {"column": LiveHand()}, seconds)
        return fly_live(manoeuvre, Plan(paced=False, link=link)).record


def test_external_control_has_the_published_bytes() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(2.0)
        url = f"cls2sim://127.0.0.1:{server.getsockname()[1]}?counts_per_N=10"
        link = open_link(url, RIG, lockstep=True, deflection=False)
        assert link is not None
        link.send((Order(0.0, 0.0, 0.0, 0.0, 12.34, 0.0, 0.0),), RUN)
        request, host = server.recvfrom(64)
        assert request == bytes([0xAF, 0, 0, 0]) + struct.pack("<4i", -123, 0, 0, 0)
        server.sendto(b"\xaf\0\0\0" + struct.pack("<4f", 0.75, 0.5, 0.5, 0.5), host)
        sample = link.receive(1.0)
        assert sample is not None
        assert sample.controls[0].computed == 0.5 * RIG.controls["column"].travel
        for bad in (b"\xae\0\0\0" + bytes(16), bytes(19), b"\xaf\0\0\0" + b"\xff" * 16):
            server.sendto(bad, host)
        assert link.receive(0.2) is None
        reasons = {"another command": 1, "wrong length": 1, "not a number": 1}
        assert link.dropped == reasons
        link.close()


@contextmanager
def external(words: str) -> Iterator[tuple[Link, Callable[[bytes], None], socket.socket]]:
    """Yield a link of external control, what answers it, and the server's socket."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as server:
        server.bind(("127.0.0.1", 0))
        server.settimeout(2.0)
        url = f"cls2sim://127.0.0.1:{server.getsockname()[1]}?{words}"
        link = open_link(url, RIG, lockstep=True, deflection=False)
        assert link is not None
        link.send((Order(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),), RUN)
        _, host = server.recvfrom(64)
        yield link, lambda packet: void(server.sendto(packet, host)), server
        link.close()


def void(_: object) -> None:
    """Return nothing."""


@pytest.mark.parametrize(("words", "share"), [("counts_per_N=10", 0.75), (TURNED, 0.25)])
def test_the_load_of_a_turned_axis_pushes_back_too(words: str, share: float) -> None:
    with external(words) as (link, answer, server):
        answer(POSITIONS.pack(0xAF, share, 0.5, 0.5, 0.5))
        sample = link.receive(1.0)
        assert sample is not None
        assert sample.controls[0].computed == 0.5 * RIG.controls["column"].travel
        link.send((Order(0.0, 0.0, 0.0, 0.0, 12.34, 0.0, 0.0),), RUN)
        load = FORCES.unpack(server.recv(64))[1]
        assert abs(load) == 123
        assert load * (share - 0.5) < 0.0  # in the loader's own direction


def test_empty_datagrams_hold_up_no_position_and_are_counted() -> None:
    with external("counts_per_N=10") as (link, answer, _):
        for n in range(40):
            answer(b"")
            answer(POSITIONS.pack(0xAF, 0.5 + 0.005 * n, 0.5, 0.5, 0.5))
        answer(b"")
        time.sleep(0.05)
        sample = link.receive(0.0)
        assert sample is not None
        newest = (2.0 * np.float32(0.5 + 0.005 * 39) - 1.0) * RIG.controls["column"].travel
        assert sample.controls[0].computed == pytest.approx(newest, rel=1e-6)
        assert link.dropped == {"wrong length": 41}
        assert link.receive(0.0) is None


@contextmanager
def version2(words: str) -> Iterator[tuple[Link, socket.socket]]:
    """Yield a link of protocol v2 and the other end of its stream, past the first request."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as door:
        door.bind(("127.0.0.1", 0))
        door.listen(1)
        url = f"cls2sim://127.0.0.1:{door.getsockname()[1]}?{words}"
        link = open_link(url, RIG, lockstep=True, deflection=False)
        assert link is not None
        wire, _ = door.accept()
    with wire:
        wire.settimeout(2.0)
        assert len(wire.recv(64)) == 12
        wire.sendall(struct.pack("<HB", 3, 0))
        assert link.receive(0.05) is None  # what is answered is no sample
        yield link, wire
        link.close()


def asked(link: Link, wire: socket.socket, gradient: float, force: int, share: float) -> int:
    """Order a gradient ΔG in N/m, answer with force in counts and position; return the scale."""
    link.send((Order(gradient, gradient, 0.0, 0.0, 0.0, 0.0, 0.0),), RUN)
    request = wire.recv(256)
    assert len(request) == 14 + 2 * 12
    wire.sendall(struct.pack("<HB", 3, 0) + struct.pack("<HBHi", 9, 0, 1, force))
    wire.sendall(struct.pack("<HBHf", 9, 0, 1, share))
    return int(struct.unpack_from("<3iH", request)[3])


@pytest.mark.parametrize(("turn", "sign"), [("", 1), ("&turn=column", -1)])
def test_v2_turns_force_and_position_alike(turn: str, sign: int) -> None:
    with version2(V2 + turn) as (link, wire):
        asked(link, wire, 0.0, 1500 * sign, 0.5 * sign)
        sample = link.receive(1.0)
        assert sample is not None
        assert sample.controls[0].force == 15.0
        assert sample.controls[0].computed == 0.5 * RIG.controls["column"].travel


def test_v2_scales_the_profile_to_the_whole_gradient_within_its_range() -> None:
    basic = RIG.controls["column"].loader.basic_gradient
    for gradient, scale in ((4000.0 - basic, 400), (50e3 - basic, 999), (-basic, 20)):
        with version2(V2) as (link, wire):
            assert asked(link, wire, gradient, 0, 0.0) == scale


def test_v2_takes_a_late_answer_for_what_it_answers() -> None:
    with version2(V2) as (link, wire):
        asked(link, wire, 500.0, 1500, 0.25)
        assert link.receive(1.0) is not None
        order = (Order(500.0, 500.0, 0.0, 0.0, 0.0, 0.0, 0.0),)
        link.send(order, RUN)
        assert len(wire.recv(256)) == 2 * 12
        time.sleep(0.15)  # the loader pauses for longer than the watchdog's time
        link.send(order, RUN)
        wire.sendall(struct.pack("<HBHi", 9, 0, 1, -700))
        assert link.receive(0.05) is None
        link.send(order, RUN)
        wire.sendall(struct.pack("<HBHf", 9, 0, 1, 0.5))
        sample = link.receive(1.0)
        assert sample is not None
        assert sample.controls[0].force == -7.0
        assert sample.controls[0].computed == 0.5 * RIG.controls["column"].travel


@pytest.mark.parametrize(
    "damage", [lambda b: b"\0" + b, lambda b: b[:-3], lambda b: b[4:]], ids=["more", "cut", "less"]
)
def test_v2_takes_no_number_from_a_stream_out_of_step_and_finds_its_step_again(
    damage: Callable[[bytes], bytes],
) -> None:
    """Bytes too many or too few made forces of 2,500 N of the bytes of places, or lost the link."""
    with version2(V2) as (link, wire):
        asked(link, wire, 500.0, 1500, 0.25)
        assert link.receive(1.0) is not None
        order = (Order(500.0, 500.0, 0.0, 0.0, 0.0, 0.0, 0.0),)
        both = struct.pack("<HBHi", 9, 0, 1, -700) + struct.pack("<HBHf", 9, 0, 1, 0.5)
        for answer in (damage(both), both):
            link.send(order, RUN)
            assert len(wire.recv(256)) == 2 * 12
            wire.sendall(answer)
            sample = link.receive(0.1)
            if answer is both:
                break
            assert sample is None
            time.sleep(0.6)  # longer than the silence
            assert link.receive(0.05) is None
        assert sample is not None
        assert sample.controls[0].force == -7.0
        assert sample.controls[0].computed == 0.5 * RIG.controls["column"].travel


def test_v2_repeats_no_number_where_a_request_is_refused() -> None:
    with version2(V2) as (link, wire):
        asked(link, wire, 500.0, 1500, 0.25)
        assert link.receive(1.0) is not None
        link.send((Order(500.0, 500.0, 0.0, 0.0, 0.0, 0.0, 0.0),), RUN)
        wire.recv(256)
        wire.sendall(struct.pack("<HB", 3, 7) + struct.pack("<HBHf", 9, 0, 1, 0.5))
        assert link.receive(0.2) is None
        assert link.dropped == {"status 7": 1}


@pytest.mark.parametrize("share", [1.1, -1.1, 2.9])
def test_v2_drops_a_position_beyond_its_range(share: float) -> None:
    with version2(V2) as (link, wire):
        asked(link, wire, 0.0, 0, share)
        assert link.receive(0.2) is None
        assert sum(link.dropped.values()) == 1


def test_a_stream_that_its_loader_closed_is_waited_for_and_not_read_in_a_rush() -> None:
    with version2(V2) as (link, wire):
        wire.close()
        begun = time.monotonic()
        assert link.receive(0.2) is None
        assert time.monotonic() - begun >= 0.2


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "no source gives the unit of a force"),
        ("counts_per_N=0", "other than 0"),
        ("counts_per_N=nan", "other than 0"),
        ("protocol=v1&counts_per_N=1", "protocol"),
        ("protocol=v2&counts_per_N=1", "profile"),
        ("protocol=v2&counts_per_N=1&profile_N_per_d=9", "scale"),
        (V2 + "&transport=udp", "give tcp"),
        ("counts_per_N=1&turn=wheel", "no control"),
        ("counts=1", "counts_per_N"),
    ],
)
def test_a_value_that_no_source_gives_is_required(words: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        open_link(f"cls2sim://127.0.0.1:9?{words}", RIG, lockstep=True, deflection=False)


def test_v2_has_no_bit_for_pedals_that_a_source_gives() -> None:
    with pytest.raises(InputError, match="rudder's bit"):
        open_link(f"cls2sim://127.0.0.1:9?{V2}", load_rig("t37"), lockstep=True, deflection=False)


@pytest.mark.slow
def test_a_loader_far_from_neutral_gets_no_force() -> None:
    with pytest.raises(InputError, match="let it rest at neutral"):
        fly_with("cls2sim", "counts_per_N=100", 1.0, rests=0.4)


@pytest.mark.parametrize(
    ("kind", "words"),
    [pytest.param("cls2sim", "counts_per_N=100", marks=pytest.mark.slow), ("v2", V2)],
)
def test_a_fake_is_flown_and_feels_as_specified(kind: str, words: str) -> None:
    record = fly_with(kind, words, 10.0, hand=30.0)
    assert len(record) == 1200
    assert record.manifest["live"]["dropped_packets"] == {}
    assert ("column_force_N" in record) == (kind == "v2")
    assert "column_deflection_m" not in record
    moved = np.abs(record["column_computed_m"]).max()
    softest = 30.0 * (1.0 / 2189.1 - RIG.controls["column"].loader.bend)  # F = G·δ, less the bend
    assert moved == pytest.approx(softest, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "words"), [("cls2sim", "counts_per_N=100"), ("v2", V2)])
def test_a_minute_with_a_healthy_fake_has_no_gap(kind: str, words: str) -> None:
    record = fly_with(kind, words, 60.0, hand=30.0)
    assert diagnose(RIG, record).verdict == "no_gap"


@pytest.mark.slow
def test_a_key_that_the_rig_file_lacks_is_named() -> None:
    record = fly_with("v2", V2, 60.0, hand=30.0, damping=110.0)
    found = diagnose(RIG, record)
    assert [one.name for one in found.effects] == ["viscous_damping"]
    assert found.effects[0].value == pytest.approx(110.0 / 75.0, rel=0.02)
