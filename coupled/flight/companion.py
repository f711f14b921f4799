"""The companion of a flight, called before and after each frame, and its access to the flight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.flight.bench import Airframe
from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.record import Record
from coupled.rig.control import ControlArray
from coupled.rig.packing import Hand

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class FlightAccess:
    """A flight's arrays, which a companion may read and change between frames.

    controls  the rig's controls in the kernels' arrays, shape (n,)
    script    the hands' force in N and held deflection on all nodes, shape (n, 2, nodes)
    data      the record, shape (frames, channels); future rows contain noise
    hands     each pilot's hand, by the control
    so_far    the record from one frame up to another, during the flight
    """

    manoeuvre: Manoeuvre
    airframe: Airframe
    channels: tuple[str, ...]
    controls: ControlArray
    script: Floats
    data: Floats
    hands: dict[str, Hand]
    so_far: Callable[[int, int], Record]


class Companion(Protocol):
    """An object called before and after each frame of a flight, such as a live host."""

    real_loader: bool  # hand and loader are real and not simulated
    sets_services: bool  # it may set services of any control, between frames

    def begin(self, access: FlightAccess) -> None:
        """Start, with the aircraft in trim."""

    def before(self, k: int, motion: tuple[float, ...]) -> str:
        """Act before frame k; return why the flight must end, or an empty string."""

    def after(self, k: int, commands: tuple[float, float, float]) -> None:
        """Act after frame k, with its surface commands, before the aircraft's step."""
