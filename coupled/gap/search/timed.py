"""An effect whose size goes with time: it comes at once, or wears from nothing.

Before its onset a stage is the rig without the effect, after it the rig with it, and between them
what the effect does goes with its size: exactly so where a stage answers at once, as a linkage that
bends, and to first order else. What a stage still remembers of the time before dies away with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, dotted, value_of
from coupled.gap.search.course import Bounds, Course
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import ONSETS_s
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Timing:
    """How large an effect is at a time, 1 where it is the largest.

    It comes at `onset_s`, or, where it `grows`, straight from nothing then.
    """

    onset_s: float
    grows: bool

    def size(self, frames: int, rate_Hz: float) -> Floats:
        """Return the size in each frame of a record, shape (frames,)."""
        since = np.arange(frames) / rate_Hz - self.onset_s
        if not self.grows:
            return np.asarray((since >= 0.0).astype(np.float64))
        grown = np.maximum(since, 0.0)
        return np.asarray(grown / max(float(grown.max()), 1e-300))

    def course(self, seen: Bounds, lasted_s: float, value: Bounds) -> Course:
        """Return the course of an effect fitted with this timing; `seen` is its onset.

        `value` is the effect's first number where it is the largest, less what does nothing.
        """
        onset = Bounds(self.onset_s, min(self.onset_s, seen.low), max(self.onset_s, seen.high))
        if not self.grows:
            return Course("from", onset)
        return Course("grows", onset, value.times(1.0 / (lasted_s - self.onset_s)))


def timing_of(parts: Sequence[tuple[Floats, Floats]], rate_Hz: float) -> Timing:
    """Return the timing that leaves least of what an effect explains.

    `parts` are its action at one size and what that leaves, in floors, of each output.
    """
    frames = min(len(action) for action, _ in parts)
    action = [a[:frames] for a, _ in parts]
    power = np.sum([a * a for a in action], axis=0)
    left = [r[:frames] for _, r in parts]
    along = np.sum([a * (a + r) for a, r in zip(action, left, strict=True)], axis=0)
    lasts_s = frames / rate_Hz
    within = np.arange(ONSETS_s, lasts_s - ONSETS_s, ONSETS_s)
    tries = [Timing(at, grows) for at in within.tolist() for grows in (False, True)]

    def taken(timing: Timing) -> float:
        size = timing.size(frames, rate_Hz)
        acts = float(size**2 @ power)
        return float(size @ along) ** 2 / acts if acts > 0.0 else 0.0

    return max(tries, key=taken)


def without(rig: Rig, nominal: Rig, control: ControlName, effect: Effect) -> Rig:
    """Return a rig with the numbers that an effect frees as the nominal one has them."""
    filed = {p: value_of(nominal, control, p.key) for p in effect.parameters}
    return rig.changed({dotted(p.key_on(control), control): value for p, value in filed.items()})


def timed(
    output: Output, nominal: Rig, control: ControlName, effect: Effect, timing: Timing
) -> Output:
    """Return an output to whose prediction an effect is added as its timing has it."""
    size = timing.size(len(output.measured), output.frame_rate_Hz)
    known: list[tuple[Rig, Floats]] = []

    def bare(rig: Rig) -> Floats:
        made = next((made for other, made in known if other == rig), None)
        if made is None:
            made = output.predict(rig)
            known[:] = [*known[-3:], (rig, made)]
        return made

    def predict(rig: Rig) -> Floats:
        less = without(rig, nominal, control, effect)
        if less == rig:
            return output.predict(rig)
        before = bare(less)
        return before + size * (output.predict(rig) - before)

    return replace(output, predict=predict, rough=None, _known=[])
