"""The memory that host and page share, and the messages that the page accepts."""

from __future__ import annotations

import json

import numpy as np
import pytest

from coupled.live.dashboard.board import ROWS, Board, STATE_bytes, columns, shared_memory


def test_rows_come_in_order_and_once() -> None:
    memory = shared_memory()
    host, page = Board(memory), Board(memory)
    width, count = columns(1), 0
    seen: list[float] = []
    for k in range(3 * ROWS):
        host.write(np.full(width, float(k)))
        if k % 100 == 99:
            count, rows = page.rows(count, width)
            seen += rows[:, 0].tolist()
    count, rows = page.rows(count, width)
    assert seen + rows[:, 0].tolist() == list(range(3 * ROWS))


def test_a_late_viewer_gets_the_last_rows() -> None:
    memory = shared_memory()
    host = Board(memory)
    for k in range(2 * ROWS):
        host.write(np.array([float(k)]))
    count, rows = Board(memory).rows(0, 1)
    assert count == 2 * ROWS
    assert rows[:, 0].tolist() == list(range(2 * ROWS - ROWS // 2, 2 * ROWS))


def test_a_state_is_read_once_and_complete() -> None:
    memory = shared_memory()
    host, page = Board(memory), Board(memory)
    assert page.state(0) == (0, "")
    host.write_state({"phase": "flying"})
    seen, text = page.state(0)
    assert json.loads(text) == {"phase": "flying"}
    assert page.state(seen) == (seen, "")
    host.write_state({"long": "x" * STATE_bytes})  # left out
    assert page.state(seen) == (seen, "")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{",
        "[" * 5000,
        '{"what": "rm"}',
        '{"what": "set", "value": "1"}',
        '{"what": "set", "value": NaN}',
        '{"what": "set", "value": 1e999}',
        '{"what": "mark", "text": 3}',
        json.dumps({"what": "hand", "value": 10**400}),
        json.dumps({"what": "mark", "text": "x" * 201}),
    ],
)
def test_an_invalid_message_of_the_page_is_dropped(text: str) -> None:
    server = pytest.importorskip("coupled.live.dashboard.server")
    assert server.request_of(text) is None


def test_a_valid_message_of_the_page_is_accepted() -> None:
    server = pytest.importorskip("coupled.live.dashboard.server")
    word = server.request_of('{"what": "set", "control": "column", "text": "bend", "value": 1e-4}')
    assert word == {"what": "set", "control": "column", "text": "bend", "value": 1e-4}
