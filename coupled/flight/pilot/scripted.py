"""Pilots that follow a script: force (step, ramp, doublet, 3-2-1-1, sweep), or a held deflection.

Edges are half cosines over `rise_s`, as a hand's are.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from coupled.flight.pilot.base import STRONGEST, Action, Floats, Pilot, edges
from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.schema import quantity


class _Levels(Pilot):
    """A force that goes from level to level."""

    force: float = quantity("N", ge=-STRONGEST, le=STRONGEST)
    rise: float = quantity("s", 0.1, ge=0, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the (time in s, share of the force) that the signal goes to."""
        raise NotImplementedError

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the scripted force."""
        return Action(force=lambda t: self.force * edges(t, self.levels(), self.rise))


class Step(_Levels):
    """A force held for `duration_s`, or to the end where that is 0."""

    kind: Literal["step"]
    duration: float = quantity("s", 0.0, ge=0, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return one level, and its end."""
        end = [(self.start + self.duration, 0.0)] if self.duration > 0.0 else []
        return [(self.start, 1.0), *end]


class Ramp(Pilot):
    """A force that grows evenly over `ramp_s`, and is then held."""

    kind: Literal["ramp"]
    force: float = quantity("N", ge=-STRONGEST, le=STRONGEST)
    ramp: float = quantity("s", ge=1e-3, le=7200)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the ramp."""
        return Action(force=lambda t: self.force * np.clip((t - self.start) / self.ramp, 0.0, 1.0))


class Doublet(_Levels):
    """A force one way, then as long the other way."""

    kind: Literal["doublet"]
    half_period: float = quantity("s", ge=1e-3, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the two halves."""
        t, half = self.start, self.half_period
        return [(t, 1.0), (t + half, -1.0), (t + 2 * half, 0.0)]


class ThreeTwoOneOne(_Levels):
    """The 3-2-1-1 of aircraft identification: alternating pulses of 3, 2, 1 and 1 units."""

    kind: Literal["3211"]
    unit: float = quantity("s", ge=1e-3, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the four pulses."""
        at = self.start + self.unit * np.array([0, 3, 5, 6, 7])
        return list(zip(at.tolist(), [1.0, -1.0, 1.0, -1.0, 0.0], strict=True))


class Sweep(Pilot):
    """A sine whose frequency goes exponentially from `low_Hz` to `high_Hz`."""

    kind: Literal["sweep"]
    force: float = quantity("N", ge=-STRONGEST, le=STRONGEST)
    duration: float = quantity("s", ge=1e-3, le=7200)
    low: float = quantity("Hz", 0.1, ge=1e-3, le=50)
    high: float = quantity("Hz", 2.0, ge=1e-3, le=50)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the sweep, faded in and out over a tenth of it."""

        def force(t: Floats) -> Floats:
            u = np.clip((t - self.start) / self.duration, 0.0, 1.0)
            ratio = np.log(self.high / self.low)
            scale = np.expm1(ratio * u) / ratio if ratio != 0.0 else u
            phase = 2.0 * np.pi * self.low * self.duration * scale
            fade = np.sin(0.5 * np.pi * np.clip(np.minimum(u, 1.0 - u) / 0.1, 0.0, 1.0)) ** 2
            return np.asarray(self.force * fade * np.sin(phase))

        return Action(force=force)


class Clamp(Pilot):
    """Holds the grip at a deflection; the force is what that takes.

    The clamp inverts the rig's own mass, damping and gradient, so that the error of
    deflection dies as exp(−bandwidth·t) on any rig, without a lasting error.
    """

    kind: Literal["clamp"]
    deflection: float = quantity("{d}")
    rise: float = quantity("s", 0.5, gt=0)
    duration: float = quantity("s", 0.0, ge=0, le=7200)
    bandwidth: float = quantity("rad_per_s", 6.0, gt=0, le=30)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the held deflection, and the clamp's impedance."""
        end = [(self.start + self.duration, 0.0)] if self.duration > 0.0 else []
        levels = [(self.start, 1.0), *end]
        w, loader = self.bandwidth, control.loader
        hand = Hand(w * loader.damping, w * loader.mass, w * gradient)
        return Action(held=lambda t: self.deflection * edges(t, levels, self.rise), hand=hand)
