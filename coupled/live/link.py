"""What passes between host and loader, whatever the wire: what is measured, what is ordered."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from coupled.errors import InputError
from coupled.live.roundtrip import RoundTrips

WATCHDOG_s = 0.1  # without a valid packet for so long, the loader is lost


class Measured(NamedTuple):
    """One control at the loader: F in N, δc and δ in d; δ is NaN where it is not measured."""

    force: float
    computed: float
    deflection: float = math.nan


class Sample(NamedTuple):
    """What a loader measured at one time, a control each, in the rig's order.

    `time_s` is that time by the loader's own clock. On a wire that does not give it, it is when the
    host's system took the answer in, or where the system does not tell, when the host asked.
    """

    controls: tuple[Measured, ...]
    time_s: float


class Order(NamedTuple):
    """What the host asks of one control over the frame to come; d is m, or rad for a wheel.

    F_mod(δc) = ΔG·δc up to the break and with the second slope beyond it, and `breakout` in the
    direction of δc; `force` is that at the δc that the host has, for a loader without multiplier.
    """

    gradient: float  # ΔG, N/d
    second: float  # ΔG beyond the break, N/d
    break_at: float  # δc of the break, d; 0 for one segment
    breakout: float  # F_extra, N
    force: float  # F_mod at t_k, N
    total: float  # G_T, N/d
    trim: float  # the δc at which the loader is to rest, d


@dataclass(frozen=True)
class Reach:
    """What a real control cannot exceed, so that a packet beyond it is a fault of the wire."""

    force_N: float
    deflection: float  # d

    def holds(self, measured: Measured) -> bool:
        """Tell whether a control's measurements are numbers within reach."""
        force, computed, deflection = measured
        if not (abs(force) <= self.force_N and abs(computed) <= self.deflection):
            return False  # neither is NaN
        return math.isnan(deflection) or abs(deflection) <= self.deflection


class Link(Protocol):
    """A loader at the other end of a wire.

    `dropped` counts the packets that were not used, by reason; `measures_force` and
    `measures_deflection` say whether F and δ are the loader's own; `round_trips` is None on a
    wire whose answers do not say which order they answer.
    """

    name: str
    dropped: Counter[str]
    measures_force: bool
    measures_deflection: bool

    @property
    def round_trips(self) -> RoundTrips | None:
        """How long orders take to be answered."""

    def receive(self, wait_s: float) -> Sample | None:
        """Return the newest valid sample since the last call, waiting for one so long at most."""

    def own_load(self, i: int, computed: float) -> float:
        """Return the load at δc in d that control i's loader leaves to the host, N.

        0 for a loader with a spring of its own. It is asked once a frame.
        """

    def ordered_gradient(self, i: int) -> float:
        """Return the gradient that the host orders of control i beside ΔG, N/d.

        0 for a loader whose own spring the host does not order.
        """

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Send the orders of a frame; `mode` says whether forces are on, fading or off."""

    def close(self) -> None:
        """Let go of the wire."""


RUN, FADING, OFF = 1, 2, 3  # modes


def split_address(url: str) -> tuple[str, str, int]:
    """Return scheme, host and port of `scheme://host:port`; raises InputError."""
    scheme, found, rest = url.partition("://")
    if not found:
        raise InputError("--loader", "", f"is {url!r}; give sim, udp://HOST:PORT or cls2sim://…")
    return scheme, *split_place(rest, "--loader")


def split_place(place: str, option: str) -> tuple[str, int]:
    """Return host and port of `host:port`, as an option gives it; raises InputError."""
    host, colon, port = place.rpartition(":")
    host = host.strip("[]")  # of an IPv6 address
    if not colon or not host:
        raise InputError(option, "", f"is {place!r}; give HOST:PORT")
    if not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise InputError(option, "", f"{port!r} is no port; one is from 1 to 65535")
    return host, int(port)
