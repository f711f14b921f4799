"""What else may be the cause: the effects that a record hardly tells from one that was found.

Rivals are tried on stretches that were not fitted, as all effects are; two with as many numbers
are then separated by the whole record, since neither can bend farther than the other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, likelier_by, ranked_by_gain
from coupled.gap.thresholds import BEHIND_GAIN, RIVAL_GAIN


@dataclass(frozen=True)
class Found:
    """One effect found: its gain, and the others that the record does not distinguish from it.

    Those `behind` it were beaten, but by so little that all of the record is to be asked.
    """

    effect: Effect
    gain: float
    probability: float
    rivals: tuple[Candidate, ...]
    behind: tuple[Candidate, ...] = ()


def found_by(best: Candidate, ranked: Sequence[Candidate]) -> Found:
    """Return a found effect with its rivals; what holds it as a special case is none."""
    others = [
        other
        for other in ranked
        if other is not best and len(other.effect.free) <= len(best.effect.free)
    ]
    rivals = tuple(other for other in others if other.gain > best.gain - RIVAL_GAIN)
    close = (other for other in others if other.gain > best.gain - BEHIND_GAIN)
    behind = tuple(other for other in close if other not in rivals)
    weights = sum(weight(best.gain - other.gain) for other in others)
    return Found(best.effect, best.gain, 1.0 / (1.0 + weights), rivals, behind)


def tried_again(case: Case, current: Fit, step: Found) -> Found:
    """Return a step whose rivals are tried again, now that the other effects are known."""
    if not step.rivals:
        return step
    rest = tuple(effect for effect in current.effects if effect is not step.effect)
    without = case.fit(rest, "fitted", current.values)
    tries = [step.effect, *(rival.effect for rival in step.rivals)]
    found = [
        (effect, case.fit((*rest, effect), "fitted", current.values))
        for effect in tries
        if effect not in rest
    ]
    ranked = ranked_by_gain(case.outputs, without, found)
    own = next(candidate for candidate in ranked if candidate.effect is step.effect)
    return replace(found_by(own, ranked), behind=step.behind)


def separated(case: Case, current: Fit, step: Found) -> tuple[Found, Fit]:
    """Return a step without the rivals of as many numbers that all of the record tells from it.

    One that all of the record tells from it for the rival takes its place, and its fit is returned.
    Not beside dry friction, where a fit may stand in a hollow beside its end.
    """
    if is_dry(case.nominal, case.control) or any(effect.dry for effect in current.effects):
        return step, current
    asked = [Candidate(step.gain, step.effect, current)]
    left = list[Candidate]()
    for rival in step.rivals:
        if len(rival.effect.free) != len(step.effect.free) or rival.effect in current.effects:
            left.append(rival)
            continue
        other = [rival.effect if one is step.effect else one for one in current.effects]
        start = {**current.values, **rival.fit.values}
        asked.append(Candidate(rival.gain, rival.effect, case.fit(other, start=start)))
    lacks = [likelier_by(case.outputs, current, one.fit) for one in asked]
    best = asked[lacks.index(min(lacks)) if min(lacks) <= -RIVAL_GAIN else 0]
    odds = 1.0 / step.probability - 1.0
    odds -= sum(weight(step.gain - one.gain) for one in asked[1:])
    for one in asked:
        if one is not best:
            less = likelier_by(case.outputs, best.fit, one.fit)
            odds += weight(less)
            left += [one] if less < RIVAL_GAIN else []
    return Found(best.effect, step.gain, 1.0 / (1.0 + max(odds, 0.0)), tuple(left)), best.fit


def weight(less: float) -> float:
    """Return the likelihood of an effect over the best's, by how much log-likelihood it lacks."""
    return math.exp(min(-less, 0.0))
