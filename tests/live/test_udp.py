"""The open protocol over loopback: what gets through, and what becomes of a loader that is lost."""

from __future__ import annotations

import math
import shutil
import socket
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from coupled.api.gaps import diagnose
from coupled.api.rigs import load_rig
from coupled.errors import InputError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live import attached
from coupled.live.attach import open_link
from coupled.live.clients.loader import Block, Loader
from coupled.live.hands import LiveHand
from coupled.live.host import Plan
from coupled.live.link import OFF, RUN, Measured, Order, WATCHDOG_s
from coupled.live.session import LiveFlight, fly_live
from coupled.live.udp import UdpLink
from coupled.live.wire import STATE, Header, pack_state
from tests.support.loaders import fake_loader

RIG = load_rig("report-column")
ORDERS = (Order(1000.0, 1000.0, 0.0, 0.0, 5.0, 1560.4, 0.0),)
CLIENTS = Path(attached.__file__).parent / "clients"


def fly_with(port: int, seconds: float, lockstep: bool = True) -> LiveFlight:
    link = UdpLink("127.0.0.1", port, RIG, lockstep=lockstep)
    manoeuvre = Manoeuvre(RIG, {"column": LiveHand()}, seconds)
    return fly_live(manoeuvre, Plan(paced=not lockstep, link=link))


class Pair:
    """A host's link and a loader's socket by hand."""

    def __init__(self) -> None:
        self.wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.wire.bind(("127.0.0.1", 0))
        self.wire.settimeout(2.0)
        self.link = UdpLink("127.0.0.1", self.wire.getsockname()[1], RIG)
        self.link.send(ORDERS, RUN)
        packet, self.host = self.wire.recvfrom(512)
        self.session = int.from_bytes(packet[8:12], "little")

    def good(
        self, sequence: int, force: float = 1.0, session: int | None = None, echo: int = 1
    ) -> bytes:
        number = self.session if session is None else session
        header = Header(STATE, 1, RUN, number, sequence, echo, 0)
        return pack_state(header, [Measured(force, 0.01, 0.012)])

    def send(self, packet: bytes) -> None:
        self.wire.sendto(packet, self.host)

    def close(self) -> None:
        self.link.close()
        self.wire.close()


@pytest.fixture
def pair() -> Pair:
    return Pair()


def test_only_the_loader_s_newest_packet_counts(pair: Pair) -> None:
    for sequence, force in ((1, 1.0), (3, 3.0), (2, 2.0), (3, 9.0)):
        pair.send(pair.good(sequence, force))
    sample = pair.link.receive(1.0)
    assert sample is not None
    assert sample.controls[0].force == 3.0
    assert pair.link.dropped == {"replayed or late": 2}
    pair.close()


def test_a_foreign_packet_and_one_of_another_flight_are_dropped(pair: Pair) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.1", 0))
        stranger.sendto(pair.good(1), pair.host)
        pair.send(pair.good(1, session=pair.session ^ 1))
        assert pair.link.receive(0.2) is None
    assert pair.link.dropped == {"from elsewhere": 1, "of another flight": 1}
    pair.close()


def test_a_restarted_loader_is_accepted_after_the_watchdog_s_time(pair: Pair) -> None:
    pair.send(pair.good(5000, force=1.0))
    assert pair.link.receive(1.0) is not None
    pair.link.send(ORDERS, RUN)  # the second order
    pair.send(pair.good(1, force=2.0, echo=2))
    assert pair.link.receive(0.05) is None  # the old one may still be there
    time.sleep(WATCHDOG_s)
    for echo in (1, 0, 3):  # a repeated state, an older one, and one that answers no order yet
        pair.send(pair.good(2, force=7.0, echo=echo))
    assert pair.link.receive(0.05) is None
    pair.send(pair.good(3, force=2.0, echo=2))
    sample = pair.link.receive(1.0)
    assert sample is not None
    assert sample.controls[0].force == 2.0
    pair.send(pair.good(4, force=3.0, echo=2))  # its numbers count from now on
    later = pair.link.receive(1.0)
    assert later is not None
    assert later.controls[0].force == 3.0
    assert pair.link.dropped == {"replayed or late": 4}
    pair.close()


def test_a_loader_of_which_no_packet_can_be_used_is_told_why(
    pair: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attached, "ANSWER_s", 0.2)
    pair.send(pair.good(1, force=math.nan))
    manoeuvre = Manoeuvre(RIG, {"column": LiveHand()}, 1.0)
    with pytest.raises(InputError, match=r"no packet that can be used.*\(not a number\)"):
        fly_live(manoeuvre, Plan(link=pair.link))
    pair.close()


def bad_packets(pair: Pair, count: int) -> list[bytes]:
    """Return packets none of which may be used: noise, damage, replays, numbers out of range."""
    random = np.random.default_rng(3)
    found = []
    for n in range(count):
        good = bytearray(pair.good(n + 10))
        kind = n % 5
        if kind == 0:
            found.append(random.bytes(int(random.integers(0, 200))))
        elif kind == 1:
            good[int(random.integers(len(good)))] ^= 1 << int(random.integers(8))
            found.append(bytes(good))
        elif kind == 2:
            found.append(bytes(good[: int(random.integers(len(good)))]))
        elif kind == 3:
            found.append(pair.good(1, force=77.0))  # a replay, once 1 has been seen
        else:
            force = (math.nan, math.inf, -math.inf, 1e9, -2501.0)[n // 5 % 5]
            found.append(pair.good(n + 10, force))
    return found


def flood(pair: Pair, count: int) -> None:
    pair.send(pair.good(1))
    assert pair.link.receive(1.0) is not None
    for sent, packet in enumerate(bad_packets(pair, count)):
        pair.send(packet)
        if sent % 32 == 0:  # no more than the system holds
            assert pair.link.receive(0.0) is None
    deadline = time.monotonic() + 5.0
    while sum(pair.link.dropped.values()) < count and time.monotonic() < deadline:
        assert pair.link.receive(0.01) is None
    assert sum(pair.link.dropped.values()) == count
    pair.send(pair.good(2 * count + 100, force=4.0))
    sample = pair.link.receive(1.0)
    assert sample is not None
    assert sample.controls[0].force == 4.0
    pair.close()


def test_a_thousand_bad_packets_are_all_dropped(pair: Pair) -> None:
    flood(pair, 1000)


@pytest.mark.slow
def test_a_hundred_thousand_bad_packets_are_all_dropped(pair: Pair) -> None:
    flood(pair, 100_000)


def test_a_loader_outputs_no_force_when_the_host_is_silent() -> None:
    loader = Loader(0)
    acted: list[Sequence[Block]] = []
    link = UdpLink("127.0.0.1", loader.port, RIG)
    link.send(ORDERS, RUN)
    assert loader.step(lambda: [(0.0, 0.0, 0.0)], acted.append)
    assert acted[-1][0][0] == 1000.0
    link.send((Order(math.nan, *ORDERS[0][1:]),), RUN)
    loader.step(lambda: [(0.0, 0.0, 0.0)], acted.append, wait_s=0.05)
    assert acted[-1][0][0] == 1000.0  # what is no number changes nothing
    assert loader.dropped == 1
    loader.step(lambda: [(0.0, 0.0, 0.0)], acted.append, wait_s=0.12)
    assert set(acted[-1][0]) == {0.0}
    link.send(ORDERS, OFF)
    assert loader.step(lambda: [(0.0, 0.0, 0.0)], acted.append)
    assert set(acted[-1][0]) == {0.0}
    link.close()
    loader.close()


@pytest.mark.slow
def test_a_loader_in_another_process_is_flown_and_its_k_found() -> None:
    with fake_loader("udp") as (port, _):
        record = fly_with(port, 12.0).record
    assert len(record) == 1440
    live = record.manifest["live"]
    # A state that answers an order before the newest is passed over: seen on a busy machine.
    assert set(live["dropped_packets"]) <= {"answers older orders"}
    assert (live["spells"], live["limited_frames"]) == ([], 0)
    assert live["round_trip"]["answers"] >= 1440  # those of the frames, and of the forces' coming
    found, bend = live["bend_in_service"]["column"], RIG.controls["column"].loader.bend
    assert found["bend"] == pytest.approx(bend, rel=0.01)
    assert not found["alarm"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "effect"), [({}, None), ({"play": 1e-3}, "backlash"), ({"bend": 1.3e-4}, "bend")]
)
def test_a_minute_with_a_loader_names_what_it_has(
    fault: dict[str, float], effect: str | None
) -> None:
    with fake_loader("udp", **fault) as (port, _):
        begun = time.monotonic()
        record = fly_with(port, 60.0).record
        assert time.monotonic() - begun < 60.0
    found = diagnose(RIG, record)
    assert [one.name for one in found.effects] == ([] if effect is None else [effect])
    assert found.verdict == ("no_gap" if effect is None else "effect")


@pytest.mark.slow
def test_a_loader_that_dies_leaves_a_complete_record_and_a_held_surface(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(attached, "GONE_s", 0.6)
    monkeypatch.setattr(attached, "WATCHDOG_s", 0.05)
    with fake_loader("udp", dies=3.5) as (port, process):
        flight = fly_with(port, 60.0)
        assert process.wait(5.0) == 9
    record, live = flight.record, flight.record.manifest["live"]
    ((gone, back),) = live["spells"]
    assert 3.4 < gone < 3.6
    assert back is None
    assert record.ended_early is not None
    assert "not answered" in record.ended_early.reason
    after = record.time_s > gone + 0.02
    assert np.ptp(record["column_surface_norm"][after]) == 0.0
    assert np.isfinite(record.data).all()
    assert not flight.stopped


def test_a_missing_loader_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attached, "ANSWER_s", 0.2)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as closed:
        closed.bind(("127.0.0.1", 0))
        port = closed.getsockname()[1]
    with pytest.raises(InputError, match="start the loader first"):
        fly_with(port, 1.0)


@pytest.mark.parametrize("url", ["udp://", "udp://h:0", "udp://h:x", "tcp://h:1", "here"])
def test_an_invalid_address_is_refused(url: str) -> None:
    with pytest.raises(InputError):
        open_link(url, RIG, lockstep=False, deflection=True)


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_the_client_in_c_compiles_without_a_warning_and_flies(tmp_path: Path) -> None:
    program = tmp_path / "loader"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1"]
    source = CLIENTS / "loader.c"
    subprocess.run(["cc", *flags, "-o", program, source, "-lm"], check=True, timeout=60)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with subprocess.Popen([program, str(port)], stdout=subprocess.DEVNULL) as process:
        try:
            record = fly_with(port, 6.0).record
        finally:
            process.kill()
    held = record.between(3.0, 6.0)
    ratio = held["column_force_N"].max() / held["column_deflection_m"].max()
    assert len(record) == 720
    assert ratio == pytest.approx(held["column_gradient_N_per_m"].mean(), rel=0.05)
