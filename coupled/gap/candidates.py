"""The candidates for what an output shows: screened, fitted beside what is known, and ranked."""

from __future__ import annotations

from collections.abc import Sequence

from coupled.gap.case import Case
from coupled.gap.effect import Effect, value_of
from coupled.gap.fit import Fit
from coupled.gap.gain import Candidate
from coupled.gap.information import informative
from coupled.gap.screen import screen


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
    found: list[tuple[Effect, Fit]] = []
    screened = screen(case, current, candidates)
    # The richer of two laws also starts from where the plainer one ended.
    screened.sort(key=lambda one: one[0].alike is not None)
    for i, (effect, seen) in enumerate(screened):
        starts = [*seen, *_from_plainer(case, effect, found)]
        if case.tell is not None:
            case.tell(f"fitting {effect.name}", i, len(screened))
        chosen = (*current.effects, effect)
        tries = [
            case.fit(chosen, "fitted", {**current.values, **start}, effect) for start in starts
        ]
        fitted = min(tries, key=lambda one: one.cost)
        bound = any(effect.value_key(p) in fitted.at_bound for p in effect.free)
        if bound:
            continue
        if not _within_tolerance(case, effect, fitted):
            found.append((effect, fitted))
    return informative(case, current, found)


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
