"""The kinds of effects and outsiders of a trial, and the references of their sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from coupled.blind.twin.twin import Bristles, Twin
from coupled.record.channels import LONGITUDINAL
from coupled.record.record import Record
from coupled.rig.parameters import Loader
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Draw:
    """The random numbers of a kind, for any size: a side, three shares, a seed."""

    side: float
    u: tuple[float, float, float]
    seed: int


@dataclass(frozen=True)
class Clean:
    """The record of the same rig, pilot and noise without effects, as a reference of sizes."""

    rig: Rig
    record: Record
    bristles: Bristles

    @property
    def loader(self) -> Loader:
        """The nominal loader."""
        return self.rig.controls["column"].loader

    @property
    def seconds(self) -> float:
        """Length of the record."""
        return len(self.record) / self.rig.frame_rate

    def peak(self, name: str) -> float:
        """Return the 99th percentile of a channel's absolute value."""
        return float(np.percentile(np.abs(self.record[name]), 99.0))

    def speed(self, name: str) -> float:
        """Return the 99th percentile of a channel's absolute rate, over 0.1 s."""
        step = max(1, round(0.1 * self.rig.frame_rate))
        moved = self.record[name][step:] - self.record[name][:-step]
        return float(np.percentile(np.abs(moved), 99.0)) / (step / self.rig.frame_rate)

    def mean(self, name: str) -> float:
        """Return a channel's mean."""
        return float(np.mean(self.record[name]))

    def spread(self, name: str) -> float:
        """Return the span of the central 96 % of a channel."""
        low, high = np.percentile(self.record[name], [2.0, 98.0])
        return float(high - low)


# Puts a kind of some size into the twin; returns its parameters by the names of a diagnosis.
Found = dict[str, float]
Install = Callable[[Twin, Clean, float, Draw], Found]


@dataclass(frozen=True)
class Kind:
    """An effect or an outsider: its stage, its sizes, and its installer.

    `least` and `most` bound the size, with which the residual grows; equal for a discrete effect.
    `shows` is the stage whose residual it enlarges, if not its own; `other`: it needs the force on
    another control. A kind cannot be combined with those in `excludes`.
    """

    name: str
    stage: str
    least: float
    most: float
    install: Install
    flown: bool = False
    shows: str = ""
    other: bool = False
    excludes: tuple[str, ...] = ()

    @property
    def widens(self) -> str:
        """The stage whose residual it enlarges."""
        return self.shows or self.stage

    def suits(self, rig: Rig) -> bool:
        """Tell whether the rig can have it."""
        column = rig.controls["column"]
        if self.flown and rig.flight is None:
            return False
        if self.name == "arc_geometry":  # deflections in flight are too small
            return column.length > 0.0 and rig.flight is None
        if self.stage == "schedule" and rig.flight is not None:
            return _sloped(rig)
        return True


def _sloped(rig: Rig) -> bool:
    """Tell whether the schedule depends on q̄ where the aircraft flies."""
    assert rig.flight is not None
    table = rig.controls["column"].schedule
    q = 0.5 * 1.225 * rig.flight.calibrated_airspeed**2
    around = np.interp([0.9 * q, q, 1.1 * q], table.dynamic_pressure, table.total_gradient)
    return bool(np.ptp(around) > 0.0)


ALPHA, SPEED, RATE = (
    LONGITUDINAL.index(name)
    for name in ("alpha_rad", "true_airspeed_m_per_s", "pitch_rate_rad_per_s")
)
