"""Requests of the page are limited, so that no browser takes time from the flight."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from typing import Any
from urllib.parse import urlsplit

import pytest

from coupled.flight.runfile import read_run
from coupled.live.dashboard.page import Page
from coupled.live.host import Host, Plan, Request, SAVE_EVERY_s
from coupled.live.session import fly_live
from coupled.record.record import Record

server = pytest.importorskip("coupled.live.dashboard.server")
client = pytest.importorskip("websockets.sync.client")
exceptions = pytest.importorskip("websockets.exceptions")


@pytest.fixture
def page() -> Iterator[Any]:
    made = Page(["column"])
    yield made
    made.end()


def place(page: Any) -> tuple[str, int]:
    return "127.0.0.1", urlsplit(page.url).port or 0


def connected(page: Any) -> Any:
    parts = urlsplit(page.url)
    return client.connect(f"ws://{parts.netloc}/ws?{parts.query}", origin=f"http://{parts.netloc}")


def closed(wire: socket.socket, within_s: float) -> bool:
    """Tell whether the other end closes a connection within a time."""
    wire.settimeout(within_s)
    try:
        return wire.recv(1) == b""
    except TimeoutError:
        return False
    except ConnectionError:
        return True


@pytest.mark.slow
def test_connections_are_bounded_and_a_slow_one_is_not_waited_for(page: Any) -> None:
    wires = [socket.create_connection(place(page)) for _ in range(server.MOST_CONNECTIONS + 30)]
    for wire in wires:
        wire.send(b"GET / HTTP/1.1\r\nHost: 127")  # and no more
    try:
        late = [wire for wire in wires if closed(wire, 0.02)]
        assert len(late) >= 30
        time.sleep(server.REQUEST_s)
        assert all(closed(wire, 2.0) for wire in wires if wire not in late)
    finally:
        for wire in wires:
            wire.close()
    with connected(page) as viewer:  # a viewer is let in again
        viewer.send('{"what": "mark"}')


@pytest.mark.slow
def test_a_ninth_viewer_is_refused(page: Any) -> None:
    with ExitStack() as viewers:
        for _ in range(server.MOST_VIEWERS):
            viewers.enter_context(connected(page))
        with pytest.raises(exceptions.InvalidStatus), connected(page):
            pass


@pytest.mark.slow
def test_a_viewer_that_sends_too_many_requests_is_disconnected(page: Any) -> None:
    with connected(page) as viewer, pytest.raises(exceptions.ConnectionClosed):
        for _ in range(400):
            viewer.send('{"what": "save"}')
        while True:
            viewer.recv(timeout=5.0)
    words = page.requests()
    quiet = time.monotonic() + 0.5
    while time.monotonic() < quiet:
        if more := page.requests():
            words += more
            quiet = time.monotonic() + 0.5
        time.sleep(0.01)
    assert server.MOST_WORDS <= len(words) <= server.MOST_WORDS + 15


@pytest.mark.slow
def test_the_last_of_many_hand_positions_counts(page: Any) -> None:
    with connected(page) as viewer:
        for n in range(2000):
            viewer.send(f'{{"what": "hand", "control": "column", "value": {n / 2000}}}')
        deadline = time.monotonic() + 5.0
        while page.read("column") != 1999 / 2000 and time.monotonic() < deadline:
            page.requests()
            time.sleep(0.005)
        assert page.read("column") == 1999 / 2000


def test_a_rate_limit_allows_more_requests_with_time() -> None:
    now = [100.0]
    allowance = server.Allowance(lambda: now[0])
    assert [allowance.take() for _ in range(server.MOST_WORDS + 1)][-2:] == [True, False]
    now[0] += 1.0
    assert sum(allowance.take() for _ in range(100)) == server.WORDS_per_s


class Saver:
    """A watcher that asks for a save at each frame."""

    def begin(self, host: Host) -> None:
        """Begin."""

    def observe(self, host: Host, k: int) -> None:
        """Do nothing."""

    def requests(self) -> list[Request]:
        """Ask."""
        return [Request("save")]

    def close(self) -> None:
        """End."""


def test_saves_run_one_at_a_time_and_at_most_once_an_interval() -> None:
    saved: list[int] = []
    together, most = threading.Lock(), [0]

    def save(record: Record) -> None:
        assert together.acquire(blocking=False)
        saved.append(len(record))
        together.release()
        most[0] += 1

    manoeuvre = read_run("capture")[0]
    seconds = manoeuvre.duration_s
    fly_live(manoeuvre, Plan(paced=False, watchers=[Saver()], save=save))
    assert 1 <= len(saved) <= 1 + seconds / SAVE_EVERY_s
