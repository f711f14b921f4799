"""Two effects that are one law in a limit: each is asked wherever the other was found.

A short lag of the modifying force takes damping away, and the zero of a gauge is an offset of the
loader where nothing bends. Half of a record may leave open which it is, or a setting beside one of
them may hide it; then all of the record decides, or leaves both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import ONE_LAW
from coupled.gap.search.case import Case
from coupled.gap.search.contest import contested
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, likelier_by
from coupled.gap.search.rivals import Found, weight
from coupled.gap.search.screen import screened
from coupled.gap.thresholds import RIVAL_GAIN


def same_in_a_limit(
    case: Case, library: Sequence[Effect], current: Fit, step: Found
) -> tuple[Found, Fit]:
    """Return a step with the effect that is its law in a limit, if that may be it, and the fit.

    That one is its rival where all of the record does not tell them apart, and takes its place
    where it does so for it. Beside dry friction one may stand in a hollow: the other is fitted with
    its contact sought anew, too, and the one found again from where that ended.
    """
    other = _other(case, library, step.effect, current)
    if other is None:
        return step, current
    fits = contested(case, current, step.effect, other, _starts(case, current, step, other))
    if fits is None:
        return step, current
    here, there = fits
    less = likelier_by(case.outputs, here, there)
    others = tuple(rival for rival in step.rivals if rival.effect is not other)
    odds = 1.0 / step.probability - 1.0
    odds -= sum(weight(step.gain - r.gain) for r in step.rivals if r.effect is other)
    tied = abs(less) < RIVAL_GAIN
    if less <= -RIVAL_GAIN or (tied and step.effect.name in other.swallows):
        here, there, less = there, here, -less
        other, step = step.effect, replace(step, effect=other)
    rival = (Candidate(step.gain - less, other, there),) if tied else ()
    probability = 1.0 / (1.0 + max(odds, 0.0) + weight(less))
    return Found(step.effect, step.gain, probability, (*rival, *others)), here


def _other(case: Case, library: Sequence[Effect], effect: Effect, current: Fit) -> Effect | None:
    """Return the effect that is the same law in a limit, if it was not found as well."""
    judged = {output.stage for output in case.outputs}
    pair = next((pair for pair in ONE_LAW if effect.name in pair), ())
    named = (one for one in library if one.name in pair and one is not effect)
    shown = (one for one in named if judged & {*one.shows_in})
    return next((one for one in shown if one not in current.effects), None)


def _starts(case: Case, current: Fit, step: Found, other: Effect) -> list[dict[str, float]]:
    """Return where the fit of the other law begins: with the contact as it is, and sought anew."""
    rest = tuple(effect for effect in current.effects if effect is not step.effect)
    sizes = screened(case, replace(current, effects=rest), other)[1]
    begun = {**current.values, **(sizes[0] if sizes else {})}
    anew = case.but_for_contact(begun)
    return [begun, anew] if anew != begun else [begun]
