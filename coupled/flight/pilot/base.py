"""What every pilot is: a section of a run file that says what a hand does on a control."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.schema import Section, quantity

Floats = NDArray[np.float64]
Look = Callable[[float, tuple[float, ...]], float]


@dataclass(frozen=True)
class Action:
    """What a pilot does on one control.

    `force` in N and `held` in d are functions of time in s (arrays in, arrays out); `hand`
    is the impedance; `look`, where given, maps time and motion to a further force in N,
    once a frame.
    """

    force: Callable[[Floats], Floats] | None = None
    held: Callable[[Floats], Floats] | None = None
    hand: Hand = field(default_factory=Hand)
    look: Look | None = None


STRONGEST = 5000.0  # N; 14 CFR 25.143 asks at most 670 N of a pilot, for a short time


class Pilot(Section):
    """What every pilot has."""

    kind: str
    start: float = quantity("s", 1.0, ge=0, le=7200)
    reach: float = quantity("{d}", 0.0, ge=0)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return what this pilot does on a control.

        `gradient` is the specified one at the start, N/d; `name` the control's; files are
        sought in `folder`.
        """
        raise NotImplementedError

    def meet(self, rig: Rig, rig_file: Path, run_file: Path, seed: int) -> Pilot:
        """Return this pilot as it flies a rig; most need not know it beforehand."""
        return self


def edges(times: Floats, levels: Sequence[tuple[float, float]], rise: float) -> Floats:
    """Return a signal that goes to each (time, level) in turn, over `rise` seconds from it.

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
