"""Who goes along with a flight, frame by frame, and what of the flight it may see and change."""

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
class Aboard:
    """A flight's arrays, which who goes along may read and change between frames.

    controls  the rig's controls as the kernels hold them, shape (n,)
    script    the hands' force in N and held deflection on all nodes, shape (n, 2, nodes)
    data      the record, shape (frames, channels); rows to come hold noise
    hands     what each pilot's hand is, by the control
    so_far    the record from one frame up to another, while the flight goes on
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
    """Who goes along with a flight, frame by frame: a live host."""

    elsewhere: bool  # hand and loader are real: the rig's are not simulated
    leads: bool  # it may lead the services of any control, between frames

    def board(self, aboard: Aboard) -> None:
        """Begin, with the aircraft in trim."""

    def before(self, k: int, motion: tuple[float, ...]) -> str:
        """Do what precedes frame k; return why the flight is to end, or an empty string."""

    def after(self, k: int, commands: tuple[float, float, float]) -> None:
        """Take the surface commands of frame k before the aircraft has them."""
