"""The course of an effect over time: since when it is there, and how fast it grows.

The size of an effect in a window of time is what part of its action the residual holds there, 1
where it is as large as in all of the record (`credibility`). The action goes with the excitation,
so a larger motion is no larger effect. Four courses are held against the sizes by least squares,
each window weighing by its action's power:

    constant    1                     from     0, then 1 from t₀ on
    changes     α + β·t               grows    0, then β·(t − t₀) from t₀ on

An effect whose number is a rate (a drift) is held against what it has grown to: t, and the last
two. Of one that consists of events, as frames that were missed, the events themselves are counted,
as Poisson's: an onset is there where the time before the first is too long for their rate.

An effect that begins within the record, at once or from nothing, is predicted with its time history
(`Timing`): before its onset a stage is the rig without the effect, after it the rig with it, and
between them what the effect does goes with its size. That is exact where a stage answers at once,
as a linkage that bends, and to first order else.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from coupled.gap.effects.effect import Effect, dotted, value_of
from coupled.gap.signals.output import Output, memory
from coupled.gap.thresholds import (
    COURSE_CHANGES,
    COURSE_GAIN,
    COURSE_POWER,
    ONSET_CHANCE,
    COURSE_WINDOW_s,
    ONSETS_s,
)
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
FEWEST_WINDOWS = 12  # by which a course is sought
FINE = 61  # onsets of a ramp that are tried about the best
ENDS = 3  # windows from either end of the record, within which no onset is sought
Kind = Literal["constant", "changes", "from", "grows", "events"]


@dataclass(frozen=True)
class Bounds:
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float

    def times(self, factor: float) -> Bounds:
        """Return it in another unit."""
        ends = sorted((factor * self.low, factor * self.high))
        return Bounds(factor * self.value, *ends)

    def as_dict(self) -> dict[str, float]:
        """Return the JSON."""
        return {"value": self.value, "low": self.low, "high": self.high}


@dataclass(frozen=True)
class Course:
    """How an effect goes in time.

    `onset_s` from the record's start, None where it was there from the first; `rate_per_s`: of the
    effect's first number, in that number's unit a second, or of events, a second; None where it
    does not grow; `then`: how large it is from its onset on, over its size in all of the record.
    """

    kind: Kind
    onset_s: Bounds | None = None
    rate_per_s: Bounds | None = None
    then: float = 1.0

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        found: dict[str, Any] = {"kind": self.kind}
        if self.onset_s is not None:
            found["onset_s"] = self.onset_s.as_dict()
        if self.rate_per_s is not None:
            found["rate_per_s"] = self.rate_per_s.as_dict()
        if self.kind == "from":
            found["then"] = self.then
        return found


@dataclass(frozen=True)
class _Law:
    """A course fitted: what it leaves of the weighted sizes, its factor, with its error over σ."""

    kind: Kind
    left: Floats
    factor: float
    error: float
    onset_s: float = 0.0

    @property
    def cost(self) -> float:
        """The sum of squares that it leaves."""
        return float(self.left @ self.left)


def course_of(
    parts: Sequence[tuple[Floats, Floats]], rate_Hz: float, value: Bounds, gradual: bool
) -> Course:
    """Return an effect's course by its `action` and what is `left` of the residual, in floors.

    `parts` are these two of each output, over the frames of one record; `value` is the effect's
    first number less what does nothing. A number that is a rate is `gradual`.
    """
    sizes, weights, times_s = _sizes(parts, rate_Hz)
    plain = Course("grows" if gradual else "constant", rate_per_s=value if gradual else None)
    if len(sizes) < FEWEST_WINDOWS:
        return plain
    if gradual:
        sizes, weights = sizes * times_s, weights / times_s**2
    always = _law("grows" if gradual else "constant", times_s**gradual, sizes, weights)
    others = _onsets(times_s, sizes, weights)
    if not gradual:
        others.append(_straight(times_s, sizes, weights))
    best = min(others, key=lambda law: law.cost)
    count = len(sizes) / memory(best.left)
    changed = abs(best.factor) * times_s[-1] if best.kind == "changes" else math.inf
    gain = 0.5 * count * math.log(max(always.cost, 1e-300) / max(best.cost, 1e-300))
    if gain < COURSE_GAIN or changed < COURSE_CHANGES:
        return plain
    near = [one for one in others if one.kind == best.kind and _near(one, best, count)]
    sure = 1.96 * math.sqrt(best.cost / max(count - 2.0, 1.0))
    low = min(one.factor - sure * one.error for one in near)
    factor = Bounds(best.factor, low, max(one.factor + sure * one.error for one in near))
    if best.kind == "changes":
        return Course(best.kind, rate_per_s=factor.times(value.value))
    half_s = 0.5 * COURSE_WINDOW_s  # within a window nothing is known of an onset
    first, last = (pick(one.onset_s for one in near) for pick in (min, max))
    onset = Bounds(best.onset_s, first - half_s, last + half_s)
    if best.kind == "from":
        return Course("from", onset, then=best.factor)
    return Course("grows", onset, factor.times(value.value))


def course_of_events(at_s: Floats, lasted_s: float) -> Course:
    """Return the course of events at these times, s, in a record that lasts so long.

    The rate's interval is that of a Poisson count (Garwood 1936).
    """
    count = len(at_s)
    first = float(at_s[0])
    over_s = lasted_s - first
    waited = count > 1 and (count - 1) * first / over_s > -math.log(ONSET_CHANCE)
    over_s, count = (over_s, count - 1) if waited else (lasted_s, count)
    low, high = 0.5 * chdtri(2 * count, 0.975), 0.5 * chdtri(2 * count + 2, 0.025)
    rate = Bounds(count / over_s, float(low) / over_s, float(high) / over_s)
    if not waited:
        return Course("events", rate_per_s=rate)
    # It began before the first event, by no more than such events let one wait.
    begun = max(first - math.log(20.0) / rate.value, 0.0)
    return Course("events", Bounds(first, begun, first), rate)


def _sizes(parts: Sequence[tuple[Floats, Floats]], rate_Hz: float) -> tuple[Floats, Floats, Floats]:
    """Return sizes, weights and times in s of the windows that hold some of the action.

    A window's time is where its action lies.
    """
    frames = max(1, round(COURSE_WINDOW_s * rate_Hz))
    count = min(len(action) for action, _ in parts) // frames
    power, along, at = np.zeros(count), np.zeros(count), np.zeros(count)
    frame_s = np.arange(count * frames).reshape(count, frames) / rate_Hz
    for action, left in parts:
        a, r = (x[: count * frames].reshape(count, frames) for x in (action, action + left))
        power += np.sum(a * a, axis=1)
        along += np.sum(a * r, axis=1)
        at += np.sum(a * a * frame_s, axis=1)
    held = power > COURSE_POWER * float(np.mean(power)) if count else np.zeros(0, dtype=bool)
    weights = power[held]
    return np.asarray(along[held] / weights), weights, np.asarray(at[held] / weights)


def _law(kind: Kind, shape: Floats, sizes: Floats, weights: Floats, onset_s: float = 0.0) -> _Law:
    """Return the course that goes as a shape, by the factor that leaves least."""
    root = np.sqrt(weights)
    power = max(float(np.sum(weights * shape**2)), 1e-300)
    factor = float(np.sum(weights * shape * sizes)) / power
    return _Law(kind, root * (sizes - factor * shape), factor, 1.0 / math.sqrt(power), onset_s)


def _ramp(times_s: Floats, sizes: Floats, weights: Floats, onset_s: float) -> _Law:
    """Return what grows straight from a time on; its factor is the slope."""
    return _law("grows", np.maximum(times_s - onset_s, 0.0), sizes, weights, onset_s)


def _straight(times_s: Floats, sizes: Floats, weights: Floats) -> _Law:
    """Return the course that changes straight in time; its factor is the slope."""
    mean, middle = (float(np.average(x, weights=weights)) for x in (sizes, times_s))
    return _law("changes", times_s - middle, sizes - mean, weights)


def _onsets(times_s: Floats, sizes: Floats, weights: Floats) -> list[_Law]:
    """Return what begins at each time, some windows from either end of the record."""
    found = []
    for k in range(ENDS, len(times_s) - ENDS):
        onset_s = 0.5 * float(times_s[k - 1] + times_s[k])
        begun = (times_s > onset_s).astype(np.float64)
        found.append(_law("from", begun, sizes, weights, onset_s))
        found.append(_ramp(times_s, sizes, weights, onset_s))
    # Where a ramp begins is known better than to a window, and its slope depends on it.
    best = min((law for law in found if law.kind == "grows"), key=lambda law: law.cost)
    near = best.onset_s + COURSE_WINDOW_s * np.linspace(-1.5, 1.5, FINE)
    found += [_ramp(times_s, sizes, weights, onset_s) for onset_s in near.tolist()]
    return found


def _near(one: _Law, best: _Law, count: float) -> bool:
    """Tell whether a course is as likely as the best, to 95 %: twice the log ratio under χ²₁."""
    return count * math.log(max(one.cost, 1e-300) / max(best.cost, 1e-300)) <= 3.84


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
