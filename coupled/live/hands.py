"""The hand of one who flies live: where a stick, or the mouse on the page, wants the grip.

A stick without force says a place. The rig's hand takes the grip there as a clamp does, by an
impedance that inverts the rig's own mass, damping and gradient, so that the force is what the
loader asks for that place: what a pilot would have to hold. A real loader has a real hand.
"""

from __future__ import annotations

import math
from typing import Literal, Protocol

from coupled.flight.pilot.base import Action, Pilot, Start
from coupled.record.channels import ControlName
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig

BANDWIDTH_rad_per_s = 10.0  # of the hand that follows a stick
SMOOTH_s = 0.04  # a stick's reading is led to the hand so slowly: it comes in steps


class Wishes(Protocol):
    """Where a hand wants the controls: a stick, or the page."""

    name: str

    def read(self, control: str) -> float:
        """Return the place wanted now, −1 to 1 of the travel, a pull positive."""

    def close(self) -> None:
        """Let go of the device."""


class LiveHand(Pilot):
    """A hand whose place comes while flying; on a real loader, none of the simulation's."""

    kind: Literal["live"] = "live"
    real: bool = False

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the impedance of the hand; its place is written frame by frame."""
        if self.real:
            return Action()
        w, loader = BANDWIDTH_rad_per_s, rig.controls[control].loader
        hand = Hand(w * loader.damping, w * loader.mass, w * start.gradient)
        return Action(hand=hand)


class Follower:
    """Leads one control's hand to the places wanted: smooth, within the travel in d."""

    def __init__(self, travel: float, frame_s: float) -> None:
        self._travel = travel
        self._gain = -math.expm1(-frame_s / SMOOTH_s)
        self.at = 0.0

    def move(self, wanted: float) -> float:
        """Return where the hand is after a frame, d; `wanted` is a share of the travel."""
        if math.isfinite(wanted):
            place = self._travel * min(max(wanted, -1.0), 1.0)
            self.at += self._gain * (place - self.at)
        return self.at
