"""Whether an effect found is the cause of the residual, or only imitates the cause.

1. Stationarity. A cause has the same size in all regimes; an imitation has not (invariant causal
   prediction: Peters, Bühlmann and Meinshausen, J. R. Statist. Soc. B 78, 2016). The size is
   estimated in halves of the records by force, rate, direction, q̄ and time, and in each record.
   Each half holds half of the power of the effect's contribution to the residual. The size is
   relative to that in all records; its standard error is from the scatter between stretches.
2. Comparison with a nonparametric model of the stage's own signals (`where`), if a residual
   remains. `beside_flexible` is the share of the model's residual that adding the effect removes.
   It is small for a wrong effect, since functions of the signals remove the same. The comparison is
   omitted for random effects, such as gusts. The motion of an aircraft is no
   function of its present signals, so the residual of the airframe counts in full, also against a
   sensor of its motion.
3. Cancellation. If an output has no gap without effects, the action of a cause on this output is
   below the noise. If two effects act by more than the noise and cancel, neither is credible.

The first two weigh more the more residual power remains, of that without the effect (`remainder`):
what another effect explains is no evidence for it. The result is one smooth number that scales the
effect's probability.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.effect import Effect
from coupled.gap.findings.where import free_share, response, signals
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.gap.signals.output import Floats, Output
from coupled.gap.signals.reading import PRESSURE
from coupled.gap.thresholds import DRIFT, DRIFT_CHANCE, FEW, HOST_DRIFT, PARTLY, SMALL
from coupled.record.record import Record


@dataclass(frozen=True)
class Regime:
    """An effect's size in two halves of the records, relative to its size in all, with errors.

    `by` is the signal that divides the records, `low` the half in which it is smaller, `freedom`
    the number of degrees of freedom of the errors.
    """

    by: str
    low: float
    high: float
    low_error: float
    high_error: float
    freedom: float

    @property
    def error(self) -> float:
        """The standard error of the difference of the sizes."""
        return math.hypot(self.low_error, self.high_error)

    def apart(self, chance: float) -> float:
        """Return the difference of the sizes beyond that which has the probability `chance`.

        The difference expected by chance is subtracted in squares.
        """
        errors = float(stdtrit(self.freedom, 1.0 - min(chance, 1.0) / 2.0))
        return math.sqrt(max((self.high - self.low) ** 2 - (errors * self.error) ** 2, 0.0))

    @property
    def p_value(self) -> float:
        """The p-value of the difference if the sizes are equal (two-sided t test)."""
        if self.error == 0.0:
            return 1.0
        return float(2.0 * stdtr(self.freedom, -abs(self.high - self.low) / self.error))

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        known = {name: value for name, value in vars(self).items() if name != "freedom"}
        return known | {"p": self.p_value}


@dataclass(frozen=True)
class Acts:
    """An effect's contribution to one output and the residual with all effects, in floors."""

    output: Output
    record: Record
    action: Floats
    left: Floats


def regimes(case: Case, acts: Sequence[Acts]) -> tuple[Regime, ...]:
    """Return the sizes in halves by every signal that divides the effect's contribution.

    Outputs with at most 2 % of the contribution's power, and their signals, are left out.
    """
    powers = [float(one.action @ one.action) for one in acts]
    acts = [one for one, power in zip(acts, powers, strict=True) if power > FEW * sum(powers)]
    by: dict[str, list[tuple[Acts, Floats]]] = {}
    for one in acts:
        for name, signal in _dividing(case, one).items():
            by.setdefault(name, []).append((one, signal))
    if len({one.output.record for one in acts}) > 1:
        by["record"] = [(one, np.full(len(one.left), float(one.output.record))) for one in acts]
    # If the floor is a model error, it may have one sign throughout a half.
    lasting = 1.0 if case.model_error_in_floors else 0.0
    found = (_regime(name, parts, lasting) for name, parts in by.items())
    return tuple(one for one in found if one is not None)


def _dividing(case: Case, one: Acts) -> dict[str, Floats]:
    """Return the signals by which an output's frames are divided into halves."""
    found = dict[str, Floats]()
    for name, signal in signals(one.output, one.left, one.record, case.control).items():
        if name.endswith("sign"):
            if "rate" in name:
                found[name] = signal
        elif name == "time_s" or "pressure" in name:
            found[name] = signal
            if "rate" in name:  # separates hysteresis, independent of the rate, from a lag
                found[f"size of {name}"] = np.abs(signal)
        elif "cubed" not in name:
            found[f"size of {name}"] = np.abs(signal - float(np.median(signal)))
    if PRESSURE in one.record:
        found[PRESSURE] = smoothed(one.record[PRESSURE])
    return {name: signal for name, signal in found.items() if np.ptp(signal) > 0.0}


def _regime(by: str, parts: Sequence[tuple[Acts, Floats]], lasting: float) -> Regime | None:
    """Return the sizes in two halves with equal power of the contribution; None if impossible.

    `lasting` is the rms of an error that may be constant in a half, in floors.
    """
    columns = [
        (signal, one.action, one.left, 1000 * one.output.record + one.output.stretches)
        for one, signal in parts
    ]
    signal, action, left, number = map(np.concatenate, zip(*columns, strict=True))
    power = action**2
    total = float(power.sum())
    if total <= 0.0:
        return None
    order = np.argsort(signal, kind="stable")
    reached = np.cumsum(power[order]) / total
    middle = float(signal[order][int(np.searchsorted(reached, 0.5))])
    low, high = signal < middle, signal >= middle
    if by.endswith("sign"):
        low, high = signal < 0.0, signal > 0.0
    if min(float(power[low].sum()), float(power[high].sum())) < SMALL * total:
        return None
    sizes = [_size(action[rows], left[rows], number[rows], lasting) for rows in (low, high)]
    (a, a_error, a_held), (b, b_error, b_held) = sizes
    if min(a_held, b_held) < 2.0:  # one has no scatter
        return None
    squares = (a_error**2, b_error**2)
    apart = squares[0] ** 2 / (a_held - 1.0) + squares[1] ** 2 / (b_held - 1.0)
    freedom = sum(squares) ** 2 / apart if apart > 0.0 else math.inf  # Welch
    return Regime(by, 1.0 + a, 1.0 + b, a_error, b_error, freedom)


def _size(
    action: Floats, left: Floats, number: NDArray[np.intp], lasting: float = 0.0
) -> tuple[float, float, float]:
    """Return the relative error of an action in a residual, its standard error and sample size.

    The standard error is from a jackknife over stretches, plus a `lasting` error of the residual,
    rms, in proportion to the action. The sample size is the effective number of stretches with
    the action (Kish).
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


@dataclass(frozen=True)
class Credibility:
    """Results of the tests of one effect.

    `remainder` is the weight of the residual that remains, 0 to 1 (`remainder`); `beside_flexible`
    is None if hardly any does. `in_full`: none may remain, since the model of signals has no
    power. `exact`: the host computes the stage without noise, so the limit of the drift is lower
    too. `undone` is the power of the effect's action on an output without a gap, relative to the
    power that its limit allows, less 1: the largest of all outputs, at least 0.
    """

    regimes: tuple[Regime, ...]
    beside_flexible: float | None = None
    remainder: float = 0.0
    exact: bool = False
    in_full: bool = False
    undone: float = 0.0

    @property
    def drift(self) -> float:
        """The largest significant difference of the sizes in two halves, relative to the size.

        The significance level is `DRIFT_CHANCE` over the number of pairs (Bonferroni) without a
        residual, since nearly all such effects are correct. It rises to 1 with the residual.
        """
        chance = (DRIFT_CHANCE / max(len(self.regimes), 1)) ** (1.0 - self.remainder)
        return max((one.apart(chance) for one in self.regimes), default=0.0)

    @property
    def p_value(self) -> float:
        """The least p-value of all pairs of halves, corrected for their number (Bonferroni)."""
        least = min((one.p_value for one in self.regimes), default=1.0)
        return min(1.0, least * len(self.regimes))

    @property
    def value(self) -> float:
        """The credibility: 1 for a stationary size that the signals do not replace, down to 0."""
        same = 1.0 / (1.0 + (self.drift / (HOST_DRIFT if self.exact else DRIFT)) ** 4)
        same /= 1.0 + self.undone**2
        if self.exact or self.in_full:
            return same * (1.0 - self.remainder)
        if self.beside_flexible is None:
            return same
        needed = (1.0 - PARTLY) / max(self.beside_flexible, 1e-9)
        return same * (1.0 - self.remainder * (1.0 - 1.0 / (1.0 + needed**8)))

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        found: dict[str, Any] = {"value": self.value, "drift": self.drift, "p": self.p_value}
        if self.undone > 0.0:
            found["undone"] = self.undone
        if self.beside_flexible is not None:
            found |= {"remainder": self.remainder, "beside_flexible": self.beside_flexible}
        return found | {"regimes": [one.as_dict() for one in self.regimes]}


def remainder(gap: float, left: float, explained_below: float, own: float = 1.0) -> float:
    """Return the weight of a stage's remaining residual as evidence against its effects, 0 to 1.

    `gap` is the gap without the effect in question, beside all others, `left` that with it,
    `explained_below` the largest gap of an explained stage. The weight grows with the excess of
    `left` over it, and with the share of the gap that remains: an effect that removes nearly all of
    a large gap is usually correct. `own` is the gap that remains even if a nonparametric model is
    fitted with the effects. No function of the stage's signals explains it, so it is not evidence
    against a law.
    """
    error = max(own, 1.0) ** 2
    more, known = max(left**2 - error, 0.0), explained_below**2 - 1.0
    surely = more**4 / (more**4 + known**4)
    share = more / max(gap**2 - error, more, 1e-9)
    return surely * share / (share + FEW)


def credibility(
    effect: Effect, case: Case, found: Fit, records: Sequence[Record], remains: float
) -> Credibility:
    """Return an effect's credibility; `remains` is the weight of the residual (`remainder`)."""
    acts = [Acts(one, records[one.record], *each) for one, *each in case.actions(found, effect)]
    undone = _undone(case, found, acts)
    plain = Credibility(regimes(case, acts), remainder=remains, undone=undone)
    if effect.stage == "schedule":
        return replace(plain, exact=True)
    if remains < FEW or not acts or effect.sampled is not None:
        return plain
    if {*effect.shows_in} == {AIRFRAME}:
        return replace(plain, in_full=True)
    most = max(acts, key=lambda one: float(one.action @ one.action))
    return replace(plain, beside_flexible=_beside_flexible(case, found, most))


def _undone(case: Case, found: Fit, acts: Sequence[Acts]) -> float:
    """Return the excess action of an effect on outputs without a gap (`Credibility.undone`)."""
    if len(found.effects) < 2:
        return 0.0
    bare, most = case.with_only(found, ()), 0.0
    for one in acts:
        room = one.output.limit**2 - 1.0
        if one.output.gap(bare) <= one.output.limit:
            most = max(most, float(np.mean(one.action**2)) / room - 1.0)
    return most


def _beside_flexible(case: Case, found: Fit, one: Acts) -> float:
    """Return the share of the nonparametric model's residual power that an effect removes."""
    known = signals(one.output, one.left, one.record, case.control)
    answers = response(one.output, found.rig, one.record, case.control)
    leaves = []
    for left in (one.left, one.left + one.action):
        share, _ = free_share(one.output, left, known, answers)
        leaves.append(float(left @ left) * (1.0 - share))
    return 1.0 - leaves[0] / leaves[1] if leaves[1] > 0.0 else 0.0
