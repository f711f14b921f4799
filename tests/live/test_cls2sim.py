"""Brunner's remote control, as far as it is published: bytes, refusals, and flights with a fake."""

from __future__ import annotations

import socket
import struct

import numpy as np
import pytest

from coupled.api.gaps import diagnose
from coupled.api.rigs import load_rig
from coupled.errors import InputError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.attach import open_link
from coupled.live.hands import LiveHand
from coupled.live.host import Plan
from coupled.live.link import RUN, Order
from coupled.live.session import fly_live
from coupled.record.record import Record
from tests.support.loaders import fake_loader

RIG = load_rig("report-column")
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
def test_what_no_source_gives_has_to_be_said(words: str, said: str) -> None:
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
    record = fly_with(kind, words, 20.0, hand=30.0)
    assert len(record) == 2400
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
def test_what_the_rig_file_lacks_is_named() -> None:
    record = fly_with("v2", V2, 60.0, hand=30.0, damping=110.0)
    found = diagnose(RIG, record)
    assert [one.name for one in found.effects] == ["viscous_damping"]
    assert found.effects[0].value == pytest.approx(110.0 / 75.0, rel=0.02)
