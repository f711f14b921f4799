"""A loader of the open protocol, of its own physics and with its own clock.

    python loader.py [--port PORT] [--drop SHARE] [--die SECONDS] [--soften SECONDS FACTOR]

It is a column of 4 kg in front of a structure of 9.136e-5 m/N, moved by a sum of sines. It prints
the port that it took, a free one for 0. `--drop` loses so many of its answers, `--die` ends it
without a word, `--soften` multiplies its structure's K from then on, and `--seconds` ends it; times
are those of its own clock. That is real time, or with `--lockstep` a frame an order.
"""

from __future__ import annotations

import argparse
import math
import random
import select
import socket
import struct
import time
import zlib

HEADER, STATE, ORDER = struct.Struct("<4sBBBBIIIQ"), struct.Struct("<3f"), struct.Struct("<7f")
FRAME_s = 1.0 / 120.0
STEP_s, MASS_kg, DAMPING, BASIC_N_per_m, BEND_m_per_N = 1.0 / 2400.0, 4.0, 75.0, 560.4, 9.136e-5
SERVO_rad_per_s, SERVO_RATIO = 2.0 * math.pi * 18.0, 0.7
TONES_Hz, FORCE_N, RESTS_s, SILENT_s = (0.13, 0.29, 0.53, 0.97, 1.7), 12.0, 2.0, 0.1
PHASES = (0.3, 4.1, 2.2, 5.6, 1.4)


class Column:
    """Mass, damper and spring, its servo and its structure, stepped by small steps."""

    def __init__(self, soften: tuple[float, float]) -> None:
        self.time_s = self.place = self.speed = self.servo = self.servo_speed = self.force_N = 0.0
        self.gradient = 0.0  # ΔG as ordered, N/m
        self._soften = soften

    def hand(self) -> float:
        """Return the hand's force, N."""
        since = self.time_s - RESTS_s
        tones = zip(TONES_Hz, PHASES, strict=True)
        moving = sum(math.sin(2.0 * math.pi * f * since + p) - math.sin(p) for f, p in tones)
        return 0.0 if since < 0.0 else FORCE_N * min(since, 1.0) * moving

    def run(self, until_s: float) -> None:
        """Step up to a time of its clock."""
        while self.time_s < until_s:
            self.time_s += STEP_s
            self.force_N = self.hand()
            spring = (BASIC_N_per_m + self.gradient) * self.place
            before, speed = self.place, self.servo_speed
            self.speed += STEP_s * (self.force_N - DAMPING * self.speed - spring) / MASS_kg
            self.place += STEP_s * self.speed
            # By the midpoint rule: half a step of lag would be 2 % of the servo's.
            away = 0.5 * (before + self.place) - self.servo - 0.5 * STEP_s * speed
            brakes = SERVO_RATIO * SERVO_rad_per_s
            pulled = speed + STEP_s * (SERVO_rad_per_s**2 * away - brakes * speed)
            self.servo_speed = pulled / (1.0 + STEP_s * brakes)
            self.servo += 0.5 * STEP_s * (speed + self.servo_speed)

    def measured(self, noise: random.Random) -> bytes:
        """Return F, δc and δ as a block of a state."""
        at_s, factor = self._soften
        bend = BEND_m_per_N * (factor if self.time_s > at_s else 1.0)
        force = self.force_N + noise.gauss(0.0, 0.05)
        deflection = self.servo + bend * self.force_N + noise.gauss(0.0, 2e-5)
        return STATE.pack(force, self.place + noise.gauss(0.0, 2e-5), deflection)


def serve(words: argparse.Namespace) -> None:
    """Answer one host after another, until the time is over."""
    noise, column = random.Random(4), Column(tuple(words.soften))
    wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    wire.bind(("127.0.0.1", words.port))
    wire.setblocking(False)
    print(wire.getsockname()[1], flush=True)
    begun, heard, sent, session, last = time.perf_counter(), -1.0, 0, None, 0
    started = None
    while time.perf_counter() - begun < words.seconds:
        select.select([wire], [], [], 0.0005)
        if started is not None:
            now = time.perf_counter() - started
            column.run(column.time_s if words.lockstep else now)
            if column.time_s > words.die:
                return
            if now - heard > SILENT_s:
                session, column.gradient = None, 0.0
        try:
            packet, host = wire.recvfrom(512)
        except (BlockingIOError, ConnectionError):
            continue
        if len(packet) != 60 or zlib.crc32(packet[:-4]) != int.from_bytes(packet[-4:], "little"):
            continue
        *_, theirs, sequence, _, _ = HEADER.unpack_from(packet)
        if session not in (None, theirs):
            continue
        session, last = theirs, sequence
        started = time.perf_counter() if started is None else started
        heard = time.perf_counter() - started
        column.gradient = ORDER.unpack_from(packet, HEADER.size)[0]
        if words.lockstep:
            column.run(column.time_s + FRAME_s - 0.5 * STEP_s)
        if noise.random() < words.drop:
            continue
        sent += 1
        head = HEADER.pack(b"CPLD", 1, 1, 1, 0, session, sent, last, int(1e6 * column.time_s))
        whole = head + column.measured(noise)
        wire.sendto(whole + zlib.crc32(whole).to_bytes(4, "little"), host)


if __name__ == "__main__":
    asked = argparse.ArgumentParser()
    asked.add_argument("--port", type=int, default=0)
    asked.add_argument("--lockstep", action="store_true")
    for option, usual in (("--drop", 0.0), ("--die", 1e9), ("--seconds", 100.0)):
        asked.add_argument(option, type=float, default=usual)
    asked.add_argument("--soften", nargs=2, type=float, default=(1e9, 1.0))
    serve(asked.parse_args())
