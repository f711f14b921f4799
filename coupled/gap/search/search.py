"""The search for effects, and a second one with those in reserve, which pass for others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.search.case import Case
from coupled.gap.search.choose import Choice, searched
from coupled.gap.search.courses import in_time
from coupled.gap.search.gain import likelier_by, ranked_by_gain
from coupled.gap.signals.output import explained_below, stage_gaps, stage_limits
from coupled.gap.thresholds import LATER_LEFT, LATER_TRIED, LEAST_GAIN, RIVAL_GAIN


def search(case: Case, library: Sequence[Effect] = EFFECTS) -> tuple[Case, Choice]:
    """Return the effects that explain a record's gap, and the case with the floors they leave.

    What a gap does passes for noise. Where a rig with the effects found leaves less of it, the
    search is made again over that, as long as less comes out; what it then finds has to be as
    likely as what was found before.
    """
    case = case.surely_open()
    found = _search(case, library)
    while True:
        anew = case.heard_anew(found.fit.rig) if found.steps else None
        if anew is not None:
            case, found = anew, _kept(anew, found, _search(anew, library))
            continue
        later = _later(case, found, library)
        if later is None:
            return case, found
        case, found = later


def _kept(case: Case, before: Choice, again: Choice) -> Choice:
    """Return what a search found again, or what it found before where all of the record is for it.

    A search may end in a hollow beside dry friction, by whichever floors. What was found before has
    no more numbers then, and is fitted anew by these floors.
    """
    numbers = [sum(len(one.free) for one in choice.fit.effects) for choice in (before, again)]
    if set(before.fit.effects) == set(again.fit.effects) or numbers[0] > numbers[1]:
        return again
    fitted = case.fit(before.fit.effects, start=before.fit.values)
    if likelier_by(case.outputs, again.fit, fitted) > -RIVAL_GAIN:
        return again
    return replace(before, fit=fitted, settled=again.settled, halves=None)


def _later(case: Case, found: Choice, library: Sequence[Effect]) -> tuple[Case, Choice] | None:
    """Return the case in which an effect's size goes with time, where that explains far more.

    What else was found may only have taken up what the course of this one leaves. One that grows
    late may gain nothing as long as it is the same all the time: then what did best is tried.
    """
    wide = _unexplained(case, found)
    gains = {step.effect.name: step.gain for step in found.steps} or found.tried
    first = sorted(gains, key=lambda name: -gains[name])[:LATER_TRIED]
    for effect in (BY_NAME[name] for name in first):
        anew = in_time(effect, case) if wide & set(effect.shows_in) else None
        if anew is None:
            continue
        choice = _search(anew, library)
        kept = any(anew.timing(one) is not None for one in choice.fit.effects)
        if kept and _left(anew, choice) < LATER_LEFT * _left(case, found):
            return anew, choice
    return None


def _search(case: Case, library: Sequence[Effect]) -> Choice:
    """Return the effects that explain a case's gap.

    An effect in reserve passes for others, and takes part in a second search alone: where the first
    leaves more of its stage than noise, or has found an effect of a number that it frees, too. Its
    answer must gain as any effect must.
    """
    plain = [effect for effect in library if not effect.reserve]
    found = searched(case, plain)
    open_ones = case.over_limit(found.fit.rig)
    freed = {p.key for step in found.steps for p in step.effect.free}
    more = [
        effect
        for effect in library
        if effect.reserve
        and (open_ones & set(effect.shows_in) or any(p.key in freed for p in effect.free))
    ]
    if not more:
        return found
    other = searched(case, [*more, *plain])
    return other if _gain(case, found, other) >= LEAST_GAIN else found


def _unexplained(case: Case, choice: Choice) -> set[str]:
    """Return the outputs that the effects found leave wider than noise and right physics could."""
    first, limits = stage_gaps(case.outputs, choice.settled.rig), stage_limits(case.outputs)
    left = case.gaps(choice.fit.rig)
    return {at for at, gap in left.items() if gap > explained_below(first[at], limits[at])}


def _gain(case: Case, first: Choice, second: Choice) -> float:
    """Return the held-out log-likelihood by which the second answer beats the first."""
    each = [case.fit(one.fit.effects, "fitted", one.fit.values) for one in (first, second)]
    shown = [(effect, each[1]) for effect in second.fit.effects[:1]]
    ranked = ranked_by_gain(case.outputs, each[0], shown)
    return ranked[0].gain if ranked else 0.0


def _left(case: Case, choice: Choice) -> float:
    """Return what a choice leaves of all outputs, the sum of their mean squares over noise's."""
    return sum(output.gap(choice.fit.rig) ** 2 - 1.0 for output in case.outputs)
