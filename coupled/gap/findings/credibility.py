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

A friction that is nowhere above the filed one is, with a damping beside it, a mere curve of the
speed (`part_of_a_curve`). Drift counts whatever remains, and that a size is hardly known where much
does; the free model by how surely more remains than noise and the right
physics may leave, and how much of the gap that is (`remainder`). Both go into one
smooth number, and that into the probability.
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

LAW_OF_SPEED = Signature("speed", "missing")  # how a force by the speed is drawn


@dataclass(frozen=True)
class Credibility:
    """Whether an effect is as large everywhere, and what of it a free model would not take.

    `remainder` is how much what remains says against it, 0 to 1 (`remainder`); `beside_flexible`
    and `against_flexible`, what the free model leaves alone over what the effects do, are None
    where next to nothing does. In a stage that is `exact` an effect drifts by less, and leaves
    nothing: what a host works out of q̄ has no noise of its own. `curve` is how surely it is part of
    a mere curve of the speed (`part_of_a_curve`).
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
    def unproven(self) -> float:
        """How far the sizes of halves may be apart, where what remains says that they might be.

        By the halves that are known best: a size that none of them says to a quarter is not shown
        to be the same.
        """
        errors = (math.hypot(one.low_error, one.high_error) for one in self.regimes)
        return self.remainder * min(errors, default=0.0)

    @property
    def value(self) -> float:
        """A number from 1, as large everywhere and no function of a signal, to 0; smooth."""
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
    """Return how surely an effect is part of a mere curve of the speed, 0 to 1.

    A friction that fades with speed and a damping are together any curve of it, in four numbers.
    They are a breakaway where that stands above the friction that is filed. Where friction is
    below that at any speed, they draw what another law of the speed does.
    """
    by_speed = [one for one in found.effects if one.free and one.signature == LAW_OF_SPEED]
    if effect not in by_speed or len(by_speed) < 2:
        return 0.0
    below = (_surely_below(case, found, one, p) for one in by_speed for p in one.free if p.above)
    return max(below, default=0.0)


def _surely_below(case: Case, found: Fit, law: Effect, breakaway: Parameter) -> float:
    """Return how surely a law's friction is below what is filed, at rest and in motion."""
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
