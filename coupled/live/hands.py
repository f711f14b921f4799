"""The hand of a live flight: a stick, or the mouse on the page, gives the grip's position.

A stick without force feedback gives a position only. The simulated hand moves the grip there by an
impedance, like a clamp, computed from the rig's own mass, damping and gradient. The force is then
what a pilot would need to hold that position. With a real loader the hand is real.
"""

from __future__ import annotations

import math
from typing import Literal, Protocol

from coupled.flight.pilot.base import Action, Pilot, Start
from coupled.record.channels import ControlName
from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

BANDWIDTH_rad_per_s = 10.0  # of the hand that follows a stick
SMOOTH_s = 0.04  # time constant of the filter on a stick's reading, which comes in steps


class HandPositions(Protocol):
    """A source of hand positions: a stick or the page."""

    name: str

    def read(self, control: str) -> float:
        """Return the position of a control, −1 to 1 of the travel, a pull positive."""

    def close(self) -> None:
        """Close the device."""


class LiveHand(Pilot):
    """A hand with positions given in flight; with a real loader, no simulated hand at all."""

    kind: Literal["live"] = "live"
    real: bool = False

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the impedance of the hand; its position is written frame by frame."""
        if self.real:
            return Action()
        w, loader = BANDWIDTH_rad_per_s, rig.controls[control].loader
        hand = Hand(w * loader.damping, w * loader.mass, w * start.gradient)
        return Action(hand=hand)


class PositionFilter:
    """Filters the positions of one control's hand, within the stops of both sides."""

    def __init__(self, control: Control, frame_s: float) -> None:
        self._control = control
        self._gain = -math.expm1(-frame_s / SMOOTH_s)
        self.at = 0.0

    def move(self, wanted: float) -> float:
        """Return the hand's position after a frame, d; `wanted` is a share of a side's travel."""
        if math.isfinite(wanted):
            asked = self._control.travel_to(wanted) * abs(wanted)
            place = math.copysign(min(asked, self._control.stop_to(wanted)), wanted)
            self.at += self._gain * (place - self.at)
        return self.at
