"""A Brunner loader behind CLS2Sim's remote control, as far as its bytes are published.

Sources, each cited where it is used:

[1] Brunner, CLS2Sim manual, "Remote interface: general information" (RCInterface.htm): TCP or UDP,
    request and response, all values little-endian.
[2] Brunner, "External control", later "Low level control" (externalcontrol.htm,
    lowlevelcontrol.htm): request Int32 0xAF and Int32[4] forces of elevator, aileron, rudder and
    collective; response Int32 0xAF and Float[4] positions, 0 to 1. All else of CLS2Sim is off.
[3] Brunner, "Remote control interface protocol v2" (protocolv2.htm): axes by a bit mask, applied
    force as data 0x20; and for its packets the published Python client of P. Rothenhäusler (2021):
    read 0xD0 (UInt32 command, axis, data; response UInt16 length, UInt8 status, UInt16 device, then
    the value, 0x20 as Int32 and the normalised position 0x11 as Float), write 0xCE (Int32 command,
    axis, setting, then the value; the force scale factor is setting 0x20, UInt16, 20 to 999), and
    override 0xD1 (UInt32 command, axis, override; 0x01 is the scale's).

No source that we have gives: the unit of a force, in either protocol; which way an axis counts;
what a scale factor of 1 is; the rudder's bit in v2; what CLS2Sim does when packets stop; how the
answer for several axes is laid out; v1's packets. What is needed of these has to be measured and
given (`docs/live.md`); otherwise the loader is refused.
"""

from __future__ import annotations

import math
import struct
import time
from collections import Counter, deque
from collections.abc import Sequence

from coupled.live.link import Measured, Order, Sample
from coupled.live.roundtrip import RoundTrips
from coupled.live.transport import Given, Transport
from coupled.live.udp import MOST_PACKETS, reaches
from coupled.rig.rig import Rig

EXTERNAL = 0xAF
FORCES, POSITIONS = struct.Struct("<i4i"), struct.Struct("<i4f")  # [2]
READ, SETTING, OVERRIDE = 0xD0, 0xCE, 0xD1  # [3]
POSITION, APPLIED, SCALE, SCALE_OVERRIDE = 0x11, 0x20, 0x20, 0x01
ASK, ANSWER = struct.Struct("<3I"), struct.Struct("<HBH")
WRITE = struct.Struct("<3iH")
SCALES = (20, 999)
AGAIN_s = 0.5  # silence after which answers and requests are in step again
AXES = ("column", "wheel", "pedals")  # elevator, aileron, rudder: bits 0x01 and 0x02 of v2
MOST_COUNTS = 2**31 - 1


class _Cls2Sim:
    """The common part of both protocols: requests are answered before the next ones are sent."""

    measures_force = False
    measures_deflection = False
    round_trips: RoundTrips | None = None  # an answer does not repeat a number of its request

    def __init__(self, name: str, wire: Transport, rig: Rig, given: Given) -> None:
        self.name, self._wire, self._given = name, wire, given
        self.dropped: Counter[str] = Counter()
        self._controls = [str(control) for control in rig.controls]
        self._travels = [control.travel for control in rig.controls.values()]
        self._reaches = reaches(rig)
        self._requested_s = -math.inf  # time of the last request, s

    def receive(self, wait_s: float) -> Sample | None:
        """Return the newest sample since the last call; wait for it at most `wait_s`."""
        until = time.monotonic() + wait_s
        while True:
            found = self._drain()
            left = until - time.monotonic()
            if found is not None or left <= 0.0:
                return found
            self._wire.wait(left)

    def _drain(self) -> Sample | None:
        raise NotImplementedError

    def _sign(self, i: int) -> float:
        """Return −1 for a control with reversed axis (positions and forces), else 1."""
        return -1.0 if self._controls[i] in self._given.turn else 1.0

    def _place(self, i: int, share: float) -> float:
        """Return δc of control i in d, from its position as a share of the travel, −1 to 1."""
        return self._sign(i) * share * self._travels[i]

    def _sample(self, measured: Sequence[Measured]) -> Sample | None:
        for one, reach in zip(measured, self._reaches, strict=True):
            if not reach.holds(one):
                finite = math.isfinite(one.force) and math.isfinite(one.computed)
                self.dropped["out of range" if finite else "not a number"] += 1
                return None
        came_s = self._wire.came_s
        return Sample(tuple(measured), came_s if math.isfinite(came_s) else self._requested_s)

    def own_load(self, i: int, computed: float) -> float:
        """Return the load that the host computes for the loader, N."""
        raise NotImplementedError

    def ordered_gradient(self, i: int) -> float:
        """Return 0: the order for the loader's spring is included in its load."""
        return 0.0

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Send the orders of a frame."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the connection."""
        self._wire.close()


class External(_Cls2Sim):
    """CLS2Sim's external (low level) control: the host computes the whole load, 0xAF [2].

    No force is measured: F is the order, which equals the hand's force at rest.
    """

    def __init__(self, name: str, wire: Transport, rig: Rig, given: Given) -> None:
        super().__init__(name, wire, rig, given)
        self._loads = [0.0] * len(self._controls)
        self._loaders = [control.loader for control in rig.controls.values()]
        self._last = [0.0] * len(self._controls)
        self._frame_s = 1.0 / rig.frame_rate

    def _drain(self) -> Sample | None:
        found = None
        for _ in range(MOST_PACKETS):
            if (packet := self._wire.receive()) is None:
                break
            if len(packet) != POSITIONS.size:
                self.dropped["wrong length"] += 1
                continue
            command, *positions = POSITIONS.unpack(packet)
            if command != EXTERNAL:
                self.dropped["another command"] += 1
                continue
            shares = [2.0 * positions[AXES.index(name)] - 1.0 for name in self._controls]
            places = [self._place(i, share) for i, share in enumerate(shares)]
            measured = [Measured(*one) for one in zip(self._loads, places, strict=True)]
            found = self._sample(measured) or found
        return found

    def own_load(self, i: int, computed: float) -> float:
        """Return the host's part of the load, F_L of eq. (8) and damping, N."""
        loader = self._loaders[i]
        rate, self._last[i] = (computed - self._last[i]) / self._frame_s, computed
        sign = math.copysign(1.0, computed) if computed != 0.0 else 0.0
        elastic = (loader.basic_gradient + loader.cubic * computed * computed) * computed
        elastic += float(loader.force_curve.at(computed))
        return elastic + loader.breakout * sign + loader.damping * rate

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Send the load of each axis, which acts against the deflection."""
        counts = [0, 0, 0, 0]
        for i, (name, order) in enumerate(zip(self._controls, orders, strict=True)):
            wanted = -self._sign(i) * order.force * self._given.counts_per_N
            counts[AXES.index(name)] = round(min(max(wanted, -MOST_COUNTS), MOST_COUNTS))
            self._loads[i] = order.force
        self._requested_s = time.monotonic()
        self._wire.send(FORCES.pack(EXTERNAL, *counts))


class Version2(_Cls2Sim):
    """CLS2Sim's protocol v2: force and position are read, and its profile is scaled [3]."""

    measures_force = True

    def __init__(self, name: str, wire: Transport, rig: Rig, given: Given) -> None:
        super().__init__(name, wire, rig, given)
        self._basic = [control.assumed_basic_gradient for control in rig.controls.values()]
        self._bytes = b""
        self._lengths: dict[int, int] = {}  # the length in the first answer of each size
        self._out_of_sync = False  # an answer had another length: the stream is not in step
        self._heard_s = -math.inf  # time of the last bytes, s
        self._refused = False  # one of the pending requests was answered by an error
        self._due: deque[tuple[str, int]] = deque()  # pending requests: kind, control
        self._read = [[0.0, 0.0] for _ in self._controls]
        self._scales = [0] * len(self._controls)
        for i in range(len(self._controls)):
            self._wire.send(ASK.pack(OVERRIDE, self._bit(i), SCALE_OVERRIDE))
            self._due.append(("done", i))

    def _bit(self, i: int) -> int:
        return 1 << AXES.index(self._controls[i])

    def own_load(self, i: int, computed: float) -> float:
        """Return 0: the loader has its own spring, which is scaled."""
        return 0.0

    def ordered_gradient(self, i: int) -> float:
        """Return G_B: the scale orders the whole gradient, N/d."""
        return self._basic[i]

    def _drain(self) -> Sample | None:
        came = self._heard()
        self._bytes += came
        found = None
        while self._due:
            kind, i = self._due[0]
            size = 3 if kind == "done" else ANSWER.size + 4
            if len(self._bytes) < 3:
                break
            if self._bytes[2] != 0:  # an error has no value
                self.dropped[f"status {self._bytes[2]}"] += 1
                size, self._refused = 3, True
            elif len(self._bytes) < size:
                break
            elif kind != "done":
                raw = self._bytes[ANSWER.size : size]
                (value,) = struct.unpack("<f" if kind == "position" else "<i", raw)
                self._read[i][kind == "position"] = value
            if self._out_of_step(size):
                return None
            self._bytes = self._bytes[size:]
            self._due.popleft()
            if not self._due:
                whole, self._refused = not self._refused, False  # else a number is an old one
                measured = [self._measured(i) for i in range(len(self._controls))]
                found = self._sample(measured) if whole else None
        return found if self._requested_s > -math.inf else None

    def _heard(self) -> bytes:
        """Return the bytes that came; a stream that is not in step begins anew after a silence.

        No request is sent while an answer is pending, so that no late answer follows the silence.
        """
        came, now_s = self._wire.receive() or b"", time.monotonic()
        if came:
            self._heard_s = now_s
        elif (self._out_of_sync or self._bytes) and now_s - self._heard_s > AGAIN_s:
            self._bytes, self._out_of_sync, self._refused = b"", False, False
            self._due.clear()
        return b"" if self._out_of_sync else came

    def _out_of_step(self, size: int) -> bool:
        """Return whether the length of the next answer differs from that of others of its size."""
        (length,) = struct.unpack_from("<H", self._bytes)
        self._out_of_sync = self._lengths.setdefault(size, length) != length
        if self._out_of_sync:
            self.dropped["out of step"] += 1
            self._bytes = b""
        return self._out_of_sync

    def _measured(self, i: int) -> Measured:
        counts, share = self._read[i]
        force = self._sign(i) * counts / self._given.counts_per_N
        return Measured(force, self._place(i, share) if abs(share) <= 1.05 else math.nan)

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Request force and position, and set the scale if it has changed.

        Answers do not identify their request, but come in the order of the requests. So no more
        requests are sent while an answer is pending.
        """
        if self._due:
            return
        self._requested_s = time.monotonic()
        for i, order in enumerate(orders):
            share = (self._basic[i] + order.gradient) / self._given.profile
            scale = round(min(max(self._given.scale * share, SCALES[0]), SCALES[1]))
            if scale != self._scales[i]:
                self._scales[i] = scale
                self._wire.send(WRITE.pack(SETTING, self._bit(i), SCALE, scale))
                self._due.append(("done", i))
            for kind, data in (("force", APPLIED), ("position", POSITION)):
                self._wire.send(ASK.pack(READ, self._bit(i), data))
                self._due.append((kind, i))
