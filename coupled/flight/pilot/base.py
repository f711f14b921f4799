"""The base of pilots: a section of a run file, or an object in Python, that moves one control."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from coupled.arguments import public
from coupled.errors import InputError
from coupled.record.channels import ControlName, unit_of
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig
from coupled.schema import Given, file_keys, known_keys, quantity

Floats = NDArray[np.float64]
if TYPE_CHECKING:
    Values = Sequence[float] | Floats
else:
    Values = list[float]  # a section has the values of a file
Look = Callable[[float, tuple[float, ...]], float]


@dataclass(frozen=True)
class Action:
    """The action of a pilot on one control.

    `force` in N and `held` in d are functions of time in s (arrays in, arrays out); `hand` is the
    impedance; `look`, if given, maps time and motion to a further force in N, once a frame.
    """

    force: Callable[[Floats], Floats] | None = None
    held: Callable[[Floats], Floats] | None = None
    hand: Hand = field(default_factory=Hand)
    look: Look | None = None


@dataclass(frozen=True)
class Start:
    """The conditions at the start of a flight, and the files named in faults.

    `gradient` is the specified one at the q̄ of trim, N/d; `seed` that of the pilot's noise;
    `file` is the run's, `rig_file` the rig's.
    """

    gradient: float
    seed: int = 0
    file: object = "manoeuvre"
    rig_file: object = "rig"


STRONGEST = 5000.0  # N; 14 CFR 25.143 allows at most 670 N, for a short time


@public
class Pilot(Given):
    """The common keys of all pilots.

    `start_s` is when the pilot begins; `reach_m` (`reach_rad` on a wheel) the deflection on either
    side beyond which the arm cannot follow, 0 for none.
    """

    kind: str
    start_s: float = quantity("", 1.0, ge=0, le=7200)
    reach_m: float = quantity("", 0.0, ge=0)
    reach_rad: float = quantity("", 0.0, ge=0)
    _WANTED: ClassVar[str] = "a pilot (as coupled.Step(force_N=50))"
    _BY_UNIT: ClassVar[tuple[str, ...]] = ("reach",)  # keys that end in the control's unit

    @classmethod
    def keys_on(cls, control: ControlName) -> dict[str, str]:
        """Return {key in a run file: field} of this pilot on a control."""
        wrong = {f"{name}_{'m' if unit_of(control) == 'rad' else 'rad'}" for name in cls._BY_UNIT}
        return {key: name for key, name in file_keys(cls, "m").items() if key not in wrong}

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Raise InputError for an action impossible on a rig's control; `file` is named."""
        given = {key: None for key in file_keys(type(self), "m") if key in self.model_fields_set}
        known_keys(given, self.keys_on(control), file, f"pilot.{control}")

    def begins(self, control: ControlName) -> tuple[str, float]:
        """Return the key that gives when the pilot begins, and that time in s; 0 by default."""
        return "start_s", self.start_s if "start_s" in self.model_fields_set else 0.0

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the pilot's action on a rig's control."""
        raise NotImplementedError

    @property
    def title(self) -> str:
        """The pilot's name for a reader."""
        return type(self).__name__

    @property
    def rests(self) -> bool:
        """Whether this pilot leaves the control alone."""
        return False

    def reach(self, control: ControlName) -> float:
        """Return the reach on a control, d; 0 for none."""
        return self.reach_rad if unit_of(control) == "rad" else self.reach_m


def edges(times: Floats, levels: Sequence[tuple[float, float]], rise: float) -> Floats:
    """Return a signal that moves to each (time, level) in turn, over `rise` seconds.

    `times` rise; each edge is a half cosine.
    """
    out = np.zeros_like(times)
    before = 0.0
    for at, level in levels:
        start, end = np.searchsorted(times, (at, at + rise))
        share = (times[start:end] - at) / rise if rise > 0.0 else times[start:end]
        out[start:end] += (level - before) * 0.5 * (1.0 - np.cos(np.pi * share))
        out[end:] += level - before
        before = level
    return out


def needs_aircraft(rig: Rig, control: ControlName, file: object) -> None:
    """Refuse a pilot who observes the motion, on a rig without aircraft."""
    if rig.flight is None:
        problem = "uses the aircraft's motion, and the rig has no aircraft; give one that flies"
        raise InputError(file, f"pilot.{control}", problem)


def turned(found_rad: float, now_rad: float) -> float:
    """Return the difference of two angles, within half a turn, rad."""
    away = now_rad - found_rad
    return away - 2.0 * math.pi * round(away / (2.0 * math.pi))
