"""The interface between host and loader, for any protocol: measurements and orders."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from coupled.errors import InputError
from coupled.live.roundtrip import RoundTrips

WATCHDOG_s = 0.1  # time without a valid packet after which the loader counts as lost


class Measured(NamedTuple):
    """Measurements of one control: F in N, δc and δ in d; δ is NaN if not measured."""

    force: float
    computed: float
    deflection: float = math.nan


class Sample(NamedTuple):
    """The measurements of a loader at one time, by control in the rig's order.

    `time_s` is by the loader's own clock. If the protocol does not give it, it is the time of
    arrival by the system's stamp, or without stamps the time of the host's request.
    """

    controls: tuple[Measured, ...]
    time_s: float


class Order(NamedTuple):
    """The orders for one control over the next frame; d is m, or rad for a wheel.

    F_mod(δc) = ΔG·δc up to the break and with the second slope beyond it, plus `breakout` in the
    direction of δc; `force` is F_mod at the host's δc, for a loader without multiplier.
    """

    gradient: float  # ΔG, N/d
    second: float  # ΔG beyond the break, N/d
    break_at: float  # δc of the break, d; 0 for one segment
    breakout: float  # F_extra, N
    force: float  # F_mod at t_k, N
    total: float  # G_T, N/d
    trim: float  # the δc at which the loader rests, d


@dataclass(frozen=True)
class Reach:
    """Bounds of a real control; a packet beyond them is a fault of the connection."""

    force_N: float
    deflection: float  # d

    def holds(self, measured: Measured) -> bool:
        """Return whether the measurements of a control are finite and within the bounds."""
        force, computed, deflection = measured
        if not (abs(force) <= self.force_N and abs(computed) <= self.deflection):
            return False  # neither is NaN
        return math.isnan(deflection) or abs(deflection) <= self.deflection


class Link(Protocol):
    """A connection to a loader.

    `dropped` counts the packets that were not used, by reason. `measures_force` and
    `measures_deflection`: the loader measures F and δ. `round_trips` is None if answers do not
    identify the order that they answer.
    """

    name: str
    dropped: Counter[str]
    measures_force: bool
    measures_deflection: bool

    @property
    def round_trips(self) -> RoundTrips | None:
        """The times from orders to their answers."""

    def receive(self, wait_s: float) -> Sample | None:
        """Return the newest valid sample since the last call; wait for it at most `wait_s`."""

    def own_load(self, i: int, computed: float) -> float:
        """Return the host's part of the load of control i at δc in d, N.

        0 for a loader with its own spring. It is called once a frame.
        """

    def ordered_gradient(self, i: int) -> float:
        """Return the gradient that the host orders of control i in addition to ΔG, N/d.

        0 for a loader whose own spring the host does not order.
        """

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Send the orders of a frame; `mode` is RUN, FADING or OFF."""

    def close(self) -> None:
        """Close the connection."""


RUN, FADING, OFF = 1, 2, 3  # modes


def split_address(url: str) -> tuple[str, str, int]:
    """Return scheme, host and port of `scheme://host:port`; raises InputError."""
    scheme, found, rest = url.partition("://")
    if not found:
        raise InputError("--loader", "", f"is {url!r}; give sim, udp://HOST:PORT or cls2sim://…")
    return scheme, *split_place(rest, "--loader")


def split_place(place: str, option: str) -> tuple[str, int]:
    """Return host and port of an option's `host:port`; raises InputError."""
    host, colon, port = place.rpartition(":")
    host = host.strip("[]")  # of an IPv6 address
    if not colon or not host:
        raise InputError(option, "", f"is {place!r}; give HOST:PORT")
    if not port.isdecimal() or not 1 <= int(port) <= 65535:
        raise InputError(option, "", f"{port!r} is no port; one is from 1 to 65535")
    return host, int(port)
