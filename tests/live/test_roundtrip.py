"""The round trip on the wire: what counts as an answer, and when it came."""

from __future__ import annotations

import socket
import time

import pytest

from coupled.api.rigs import load_rig
from coupled.live.clients.loader import Loader
from coupled.live.link import RUN, Order
from coupled.live.roundtrip import KEPT, RoundTrips, ask_for_stamps, receive
from coupled.live.udp import UdpLink

MS_ns = 1_000_000


def test_an_answer_is_timed_from_its_own_order_and_once() -> None:
    trips = RoundTrips()
    assert trips.as_dict() is None
    assert str(trips) == "no order was answered"
    for sequence in range(1, 6):
        trips.record_order(sequence, 10 * sequence * MS_ns)
    for echo, at_ms in ((1, 11.0), (3, 34.0), (2, 43.0), (3, 90.0), (9, 99.0), (5, 49.0)):
        trips.record_answer(echo, int(at_ms * MS_ns))  # 3 again, 9 never sent, 5 ahead of its order
    # 1, 4 and 23 ms
    figures = {"answers": 3, "p50_ms": 4.0, "p99_ms": 22.62, "largest_ms": 23.0, "stamped": False}
    assert trips.as_dict() == pytest.approx(figures)
    last = trips.as_dict(1)
    assert last is not None
    assert (last["answers"], last["p50_ms"]) == (1, 23.0)
    assert "p50 4.000 ms" in str(trips)
    assert "wait for its next frame" in str(trips)


def test_orders_that_nobody_answers_are_forgotten() -> None:
    trips = RoundTrips()
    for sequence in range(KEPT + 1):
        trips.record_order(sequence, 0)
    trips.record_answer(0, MS_ns)
    assert trips.as_dict() is None
    trips.record_answer(1, MS_ns)
    assert trips.as_dict() is not None


def test_a_stamp_is_of_the_time_at_which_a_packet_came() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", 0))
        if not ask_for_stamps(wire):
            pytest.skip("this system stamps no packets")
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            for _ in range(2):  # the system may begin to stamp a packet late
                before = time.time_ns()
                other.sendto(b"x", wire.getsockname())
                after = time.time_ns()
                time.sleep(0.02)
                packet, _, came = receive(wire, 16, stamped=True)
    assert packet == b"x"
    assert before <= came <= after


@pytest.mark.parametrize("stamped", [True, False])
def test_a_loader_s_round_trip_ends_when_its_answer_comes(stamped: bool) -> None:
    """The loader answers, and 20 ms later the host looks: a stamp does not count the wait."""
    loader = Loader(0)
    link = UdpLink("127.0.0.1", loader.port, load_rig("report-column"))
    trips = link.round_trips
    if stamped and not trips.stamped:
        pytest.skip("this system stamps no packets")
    trips.stamped = stamped
    took_ms = []
    for sent in (1, 2, 3):
        begun = time.time_ns()
        link.send((Order(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),), RUN)
        assert loader.step(lambda: [(0.0, 0.0, 0.0)], lambda orders: None)
        answered = time.time_ns()
        time.sleep(0.02)
        assert link.receive(1.0) is not None
        took_ms.append(1e-6 * (answered - begun))
        found = trips.as_dict()
        assert found is not None
        assert found["answers"] == sent
    last = trips.as_dict(1)
    assert last is not None
    assert (last["p50_ms"] <= took_ms[-1] + 1e-3) is stamped
    link.close()
    loader.close()
