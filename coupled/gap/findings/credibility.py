"""Whether an effect found is the cause, or only imitates it.

A cause has the same size everywhere; what imitates another cause drifts from regime to regime
(invariant causal prediction: Peters, Bühlmann and Meinshausen, J. R. Statist. Soc. B 78, 2016). An
effect's size is taken apart in halves of the records that hold as much of its action each: small
and large force, slow and fast motion, fore and aft, low and high q̄, early and late, and record by
record. The action is what the residual is more without the effect; the size in a half is what
part of the action is there, 1 where it is as large as everywhere.

And it is held beside a model free in form of the stage's own signals (`flexible`): the share of
what that leaves without the effect, that it does not leave with it. A law that such a model takes
up as well says nothing beside it, be it right or wrong: a bend is a function of the force. Then it
is held against that model: one number that leaves no more than a hundred free ones is the law, and
what imitates another leaves more. What comes from outside, as a gust, is no law of those signals,
and is not held so.

Drift counts whatever remains; the free model by how surely more remains than noise and the right
physics may leave, and how much of the gap that is (`remainder`). Both go into one
smooth number, and that into the probability.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from coupled.gap.effects.effect import Effect
from coupled.gap.findings.flexible import free_share
from coupled.gap.findings.where import response, signals
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit, touched
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import (
    DRIFT,
    DRIFT_CHANCE,
    FLEXIBLE_LEFT,
    HOST_DRIFT,
    LEAST_HOLD,
    LEAST_OF_A_HALF,
    LEAST_REMAINDER,
    REMAINDER,
)
from coupled.record.record import Record

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Regime:
    """An effect's size in two halves of the records, over its size in all, and their errors.

    `by` is the signal that divides them, `low` the half where it is the smaller; `freedom` are the
    degrees of freedom of the errors.
    """

    by: str
    low: float
    high: float
    low_error: float
    high_error: float
    freedom: float

    def apart(self, chance: float) -> float:
        """Return by how much the sizes differ beyond what chance does once in 1 / `chance`.

        That is taken off in squares.
        """
        error = math.hypot(self.low_error, self.high_error)
        errors = float(stdtrit(self.freedom, 1.0 - min(chance, 1.0) / 2.0))
        return math.sqrt(max((self.high - self.low) ** 2 - (errors * error) ** 2, 0.0))

    @property
    def p_value(self) -> float:
        """How often chance would part equal sizes so far."""
        error = math.hypot(self.low_error, self.high_error)
        if error == 0.0:
            return 1.0
        away = abs(self.high - self.low) / error
        return float(2.0 * stdtr(self.freedom, -away))

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        sizes = {"low": self.low, "high": self.high}
        errors = {"low_error": self.low_error, "high_error": self.high_error}
        return {"by": self.by, **sizes, **errors, "p": self.p_value}


@dataclass(frozen=True)
class Credibility:
    """Whether an effect is as large everywhere, and what of it a free model would not take.

    `remainder` is how much what remains says against it, 0 to 1 (`remainder`); `beside_flexible`
    and `against_flexible`, what the free model leaves alone over what the effects do, are None
    where next to nothing does. In a stage that is `exact` an effect drifts by less, and leaves
    nothing: what a host works out of q̄ has no noise of its own.
    """

    effect: str
    regimes: tuple[Regime, ...]
    beside_flexible: float | None = None
    against_flexible: float | None = None
    remainder: float = 0.0
    exact: bool = False

    @property
    def drift(self) -> float:
        """How far the sizes of any two halves surely are apart, over the size.

        That is beyond what chance does to any of the halves that were looked at (Bonferroni), in
        `DRIFT_CHANCE` of all effects, where the effect leaves nothing: nearly all such are right,
        and it takes more to doubt one. Of those that leave much few are right, and what chance
        might do is enough.
        """
        chance = (DRIFT_CHANCE / max(len(self.regimes), 1)) ** (1.0 - self.remainder)
        return max((one.apart(chance) for one in self.regimes), default=0.0)

    @property
    def p_value(self) -> float:
        """The least of the halves' p-values, by as many as were looked at (Bonferroni)."""
        least = min((one.p_value for one in self.regimes), default=1.0)
        return min(1.0, least * len(self.regimes))

    @property
    def value(self) -> float:
        """A number from 1, as large everywhere and no function of a signal, to 0; smooth."""
        same = 1.0 / (1.0 + (self.drift / (HOST_DRIFT if self.exact else DRIFT)) ** 4)
        if self.exact:
            return same * (1.0 - self.remainder)
        if self.beside_flexible is None or self.against_flexible is None:
            return same
        needed = FLEXIBLE_LEFT / max(self.beside_flexible, 1e-9)
        needed = min(needed, 1.0 / max(self.against_flexible, 1e-9))
        return same * (1.0 - self.remainder * (1.0 - 1.0 / (1.0 + needed**8)))

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        found: dict[str, Any] = {"value": self.value, "drift": self.drift, "p": self.p_value}
        if self.beside_flexible is not None:
            found |= {"remainder": self.remainder, "beside_flexible": self.beside_flexible}
            found["against_flexible"] = self.against_flexible
        return found | {"regimes": [one.as_dict() for one in self.regimes]}


@dataclass(frozen=True)
class _Acts:
    """An effect's action in one output, and what all the effects leave there, in floors."""

    output: Output
    record: Record
    action: Floats
    left: Floats


def remainder(gap: float, left: float, explained_below: float) -> float:
    """Return how much what remains of a stage says against the effects found, 0 to 1.

    `gap` is that without them, `left` that with them, `explained_below` the one up to which a stage
    is explained. How surely more is left than noise and the right physics may leave, by the power
    beyond the floor's and one half there; and how much that is of the gap: what takes nearly all of
    a wide one seldom imitates.
    """
    more, known = max(left**2 - 1.0, 0.0), explained_below**2 - 1.0
    surely = more**4 / (more**4 + known**4)
    share = more / max(gap**2 - 1.0, more, 1e-9)
    return surely * share / (share + REMAINDER)


def credibility(
    effect: Effect, case: Case, found: Fit, records: Sequence[Record], remains: float
) -> Credibility:
    """Return an effect's credibility, beside what `remains` of its stages (`remainder`)."""
    without = case.with_only(found, [other for other in found.effects if other is not effect])
    acts = []
    for output in touched(case.outputs, [effect]):
        left = output.residual(found.rig)
        action = output.residual(without) - left
        acts.append(_Acts(output, records[output.record], action, left))
    plain = Credibility(effect.name, _regimes(case, acts), remainder=remains)
    if effect.stage == "schedule":
        return replace(plain, exact=True)
    if remains < LEAST_REMAINDER or not acts or effect.signature.drawing == "time":
        return plain
    most = max(acts, key=lambda one: float(one.action @ one.action))
    beside, against = _flexible(case, found, most)
    return replace(plain, beside_flexible=beside, against_flexible=against)


def _flexible(case: Case, found: Fit, one: _Acts) -> tuple[float, float]:
    """Return the share of what a free model leaves without the effect, that it takes beside it.

    And what that model leaves, over what the effects leave without it.
    """
    known = signals(one.output.stage, one.record, case.control, one.output.frame_rate_Hz)
    answers = response(one.output, found.rig, one.record, case.control)
    leaves = []
    for left in (one.left, one.left + one.action):
        share, _ = free_share(one.output, left, known, answers)
        leaves.append(float(left @ left) * (1.0 - share))
    if leaves[1] <= 0.0:
        return 0.0, 0.0
    power = max(float(one.left @ one.left), 1e-300)
    return 1.0 - leaves[0] / leaves[1], leaves[1] / power


def _regimes(case: Case, acts: Sequence[_Acts]) -> tuple[Regime, ...]:
    """Return the sizes in the halves by every signal that divides the effect's action."""
    by: dict[str, list[tuple[_Acts, Floats]]] = {}
    for one in acts:
        for name, signal in _dividing(case, one).items():
            by.setdefault(name, []).append((one, signal))
    if len({one.output.record for one in acts}) > 1:
        by["record"] = [(one, np.full(len(one.left), float(one.output.record))) for one in acts]
    # A floor that is a model's own error is of one sign where the model is off.
    lasting = 1.0 if case.only_wide else 0.0
    found = (_regime(name, parts, lasting) for name, parts in by.items())
    return tuple(one for one in found if one is not None)


def _dividing(case: Case, one: _Acts) -> dict[str, Floats]:
    """Return the signals by which an output's frames are divided in halves."""
    rate_Hz, found = one.output.frame_rate_Hz, dict[str, Floats]()
    for name, signal in signals(one.output.stage, one.record, case.control, rate_Hz).items():
        if name.endswith("sign"):
            if "rate" in name:
                found[name] = signal
        elif name == "time_s" or "pressure" in name:
            found[name] = signal
            if "rate" in name:  # a hysteresis moves as much at any rate, and a lag does not
                found[f"size of {name}"] = np.abs(signal)
        elif "cubed" not in name:
            found[f"size of {name}"] = np.abs(signal - float(np.median(signal)))
    pressure = "dynamic_pressure_Pa"
    if pressure in one.record:
        found[pressure] = smoothed(one.record[pressure])
    return {name: signal for name, signal in found.items() if np.ptp(signal) > 0.0}


def _regime(by: str, parts: Sequence[tuple[_Acts, Floats]], lasting: float) -> Regime | None:
    """Return the sizes in two halves that hold as much of the action each, where they can.

    `lasting` is what of a floor, rms, may be alike in all of a half.
    """
    signal = np.concatenate([signal for _, signal in parts])
    action = np.concatenate([one.action for one, _ in parts])
    left = np.concatenate([one.left for one, _ in parts])
    number = np.concatenate([1000 * one.output.record + one.output.stretches for one, _ in parts])
    power = action**2
    total = float(power.sum())
    if total <= 0.0:
        return None
    order = np.argsort(signal, kind="stable")
    reached = np.cumsum(power[order]) / total
    middle = float(signal[order][int(np.searchsorted(reached, 0.5))])
    low = signal < 0.0 if by.endswith("sign") else signal < middle
    high = signal > 0.0 if by.endswith("sign") else signal >= middle
    if min(float(power[low].sum()), float(power[high].sum())) < LEAST_OF_A_HALF * total:
        return None
    sizes = [_size(action[rows], left[rows], number[rows], lasting) for rows in (low, high)]
    (a, a_error, a_held), (b, b_error, b_held) = sizes
    if min(a_held, b_held) < LEAST_HOLD:
        return None
    squares = (a_error**2, b_error**2)
    apart = squares[0] ** 2 / (a_held - 1.0) + squares[1] ** 2 / (b_held - 1.0)
    freedom = sum(squares) ** 2 / apart if apart > 0.0 else math.inf  # Welch
    return Regime(by, 1.0 + a, 1.0 + b, a_error, b_error, freedom)


def _size(
    action: Floats, left: Floats, number: NDArray[np.intp], lasting: float = 0.0
) -> tuple[float, float, float]:
    """Return how much more of an action a residual holds, its error, and how many hold the action.

    The error is from the stretches, each held against the size that the others have (a jackknife:
    what is fitted to one stretch leaves nothing there), and of a `lasting` part of the residual,
    rms, as large as its share. A limit that is reached in two stretches is in no more than two,
    however long the record: as many as would hold the action alike (Kish).
    """
    power = float(action @ action)
    more = float(left @ action) / power
    names, at = np.unique(number, return_inverse=True)
    scores, held = np.zeros(len(names)), np.zeros(len(names))
    np.add.at(scores, at, (left - more * action) * action)
    np.add.at(held, at, action**2 / power)
    scores /= np.maximum(1.0 - held, 1e-9)
    freedom = len(names) / max(len(names) - 1, 1)
    scatter = math.sqrt(float(scores @ scores) / freedom) / power
    error = math.hypot(scatter, lasting / math.sqrt(power / len(action)))
    return more, error, 1.0 / float(held @ held)
