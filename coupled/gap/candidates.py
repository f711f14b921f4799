"""The candidates for what an output shows: screened, fitted beside what is known, and ranked."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from coupled.gap.case import Case
from coupled.gap.effect import Effect, value_of
from coupled.gap.fit import Fit
from coupled.gap.gain import Candidate
from coupled.gap.information import informative
from coupled.gap.screen import screen
from coupled.parallel import in_threads


def fitted_candidates(
    case: Case, current: Fit, library: Sequence[Effect], outputs: set[str]
) -> list[Candidate]:
    """Return the effects that show in some outputs, fitted beside the current ones, best first."""
    # A law of friction with its contact's numbers as its own is one beside which they are settings.
    same = {effect.yielding for effect in library} if case.contact else set()
    candidates = [
        effect
        for effect in library
        if effect not in current.effects
        and effect.name not in same
        and outputs & set(effect.shows_in)
    ]
    screened = screen(case, current, candidates)
    found = _fitted(case, current, [one for one in screened if one[0].alike is None])
    # The richer of two laws also starts from where the plainer one ended.
    richer = [
        (effect, [*starts, *_from_plainer(case, effect, found)])
        for effect, starts in screened
        if effect.alike is not None
    ]
    return informative(case, current, found + _fitted(case, current, richer))


Starts = list[dict[str, float]]


def _fitted(
    case: Case, current: Fit, screened: Sequence[tuple[Effect, Starts]]
) -> list[tuple[Effect, Fit]]:
    """Return the effects that fit beside the current ones, each with the best of its fits."""
    tries = [(effect, start) for effect, starts in screened for start in starts]
    begun = count()

    def one(tried: tuple[Effect, dict[str, float]]) -> Fit:
        effect, start = tried
        if case.tell is not None:
            case.tell(f"fitting {effect.name}", next(begun), len(tries))
        return case.fit((*current.effects, effect), "fitted", {**current.values, **start}, effect)

    fits = iter(in_threads(one, tries))
    best = [
        (effect, min((next(fits) for _ in starts), key=lambda fitted: fitted.cost))
        for effect, starts in screened
    ]
    return [
        (effect, fitted)
        for effect, fitted in best
        if not any(effect.value_key(p) in fitted.at_bound for p in effect.free)
        and not _within_tolerance(case, effect, fitted)
    ]


def _from_plainer(
    case: Case, effect: Effect, found: Sequence[tuple[Effect, Fit]]
) -> list[dict[str, float]]:
    """Return where a richer law's fit starts by what its plainer one was fitted to, if it was."""
    if effect.alike is None:
        return []
    return [
        {**fitted.values, **imitating(case, effect, plain, fitted)}
        for plain, fitted in found
        if plain.name == effect.alike.plainer
    ]


def imitating(case: Case, richer: Effect, plain: Effect, fitted: Fit) -> dict[str, float]:
    """Return the values by which a richer law is nearly the plainer one that was fitted."""
    assert richer.alike is not None
    known = {p.name: fitted.values[plain.value_key(p)] for p in plain.free}
    base = float(value_of(case.nominal, case.control, richer.alike.base))
    values = richer.alike.values(known, base)
    return {richer.value_key(p): values[p.name] for p in richer.free}


def _within_tolerance(case: Case, effect: Effect, fitted: Fit) -> bool:
    """Tell whether a nominal number moved by no more than its setting can be trusted to."""
    ends = case.ends(effect)
    if ends is None:
        return False
    (number,) = effect.free
    return ends[0] < fitted.values[effect.value_key(number)] < ends[1]
