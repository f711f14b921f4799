"""A simulated loader in a separate process, by the twin: the open protocol, or CLS2Sim's.

    python -m tests.support.fakeloader udp PORT [NAME=VALUE …]

NAME is a number of the twin's (`play`, `bend`, …); `hand` is the force in N of its pilot, who
sweeps from 0.2 to 2.5 Hz; `noise` is the share of the usual noise. Prints `ready` and its port.
`dies` is the time in s at which it ends without a message.
"""

from __future__ import annotations

import math
import os
import socket
import struct
import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.api.rigs import load_rig
from coupled.blind.twin.kernel import NODES, STEPS
from coupled.blind.twin.mechanism import step_loader, step_servo, step_structure
from coupled.blind.twin.numbers import TWIN_STATE
from coupled.blind.twin.twin import nominal_twin
from coupled.live.clients.loader import RUN, Block, Loader
from coupled.rig.compiled import entry

Floats = NDArray[np.float64]
RIG = "report-column"
COUNTS = 100.0  # of CLS2Sim to a newton; the fake's own, since no source gives the real one
PROFILE_N_per_m, BASIC_N_per_m = 1000.0, 560.4
NOISE = (0.15, 2e-5, 2e-5)  # standard deviations of F, δc and δ


@entry
def advance(
    parameters: NDArray[np.void], state: NDArray[np.void], nodes: Floats, order: Floats
) -> float:
    """Run hand, loader, servo and structure over a frame; return the grip's deflection, m.

    `nodes` are the hand's force, shape (NODES + 1,), N; `order` the first four numbers of one.
    """
    p, s = parameters[0], state[0]
    s.first, s.second, s.break_at, s.preload = order[0], order[1], order[2], order[3]
    h = p.frame_s / STEPS
    for step in range(STEPS):
        at, before = (step + 0.5) * NODES / STEPS, s.x
        low = min(int(at), NODES - 1)
        pull = nodes[low] + (at - low) * (nodes[low + 1] - nodes[low])
        step_loader(p, s, pull, 0.0, h)
        step_servo(p, s, before, s.x, h)
        step_structure(p, s, pull, pull, h)
    return float(s.grip + p.bend * nodes[NODES])


class Twin:
    """The twin's loader with its pilot."""

    def __init__(self, given: dict[str, float]) -> None:
        self._hand, noise = given.pop("hand", 40.0), given.pop("noise", 1.0)
        rests = given.pop("rests", 0.0)
        self._dies = given.pop("dies", math.inf)
        rig = load_rig(RIG)
        twin = nominal_twin(rig)
        twin.set(**given)
        self._numbers, self._state = twin.numbers, np.zeros(1, TWIN_STATE)
        self._frame_s = 1.0 / rig.frame_rate
        self._noise, self._random = noise * np.array(NOISE), np.random.default_rng(7)
        self.frames = 0
        self._offset = 0.0
        self._force = self._grip = 0.0
        self.travel = rig.controls["column"].travel
        self._state["x"] = rests * self.travel
        advance(self._numbers, self._state.copy(), np.zeros(NODES + 1), np.zeros(4))

    def hand(self, t: Floats) -> Floats:
        """Return the pilot's force at times in s, N: an exponential sweep, from 2 s on."""
        u = np.clip((t - 2.0) / 50.0, 0.0, None)
        ratio = math.log(2.5 / 0.2)
        phase = 2.0 * math.pi * 0.2 * 50.0 * np.expm1(ratio * (u % 1.0)) / ratio
        return np.asarray(self._hand * np.sin(phase) * np.clip(10.0 * u, 0.0, 1.0))

    def run(self, order: Block) -> None:
        """Advance a frame under an order."""
        t = (self.frames + np.arange(NODES + 1) / NODES) * self._frame_s
        if t[0] >= self._dies:
            os._exit(9)
        force = self.hand(t)
        both = force + self._offset  # the motor's acts with the hand's, but bends nothing
        grip = advance(self._numbers, self._state, both, np.array(order[:4]))
        self._grip = grip - float(self._numbers["bend"][0]) * self._offset
        self._force = float(force[-1])
        self.frames += 1

    def bare(self) -> None:
        """Remove the loader's own spring and damping: the host computes the whole load."""
        self._numbers["basic_gradient"] = self._numbers["damping"] = 0.0

    def push(self, force_N: float) -> None:
        """Advance a frame under a constant force of the motor."""
        self._offset = force_N
        self.run((0.0, 0.0, 0.0, 0.0))

    def measured(self) -> tuple[float, float, float]:
        """Return F, δc and δ as measured."""
        true = np.array([self._force, self._state["x"][0], self._grip])
        f, c, d = true + self._noise * self._random.standard_normal(3)
        return float(f), float(c), float(d)


def serve_udp(port: int, twin: Twin) -> None:
    """Serve the open protocol; each order of the host advances the loader by a frame."""
    loader = Loader(port)
    print("ready", loader.port, flush=True)
    quiet = 0
    while quiet < 600:  # 60 s: a host may have to compile first

        def act(orders: Sequence[Block]) -> None:
            if loader.fresh and loader.mode == RUN:
                twin.run(orders[0])

        heard = loader.step(lambda: [twin.measured()], act)
        quiet = 0 if heard else quiet + 1


def serve_cls2sim(port: int, twin: Twin) -> None:
    """Serve CLS2Sim's external control over UDP, COUNTS per newton, one frame per request.

    The hardware has no spring: the host's force moves mass and damping, and it gives positions
    from 0 to 1.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wire:
        wire.bind(("127.0.0.1", port))
        wire.settimeout(60.0)
        print("ready", wire.getsockname()[1], flush=True)
        twin.bare()
        while True:
            try:
                packet, host = wire.recvfrom(512)
            except TimeoutError:
                return
            if len(packet) != 20:
                continue
            command, elevator, *_ = struct.unpack("<i4i", packet)
            if command == 0xAF:
                twin.push(elevator / COUNTS)
                share = 0.5 + 0.5 * twin.measured()[1] / twin.travel
                wire.sendto(struct.pack("<i4f", 0xAF, share, 0.5, 0.5, 0.5), host)


def serve_v2(port: int, twin: Twin) -> None:
    """Serve CLS2Sim's protocol v2 over TCP: force and position are read, the profile is scaled."""
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as door:
        door.bind(("127.0.0.1", port))
        door.listen(1)
        print("ready", door.getsockname()[1], flush=True)
        wire, _ = door.accept()
        wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    scale, asked = 100, b""
    while packet := wire.recv(4096):
        asked += packet
        while len(asked) >= 12:
            command, _, what = struct.unpack_from("<3I", asked)
            size = 14 if command == 0xCE else 12
            if len(asked) < size:
                break
            body, asked = asked[12:size], asked[size:]
            if command == 0xD0:
                if what == 0x20:  # the first of a frame's two questions
                    gradient = PROFILE_N_per_m * scale / 100.0 - BASIC_N_per_m
                    twin.run((gradient, gradient, 0.0, 0.0))
                    value = struct.pack("<i", round(COUNTS * twin.measured()[0]))
                else:
                    value = struct.pack("<f", twin.measured()[1] / twin.travel)
                wire.sendall(struct.pack("<HBH", 9, 0, 1) + value)
            else:
                if command == 0xCE:
                    (scale,) = struct.unpack("<H", body)
                wire.sendall(struct.pack("<HB", 3, 0))


def main() -> None:
    """Read the command line, and serve."""
    kind, port, *words = sys.argv[1:]
    given = {name: float(value) for name, _, value in (word.partition("=") for word in words)}
    serve = {"udp": serve_udp, "cls2sim": serve_cls2sim, "v2": serve_v2}[kind]
    serve(int(port), Twin(given))


if __name__ == "__main__":
    main()
