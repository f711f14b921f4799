"""Whether an effect found is the cause of the residual, or only imitates the cause.

1. Stationarity. A cause has the same size in all regimes; an imitation has not (invariant causal
   prediction: Peters, Bühlmann and Meinshausen, J. R. Statist. Soc. B 78, 2016). The size is
   estimated in halves of the records by force, rate, direction, q̄ and time, and in each record.
   Each half holds half of the power of the effect's contribution to the residual.
2. Comparison with a nonparametric model of the stage's own signals (`flexible`), if a residual
   remains. `beside_flexible` is the share of the model's residual that adding the effect removes.
   If the model can represent the effect, this share is small for correct and wrong effects alike.
   Then `against_flexible` decides: a correct effect, with one parameter, leaves no more than the
   model with a hundred. Both are omitted for effects from outside the stage, such as gusts.
3. Two friction laws found together that put the friction below its filed value fit an arbitrary
   curve over speed (`part_of_a_curve`).

Tests 1 and 2 weigh more the more residual power remains (`remainder`). The result is one smooth
number that scales the effect's probability.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from scipy.special import ndtr

from coupled.gap.effects.effect import Effect, Parameter, Signature, touched, value_of
from coupled.gap.findings.flexible import free_share
from coupled.gap.findings.regimes import Acts, Regime, regimes
from coupled.gap.findings.where import response, signals
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.gap.thresholds import (
    DRIFT,
    DRIFT_CHANCE,
    FLEXIBLE_LEFT,
    HOST_DRIFT,
    LEAST_REMAINDER,
    REMAINDER,
    UNPROVEN,
)
from coupled.record.record import Record

LAW_OF_SPEED = Signature("speed", "missing")  # signature of a force that depends on speed


@dataclass(frozen=True)
class Credibility:
    """Results of the tests of one effect.

    `remainder` is the weight of the residual that remains, 0 to 1 (`remainder`). `beside_flexible`
    and `against_flexible` (residual power of the nonparametric model over that with the effects)
    are None if hardly any residual remains. `exact`: the stage is computed by the host without
    noise, so the limit of the drift is lower and no residual may remain. `curve` is the
    probability that the effect is part of an arbitrary curve over speed (`part_of_a_curve`).
    """

    effect: str
    regimes: tuple[Regime, ...]
    beside_flexible: float | None = None
    against_flexible: float | None = None
    remainder: float = 0.0
    exact: bool = False
    curve: float = 0.0

    @property
    def drift(self) -> float:
        """The largest significant difference of the sizes in two halves, relative to the size.

        The significance level is `DRIFT_CHANCE` over the number of pairs (Bonferroni) if the
        effects leave no residual, since nearly all such effects are correct. It rises to 1 with
        the residual that remains.
        """
        chance = (DRIFT_CHANCE / max(len(self.regimes), 1)) ** (1.0 - self.remainder)
        return max((one.apart(chance) for one in self.regimes), default=0.0)

    @property
    def p_value(self) -> float:
        """The least p-value of all pairs of halves, corrected for their number (Bonferroni)."""
        least = min((one.p_value for one in self.regimes), default=1.0)
        return min(1.0, least * len(self.regimes))

    @property
    def unproven(self) -> float:
        """The standard error of the best known difference, weighted by the remaining residual.

        If it is large, the records do not show that the size is the same in all regimes.
        """
        errors = (math.hypot(one.low_error, one.high_error) for one in self.regimes)
        return self.remainder * min(errors, default=0.0)

    @property
    def value(self) -> float:
        """The credibility: 1 for a stationary size that the signals do not replace, down to 0."""
        same = 1.0 / (1.0 + (self.drift / (HOST_DRIFT if self.exact else DRIFT)) ** 4)
        same *= (1.0 - self.curve) / (1.0 + (self.unproven / UNPROVEN) ** 4)
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
        if self.curve > 0.0:
            found["curve"] = self.curve
        return found | {"regimes": [one.as_dict() for one in self.regimes]}


def remainder(gap: float, left: float, explained_below: float, own: float = 1.0) -> float:
    """Return the weight of a stage's remaining residual as evidence against its effects, 0 to 1.

    `gap` is the gap without effects, `left` that with them, `explained_below` the largest gap of
    an explained stage. The weight grows with the excess of `left` over `explained_below`, and with
    the share of the gap that remains: effects that remove nearly all of a large gap are usually
    correct. `own` is the machine's own error, the gap that also a nonparametric model beside the
    effects leaves: no function of the stage's signals, and no evidence against a law.
    """
    error = max(own, 1.0) ** 2
    more, known = max(left**2 - error, 0.0), explained_below**2 - 1.0
    surely = more**4 / (more**4 + known**4)
    share = more / max(gap**2 - error, more, 1e-9)
    return surely * share / (share + REMAINDER)


def credibility(
    effect: Effect, case: Case, found: Fit, records: Sequence[Record], remains: float
) -> Credibility:
    """Return an effect's credibility; `remains` is the weight of the residual (`remainder`)."""
    without = case.with_only(found, [other for other in found.effects if other is not effect])
    acts = []
    for output in touched(case.outputs, [effect]):
        left = output.residual(found.rig)
        action = output.residual(without) - left
        acts.append(Acts(output, records[output.record], action, left))
    curve = part_of_a_curve(effect, case, found)
    plain = Credibility(effect.name, regimes(case, acts), remainder=remains, curve=curve)
    if effect.stage == "schedule":
        return replace(plain, exact=True)
    if remains < LEAST_REMAINDER or not acts or effect.signature.drawing == "time":
        return plain
    most = max(acts, key=lambda one: float(one.action @ one.action))
    beside, against = _flexible(case, found, most)
    return replace(plain, beside_flexible=beside, against_flexible=against)


def part_of_a_curve(effect: Effect, case: Case, found: Fit) -> float:
    """Return the probability that an effect is part of an arbitrary curve over speed, 0 to 1.

    Stribeck friction and damping together have four parameters and fit almost any curve. They are
    a breakaway only if the fitted friction exceeds the filed one. A fitted friction below the
    filed one at all speeds imitates another law.
    """
    by_speed = [one for one in found.effects if one.free and one.signature == LAW_OF_SPEED]
    if effect not in by_speed or len(by_speed) < 2:
        return 0.0
    below = (_surely_below(case, found, one, p) for one in by_speed for p in one.free if p.above)
    return max(below, default=0.0)


def _surely_below(case: Case, found: Fit, law: Effect, breakaway: Parameter) -> float:
    """Return the probability that the fitted friction is below the filed one at all speeds."""
    assert breakaway.above
    sure = 1.0
    filed = max(
        float(value_of(case.nominal, case.control, k)) for k in (breakaway.above, breakaway.key)
    )
    for p in law.free:
        if p.key in (breakaway.above, breakaway.key):
            key = law.value_key(p)
            error = (found.high[key] - found.low[key]) / (2.0 * 1.96)
            less = filed - float(value_of(found.rig, case.control, p.key))
            sure *= float(ndtr(less / error)) if error > 0.0 else float(less > 0.0)
    return sure


def _flexible(case: Case, found: Fit, one: Acts) -> tuple[float, float]:
    """Return `beside_flexible` and `against_flexible` of an effect in one output.

    These are the share of the nonparametric model's residual power that the effect removes, and
    that residual power, without the effect, over the power that the effects leave.
    """
    known = signals(one.output, one.left, one.record, case.control)
    answers = response(one.output, found.rig, one.record, case.control)
    leaves = []
    for left in (one.left, one.left + one.action):
        share, _ = free_share(one.output, left, known, answers)
        leaves.append(float(left @ left) * (1.0 - share))
    if leaves[1] <= 0.0:
        return 0.0, 0.0
    power = max(float(one.left @ one.left), 1e-300)
    return 1.0 - leaves[0] / leaves[1], leaves[1] / power
