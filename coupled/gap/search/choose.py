"""Choosing effects: each has to earn its place on stretches of the record not used to fit it.

Guilty stages are those whose residual stands clear of its floor. Their candidates are
screened by the projection of the residual on each effect's own signature, the best fitted
as physics on every other stretch, and judged on the stretches between. The gain is a
log-likelihood ratio by effective samples, the frames divided by the residual's memory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.anew import with_contact_anew, with_settings_anew
from coupled.gap.search.candidates import Ends, fitted_candidates
from coupled.gap.search.case import Case
from coupled.gap.search.contest import distinguished, in_place_of_open, overtaken, switched
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, ranked_by_gain
from coupled.gap.search.information import is_open, may_be_plainer, shape_is_open
from coupled.gap.search.intwo import in_two
from coupled.gap.search.onelaw import same_in_a_limit
from coupled.gap.search.richer import plainer_on_all, richer_on_all, with_richer_rivals
from coupled.gap.search.rivals import Found, found_by, separated, tried_again
from coupled.gap.search.small import beside_a_larger, shown_by_mark, strained, taken_by_switch
from coupled.gap.search.twolaws import plain_reading, read_even, yielding_reading
from coupled.gap.signals.output import explained_below, stage_gaps, stage_limits
from coupled.gap.thresholds import (
    LEAST_GAIN,
    MOST_EFFECTS,
    NEEDLESS_GAIN,
    RIVAL_GAIN,
    SIMPLER_GAIN,
    SIMPLER_SHARE,
)


@dataclass(frozen=True)
class Choice:
    """What the search found: its steps, and the final fit on all of the record.

    `settled` has the nominal rig's settings moved within their tolerance, and no effect. `halves`
    is the fit of the same effects on every other stretch, where the search ended with one. A search
    that `circled` was ended where it came back to effects that it had stood at before.
    """

    steps: tuple[Found, ...]
    fit: Fit
    settled: Fit
    tried: dict[str, float] = field(default_factory=dict)  # first round's gains by effect
    rounds: tuple[dict[str, float], ...] = ()  # every round's, the last one's won by none
    circled: bool = False
    halves: Fit | None = None


def searched(case: Case, library: Sequence[Effect]) -> Choice:
    """Return the effects of a library that explain a case's gap, each earning its place in turn."""
    settled = current = case.fit(())
    steps: list[Found] = []
    rounds: list[dict[str, float]] = []
    idle: set[str] = set()  # guilty outputs for which nothing was found
    ends: dict[str, Mapping[str, float]] = {}  # where each candidate's last fit ended
    stood = [settled]  # the fits that the search has stood at
    circled, halves = False, None
    while len(steps) < MOST_EFFECTS:
        ranked = _round(case, settled, current, library, idle, ends)
        rounds.append({candidate.effect.name: candidate.gain for candidate in ranked})
        ends |= {one.effect.name: one.fit.values for one in ranked}
        if not ranked or ranked[0].gain < LEAST_GAIN:
            break
        best = _simplest(case, settled, ranked)
        steps.append(found_by(best, ranked))
        halves = found = best.fit
        current = case.fit((*current.effects, best.effect), start=found.values, near=found)
        current = with_settings_anew(case, with_contact_anew(case, current))
        idle -= set(best.effect.shows_in)
        held = [step for step in steps if _holds(best.effect, step.effect)]
        if held:
            steps = [step for step in steps if step not in held]
            current = case.fit([step.effect for step in steps], start=current.values)
        even = read_even(case, current)
        if even is not None:
            read = even[0][len(current.effects) - 1 :]
            current = case.fit(even[0], start=even[1])
            steps[-1:] = [replace(steps[-1], effect=effect, rivals=()) for effect in read]
            continue
        dropped = set[Effect]()
        while (needless := _needless(case, current)) is not None:
            dropped.add(needless)
            steps = [step for step in steps if step.effect is not needless]
            current = _with_only(case, stood, steps, current)
        if best.effect in dropped:
            break
        # Effects that displace one another would be found and dropped without end.
        circled = bool(dropped) and any(set(one.effects) == set(current.effects) for one in stood)
        if circled:
            break
        stood.append(current)
    steps, current = _looked_over(case, library, stood, steps, current)
    tried = next((gains for gains in rounds if gains), {})
    if halves is not None and halves.effects != current.effects:
        halves = None
    return Choice(tuple(steps), current, settled, tried, tuple(rounds), circled, halves)


def _looked_over(
    case: Case, library: Sequence[Effect], stood: list[Fit], steps: list[Found], current: Fit
) -> tuple[list[Found], Fit]:
    """Return the steps and the fit, each effect looked at once more beside all the others."""
    before = set(current.effects)
    if len(steps) > 1:
        steps, current = _law_again(case, stood[0], library, steps, current)
    steps, current = plainer_on_all(case, library, steps, current)
    steps, current = richer_on_all(case, library, steps, current)
    yields = yielding_reading(case, current)
    if yields is not None:
        plain, law, start = yields
        steps = [replace(one, effect=law) if one.effect is plain else one for one in steps]
        current = case.fit([one.effect for one in steps], start=start)
    steps, current = in_place_of_open(case, steps, current)
    empty = [step for step in steps if is_open(case, step.effect, current)]
    if empty:
        steps = [step for step in steps if step not in empty]
        current = _with_only(case, stood, steps, current)
    if len(steps) > 1:
        steps = [tried_again(case, current, step) for step in steps]
    last = []
    for step in steps:
        one, current = switched(case, library, current, step)
        one, current = overtaken(case, current, one)
        one, current = separated(case, current, one)
        one, current = distinguished(case, current, one)
        one, current = same_in_a_limit(case, library, current, one)
        last.append(one)
    # What took another's place may leave nothing to one that was found beside it.
    rest = [step for step in last if not is_open(case, step.effect, current)]
    if len(rest) == len(last) and set(current.effects) != before:
        needless = _needless(case, current)
        rest = [step for step in last if step.effect is not needless]
    if len(rest) == len(last):
        return with_richer_rivals(case, library, last, current), current
    return _looked_over(case, library, stood, rest, _with_only(case, stood, rest, current))


def _with_only(case: Case, stood: Sequence[Fit], steps: Sequence[Found], current: Fit) -> Fit:
    """Return the fit of the effects that are left, or the one that did better before others."""
    effects = [step.effect for step in steps]
    before = [one for one in stood if set(one.effects) == set(effects)]
    return min([case.fit(effects, start=current.values), *before], key=lambda one: one.cost)


def _law_again(
    case: Case, settled: Fit, library: Sequence[Effect], steps: list[Found], current: Fit
) -> tuple[list[Found], Fit]:
    """Return the steps and the fit with the law of dry friction that the other effects leave.

    Beside what was not found yet, plain friction passed for a richer law, or such a law took up
    what that leaves of plain friction.
    """
    law = next((one for one in current.effects if _is_open_law(case, library, one, current)), None)
    if law is None:
        return steps, current
    rest = tuple(effect for effect in current.effects if effect is not law)
    without = case.fit(rest, "fitted", current.values)
    dry = [effect for effect in library if effect.dry]
    ranked = fitted_candidates(case, without, dry, set(law.shows_in))
    best = _simplest(case, settled, ranked) if ranked else None
    if best is None or best.gain < LEAST_GAIN:
        return steps, current
    plainer = law.alike is not None and best.effect.name == law.alike.plainer
    if not plainer and (law.alike is not None or best.effect.alike is None):
        return steps, current
    found = found_by(best, ranked)
    steps = [found if one.effect is law else one for one in steps]
    effects = [one.effect for one in steps]
    return steps, case.fit(effects, start=best.fit.values, near=best.fit)


def _is_open_law(case: Case, library: Sequence[Effect], effect: Effect, current: Fit) -> bool:
    """Tell whether an effect is plain friction, or a law that may be plain friction after all."""
    if effect.alike is None:
        return bool(effect.yielding)
    plainer = (one for one in library if one.name == effect.alike.plainer)
    return any(may_be_plainer(case, effect, current, one) for one in plainer)


def _holds(effect: Effect, other: Effect) -> bool:
    """Tell whether an effect in reserve frees all numbers of another, and more."""
    return effect.reserve and {p.key for p in other.free} < {p.key for p in effect.free}


def _needless(case: Case, current: Fit) -> Effect | None:
    """Return the effect found earlier that those found since have made needless, if any."""
    if len(current.effects) < 2:
        return None
    whole = case.fit(current.effects, "fitted", current.values, near=current)
    least: tuple[float, Effect] | None = None
    for effect in current.effects[:-1]:
        rest = tuple(other for other in current.effects if other is not effect)
        without = case.fit(rest, "fitted", current.values)
        missed = ranked_by_gain(case.outputs, without, [(effect, whole)])[0].gain
        needless = missed < NEEDLESS_GAIN or _is_explained_without(case, effect, without)
        if needless and (least is None or missed < least[0]):
            least = (missed, effect)
    return None if least is None else least[1]


def _is_explained_without(case: Case, effect: Effect, without: Fit) -> bool:
    """Tell whether the outputs of an effect are within their limits without it.

    Not of a number with a tolerance, whose neighbours may hide it, nor of a discrete effect, which
    may be known by its signature.
    """
    if not effect.free or effect.name in case.known:
        return False
    gaps, limits = case.gaps(without.rig), stage_limits(case.outputs)
    return all(gaps[at] <= limits[at] for at in effect.shows_in if at in gaps)


def _simplest(case: Case, settled: Fit, ranked: Sequence[Candidate]) -> Candidate:
    """Return the best candidate, or one with fewer numbers that is as good.

    Where the one with fewer closes a gap of the loader, the other must beat it by more than the
    physics of a right effect may leave: no law of dry friction is exact. And the richer of two laws
    must say by its own interval that it is not the plainer one: its other numbers, and the contact
    beside it, also take up what noise has moved of a contact that yields. So does a loop or a mode
    of the bend with the noise of the force, which it filters.
    """
    best = ranked[0]
    first, limits = stage_gaps(case.outputs, settled.rig), stage_limits(case.outputs)
    for other in ranked[1:]:
        if len(other.effect.free) >= len(best.effect.free):
            continue
        left = stage_gaps(case.outputs, other.fit.rig)
        closes = all(
            left[stage] <= explained_below(first[stage], limits[stage])
            for stage in other.effect.shows_in
            if stage in left
        )
        doubtful = closes and best.effect.stage == "loader"
        if doubtful and may_be_plainer(case, best.effect, best.fit, other.effect):
            best = other
            continue
        share = SIMPLER_SHARE * ranked[0].gain
        margin = max(SIMPLER_GAIN, share) if doubtful else RIVAL_GAIN
        if closes and shape_is_open(case, best.effect, best.fit, other.effect):
            margin = max(margin, LEAST_GAIN + RIVAL_GAIN)
        if other.gain > ranked[0].gain - margin:
            best = other
    return plain_reading(best, ranked)


def _round(
    case: Case,
    settled: Fit,
    current: Fit,
    library: Sequence[Effect],
    idle: set[str],
    ends: Ends,
) -> list[Candidate]:
    """Return the candidates of one guilty output by their held-out gain, best first.

    Outputs are taken by their gap, each for itself: what explains one has no say in what is tried
    for another. One where nothing gains is `idle`, and not tried again until it changes.
    """
    first = case.gaps(settled.rig)
    now = case.gaps(current.rig)
    limits = stage_limits(case.outputs)
    wide = {at for at, gap in now.items() if gap > explained_below(first[at], limits[at])}
    tried: list[Candidate] = []
    for output in sorted(wide - idle, key=lambda at: -now[at]):
        ranked = fitted_candidates(case, current, library, {output}, ends=ends)
        if output == "loader" and _sticks_elsewhere(case, current, ranked):
            short = fitted_candidates(case, current, library, {output}, ends=ends, short=True)
            ranked = max(ranked, short, key=lambda one: one[0].gain if one else -np.inf)
        tried = tried or ranked
        if ranked and ranked[0].gain < LEAST_GAIN:
            ranked = in_two(case, settled, library, output, ranked)
        if ranked and ranked[0].gain >= LEAST_GAIN:
            return ranked
        idle.add(output)
    marked = shown_by_mark(case, current, library)
    if wide or marked:
        return marked or tried
    if switch := taken_by_switch(case, current, library):
        return switch
    beside = {at for at, gap in now.items() if gap > limits[at]}
    return beside_a_larger(case, current, library, beside) or strained(case, current, library)


def _sticks_elsewhere(case: Case, current: Fit, ranked: Sequence[Candidate]) -> bool:
    """Tell whether the best candidate leaves a gap of a loader with dry friction."""
    rubs = is_dry(case.nominal, case.control) or any(one.dry for one in current.effects)
    return rubs and (not ranked or "loader" in case.over_limit(ranked[0].fit.rig))
