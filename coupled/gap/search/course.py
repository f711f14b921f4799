"""The time history of an effect: its onset and its rate of growth.

The size of an effect in a time window is the regression of the residual on the effect's action
there, 1 if it is as large as in the whole record (`credibility`). The action scales with the
excitation, so that a larger motion is no larger effect. Four time histories are fitted to the sizes
by least squares, with the power of the action in each window as its weight:

    constant    1                     from     0, then 1 from t₀ on
    changes     α + β·t               grows    0, then β·(t − t₀) from t₀ on

An effect whose parameter is a rate (a drift) is fitted with t, and the last two. Events, such as
missed frames, are counted as a Poisson process: they have an onset if the time before the first is
too long for their rate.

An effect that begins within the record, as a step or a ramp, is predicted with its time history
(`Timing`): the prediction of the rig without the effect, plus the size times the change that the
effect makes. This is exact for a stage without dynamics, such as a bending linkage, and correct to
first order for other stages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.special import chdtri

from coupled.gap.effects.effect import Effect, dotted, value_of
from coupled.gap.signals.output import Floats, Output, memory
from coupled.gap.thresholds import (
    DOUBLED,
    ENDS,
    NEGLIGIBLE,
    NORMAL_95,
    ONSET_CHANCE,
    RIVAL_GAIN,
    ROUGH,
    ONSETS_s,
    WINDOW_s,
)
from coupled.record.channels import ControlName
from coupled.results import Plain
from coupled.rig.rig import Rig

Kind = Literal["constant", "changes", "from", "grows", "events"]


@dataclass(frozen=True)
class Bounds(Plain):
    """A number with its 95 % interval."""

    value: float
    low: float
    high: float

    def times(self, factor: float) -> Bounds:
        """Return the number and its interval times a factor."""
        ends = sorted((factor * self.low, factor * self.high))
        return Bounds(factor * self.value, *ends)


@dataclass(frozen=True)
class Course:
    """The time history of an effect.

    `onset_s` is the time from the record's start, None if the effect acts from the start;
    `rate_per_s` the rate of change of its first parameter, a second, or of events, 1/s; `then` the
    size from the onset on, relative to that in the whole record.
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
    """A fitted time history: weighted residual, factor, and the factor's standard error over σ."""

    kind: Kind
    residual: Floats
    factor: float
    error: float
    onset_s: float = 0.0

    @property
    def cost(self) -> float:
        """The residual's sum of squares."""
        return float(self.residual @ self.residual)


def course_of(
    parts: Sequence[tuple[Floats, Floats]], rate_Hz: float, value: Bounds, gradual: bool
) -> Course:
    """Return the time history of an effect in one record.

    `parts` are its action and the residual of each output, in noise floors, by frame. `value` is
    its first parameter less the neutral value, a rate if `gradual`.
    """
    sizes, weights, times_s = _sizes(parts, rate_Hz)
    plain = Course("grows" if gradual else "constant", rate_per_s=value if gradual else None)
    if len(sizes) < 4 * ENDS:
        return plain
    if gradual:
        sizes, weights = sizes * times_s, weights / times_s**2
    always = _law("grows" if gradual else "constant", times_s**gradual, sizes, weights)
    others = _onsets(times_s, sizes, weights)
    if not gradual:
        others.append(_straight(times_s, sizes, weights))
    best = min(others, key=lambda law: law.cost)
    count = len(sizes) / memory(best.residual)
    changed = abs(best.factor) * times_s[-1] if best.kind == "changes" else math.inf
    gain = 0.5 * count * math.log(max(always.cost, 1e-300) / max(best.cost, 1e-300))
    if gain < DOUBLED * RIVAL_GAIN or changed < ROUGH:
        return plain
    near = [one for one in others if one.kind == best.kind and _near(one, best, count)]
    sure = NORMAL_95 * math.sqrt(best.cost / max(count - 2.0, 1.0))
    low = min(one.factor - sure * one.error for one in near)
    factor = Bounds(best.factor, low, max(one.factor + sure * one.error for one in near))
    if best.kind == "changes":
        return Course(best.kind, rate_per_s=factor.times(value.value))
    half_s = 0.5 * WINDOW_s  # the resolution of an onset
    first, last = (pick(one.onset_s for one in near) for pick in (min, max))
    onset = Bounds(best.onset_s, first - half_s, last + half_s)
    if best.kind == "from":
        return Course("from", onset, then=best.factor)
    return Course("grows", onset, factor.times(value.value))


def course_of_events(at_s: Floats, lasted_s: float) -> Course:
    """Return the time history of events at given times, s, in a record of given length, s.

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
    # The onset precedes the first event by at most the 95 % quantile of the waiting time.
    begun = max(first - math.log(20.0) / rate.value, 0.0)
    return Course("events", Bounds(first, begun, first), rate)


def _sizes(parts: Sequence[tuple[Floats, Floats]], rate_Hz: float) -> tuple[Floats, Floats, Floats]:
    """Return sizes, weights and times, s, of the action's centroid, of the windows with action."""
    frames = max(1, round(WINDOW_s * rate_Hz))
    count = min(len(action) for action, _ in parts) // frames
    power, along, at = np.zeros(count), np.zeros(count), np.zeros(count)
    frame_s = np.arange(count * frames).reshape(count, frames) / rate_Hz
    for action, residual in parts:
        each = (action, action + residual)
        a, r = (x[: count * frames].reshape(count, frames) for x in each)
        power += np.sum(a * a, axis=1)
        along += np.sum(a * r, axis=1)
        at += np.sum(a * a * frame_s, axis=1)
    held = power > NEGLIGIBLE * float(np.mean(power)) if count else np.zeros(0, dtype=bool)
    weights = power[held]
    return np.asarray(along[held] / weights), weights, np.asarray(at[held] / weights)


def _law(kind: Kind, shape: Floats, sizes: Floats, weights: Floats, onset_s: float = 0.0) -> _Law:
    """Fit the factor of a time history of given shape."""
    root = np.sqrt(weights)
    power = max(float(np.sum(weights * shape**2)), 1e-300)
    factor = float(np.sum(weights * shape * sizes)) / power
    return _Law(kind, root * (sizes - factor * shape), factor, 1.0 / math.sqrt(power), onset_s)


def _ramp(times_s: Floats, sizes: Floats, weights: Floats, onset_s: float) -> _Law:
    """Fit a ramp from an onset; its factor is the slope."""
    return _law("grows", np.maximum(times_s - onset_s, 0.0), sizes, weights, onset_s)


def _straight(times_s: Floats, sizes: Floats, weights: Floats) -> _Law:
    """Fit a straight line; its factor is the slope."""
    mean, middle = (float(np.average(x, weights=weights)) for x in (sizes, times_s))
    return _law("changes", times_s - middle, sizes - mean, weights)


def _onsets(times_s: Floats, sizes: Floats, weights: Floats) -> list[_Law]:
    """Fit a step and a ramp with each onset between windows."""
    found = []
    for k in range(ENDS, len(times_s) - ENDS):
        onset_s = 0.5 * float(times_s[k - 1] + times_s[k])
        begun = (times_s > onset_s).astype(np.float64)
        found.append(_law("from", begun, sizes, weights, onset_s))
        found.append(_ramp(times_s, sizes, weights, onset_s))
    # The onset of a ramp is better known than to one window, and its slope depends on it.
    best = min((law for law in found if law.kind == "grows"), key=lambda law: law.cost)
    near = best.onset_s + np.arange(-1.5 * WINDOW_s, 1.5 * WINDOW_s, 0.5 * ONSETS_s)
    found += [_ramp(times_s, sizes, weights, onset_s) for onset_s in near.tolist()]
    return found


def _near(one: _Law, best: _Law, count: float) -> bool:
    """Tell whether a time history is within the 95 % likelihood region of the best (χ²₁)."""
    return count * math.log(max(one.cost, 1e-300) / max(best.cost, 1e-300)) <= NORMAL_95**2


@dataclass(frozen=True)
class Timing:
    """The relative size of an effect over time: a step to 1 at `onset_s`, or a ramp from it."""

    onset_s: float
    grows: bool

    def size(self, frames: int, rate_Hz: float) -> Floats:
        """Return the relative size in each frame of a record, shape (frames,)."""
        since = np.arange(frames) / rate_Hz - self.onset_s
        if not self.grows:
            return np.asarray((since >= 0.0).astype(np.float64))
        grown = np.maximum(since, 0.0)
        return np.asarray(grown / max(float(grown.max()), 1e-300))

    def course(self, seen: Bounds, lasted_s: float, value: Bounds) -> Course:
        """Return the time history of an effect with this timing; `seen` is its onset, s.

        `value` is the largest value of the effect's first parameter, less its neutral value.
        """
        onset = Bounds(self.onset_s, min(self.onset_s, seen.low), max(self.onset_s, seen.high))
        if not self.grows:
            return Course("from", onset)
        rate = value.times(1.0 / (lasted_s - self.onset_s))
        return Course("grows", onset if self.onset_s > 0.0 else None, rate)


def timing_of(parts: Sequence[tuple[Floats, Floats]], rate_Hz: float) -> Timing:
    """Return the timing of an effect with the least sum of squares.

    `parts` are its action at constant size and the residual, in noise floors, of each output.
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
    """Return a rig with the parameters of an effect at their nominal values."""
    filed = {p: value_of(nominal, control, p.key) for p in effect.parameters}
    return rig.changed({dotted(p.key_on(control), control): value for p, value in filed.items()})


def timed(
    output: Output, nominal: Rig, control: ControlName, effect: Effect, timing: Timing
) -> Output:
    """Return an output whose prediction includes an effect with its timing."""
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
