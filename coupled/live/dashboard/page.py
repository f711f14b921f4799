"""The host's side of the page: it shows each frame, and receives the user's requests."""

from __future__ import annotations

import contextlib
import importlib
import json
import multiprocessing
import secrets
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.live.dashboard.board import FLIGHT, Board, columns, shared_memory
from coupled.live.host import Host, Request
from coupled.live.roundtrip import RECENT
from coupled.record.channels import (
    ALTITUDE,
    HEADING,
    LOAD,
    PITCH,
    PRESSURE,
    ROLL,
    SPEED,
    channel,
    control_channels,
)

STATE_EVERY_s = 0.2
START_s = 30.0  # time limit for the start of the page's process
MOST_WORDS = 64  # requests taken in a frame, each some 10 µs
SHOWN = ("force", "computed", "deflection", "estimate", "gradient", "modifying_force")


class Page:
    """The page of one flight: a watcher of the host, and a source of hand positions.

    `address` and `port` are those of the server, 0 for a free port; `controls` those of the rig.
    Raises InputError if it cannot be served.
    """

    name = "page"

    def __init__(self, controls: Sequence[str], address: str = "127.0.0.1", port: int = 0) -> None:
        memory = shared_memory()
        self.board_memory = Board(memory)
        context = multiprocessing.get_context("spawn")
        self._wire, other = context.Pipe()
        self._width = columns(len(controls))
        token = secrets.token_urlsafe(16)
        words = (address, port, token, memory, other, self._width)
        self._process = context.Process(target=_run, args=words, daemon=True)
        self._process.start()
        other.close()
        self.url = self._answer(f"{address}:{port}")
        self._wanted = dict.fromkeys(controls, 0.0)
        self._state: dict[str, Any] = {"phase": "starting", "warnings": []}
        self._due_s = 0.0
        self.gone = False

    def _answer(self, place: str) -> str:
        answer: dict[str, str] = {}
        with contextlib.suppress(EOFError, OSError):
            if self._wire.poll(START_s):
                answer = json.loads(self._wire.recv_bytes())
        if "url" not in answer:
            raise InputError("--dashboard", place, answer.get("problem", "does not start"))
        return answer["url"]

    def begin(self, host: Host) -> None:
        """Start: write the constants of the flight."""
        assert host.access is not None
        access, rig = host.access, host.access.manoeuvre.rig
        at = access.channels.index
        first = at(control_channels(host.names[-1])[-1]) + 1
        self._lateral = len(access.channels) - first > HEADING
        self._flown = rig.flight is not None
        self._motion = first
        self._places = [at(channel(name, quantity)) for name in host.names for quantity in SHOWN]
        self._row = np.zeros(self._width)
        setup = {
            "run": access.manoeuvre.name,
            "frame_s": host.frame_s,
            "loader": "sim" if host.plan.link is None else host.plan.link.name,
            "hand": host.plan.hand_positions.name if host.plan.hand_positions is not None else "",
            "flown": self._flown,
            "controls": [
                {
                    "name": str(name),
                    "unit": "rad" if name == "wheel" else "m",
                    "travel": control.travel,
                    "pressure_Pa": control.schedule.dynamic_pressure,
                    "gradient": control.schedule.total_gradient,
                }
                for name, control in rig.controls.items()
            ],
        }
        self._state |= {"phase": "flying", "setup": setup}
        self._show(host)

    def observe(self, host: Host, k: int) -> None:
        """Write frame k to the shared memory."""
        assert host.access is not None
        data, row, m = host.access.data[k], self._row, self._motion
        row[0], row[1], row[2] = k, 1e3 * host.pacer.late_s, data[m + PRESSURE]
        if self._flown:
            row[4], row[6], row[7] = data[m + PITCH], data[m + ALTITUDE], data[m + SPEED]
            row[8] = data[m + LOAD]
            if self._lateral:
                row[3], row[5] = data[m + ROLL], data[m + HEADING]
        row[len(FLIGHT) :] = data[self._places]
        self.board_memory.write(row)
        if host.time_s >= self._due_s:
            self._due_s = host.time_s + STATE_EVERY_s
            self._show(host)

    def _show(self, host: Host) -> None:
        """Write the current state."""
        attached, link = host.attached, host.plan.link
        trips = None if link is None else link.round_trips
        self._state |= {
            "time_s": host.time_s,
            "lateness": host.pacer.recent() if host.plan.paced else None,
            "lost": attached is not None and attached.lost,
            "dropped": 0 if link is None else sum(link.dropped.values()),
            "round_trip": None if trips is None else trips.as_dict(RECENT),
            "switches": {name: host.switches.values(name) for name in host.names},
            "service": {name: one.now.as_dict() for name, one in host.service.items()},
            "calibrated": {name: one.calibrated for name, one in host.service.items()},
            "adapt": host.plan.adapt,
            "services": host.services(),
            "happened": {key: value[-8:] for key, value in vars(host.events).items()},
        }
        self.board_memory.write_state(self._state)

    def warn(self, text: str) -> None:
        """Show a warning."""
        self._state["warnings"] = [*self._state["warnings"][-4:], text]

    def requests(self) -> Sequence[Request]:
        """Return the requests since the last call; if the page has closed, hands return to 0.

        Of positions of a hand the last one counts. At most one other request is returned, since
        changing a switch takes a part of the frame.
        """
        found: list[Request] = []
        try:
            for _ in range(MOST_WORDS):
                if self.gone or found or not self._wire.poll():
                    break
                word = json.loads(self._wire.recv_bytes())
                if word["what"] == "hand":
                    if word["control"] in self._wanted:
                        self._wanted[word["control"]] = word["value"]
                else:
                    found.append(Request(**word))
        except (EOFError, OSError):
            self.gone = True
            self._wanted = dict.fromkeys(self._wanted, 0.0)
            self.warn("the page was closed; the flight continues")
        return found

    def read(self, control: str) -> float:
        """Return the position that the user gives a control, −1 to 1."""
        return self._wanted[control]

    def close(self) -> None:
        """Keep the page open at the end of the flight, for the results."""

    def finish(self, **state: Any) -> None:
        """Show the results of the flight: `phase`, `record`, `diagnosis`."""
        self._state |= state
        self.board_memory.write_state(self._state)

    def wait(self, until: Callable[[], bool] = lambda: False) -> None:
        """Wait until the user leaves the page or `until` is true."""
        while not self.gone and self._process.is_alive() and not until():
            if self._wire.poll(0.2) and any(word.what == "leave" for word in self.requests()):
                return

    def end(self) -> None:
        """End the page's process."""
        with contextlib.suppress(OSError):
            self._wire.close()
        self._process.join(3.0)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _run(*words: Any) -> None:
    """Run the page's process; the server is imported only there."""
    importlib.import_module("coupled.live.dashboard.server").serve(*words)
