"""Memory shared by host and page: the last rows of the flight, and the state as JSON.

The host never waits. The rows are in a ring buffer. The state is written between two counters, and
read again if it was written meanwhile.
"""

from __future__ import annotations

import json
import multiprocessing
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
ROWS = 4096  # of the ring buffer: 34 s at 120 Hz
STATE_bytes = 1 << 17
MOST_COLUMNS = 64
_HEAD = 4  # numbers: rows written, the state's two counters, its length

# Of the flight, then of each control in the rig's order.
FLIGHT = (
    *("k", "late_ms", "pressure_Pa", "roll_rad", "pitch_rad", "heading_rad"),
    *("altitude_m", "airspeed_m_per_s", "load_factor"),
)
CONTROL = ("force_N", "computed", "deflection", "estimate", "gradient", "modifying_force_N")


def columns(controls: int) -> int:
    """Return the number of columns of a row."""
    return len(FLIGHT) + controls * len(CONTROL)


def shared_memory() -> Any:
    """Return the memory shared by host and page; it is passed to the page's process at start."""
    size = 8 * (_HEAD + ROWS * MOST_COLUMNS) + STATE_bytes
    return multiprocessing.get_context("spawn").RawArray("b", size)


class Board:
    """The shared memory, for either process."""

    def __init__(self, memory: Any) -> None:
        whole = np.frombuffer(memory, np.uint8)
        numbers = 8 * (_HEAD + ROWS * MOST_COLUMNS)
        self._head = whole[: 8 * _HEAD].view(np.int64)
        self._ring = whole[8 * _HEAD : numbers].view(np.float64).reshape(ROWS, MOST_COLUMNS)
        self._state = whole[numbers:]

    def write(self, row: Floats) -> None:
        """Add a row, of at most MOST_COLUMNS numbers."""
        count = int(self._head[0])
        self._ring[count % ROWS, : len(row)] = row
        self._head[0] = count + 1

    def rows(self, since: int, width: int) -> tuple[int, Floats]:
        """Return the number of rows written, and the rows since a count that still exist."""
        count = int(self._head[0])
        first = max(since, count - ROWS // 2)  # the older half may be overwritten meanwhile
        places = np.arange(first, count) % ROWS
        return count, self._ring[places, :width]

    def write_state(self, state: dict[str, Any]) -> None:
        """Write the state; a state that is too long is skipped."""
        text = json.dumps(state).encode()
        if len(text) > STATE_bytes:
            return
        self._head[1] += 1
        self._state[: len(text)] = np.frombuffer(text, np.uint8)
        self._head[3] = len(text)
        self._head[2] = self._head[1]

    def state(self, seen: int) -> tuple[int, str]:
        """Return the state's counter and JSON; an empty text if the state was seen before."""
        for _ in range(10):
            done = int(self._head[2])
            if done == seen:
                return seen, ""
            text = self._state[: int(self._head[3])].tobytes()
            if int(self._head[1]) == done:
                return done, text.decode()
        return seen, ""
