"""Effects that a clean stage refutes: none is reported that makes a stage worse which had no gap.

An effect is fitted to the outputs in which it shows. Where it changes another one, as a late stamp
of the force changes the host's own arithmetic, that output refutes it.
"""

from __future__ import annotations

from collections.abc import Sequence

from coupled.gap.effects.effect import Effect
from coupled.gap.search.case import Case
from coupled.gap.search.choose import Choice
from coupled.gap.search.search import search


def search_unrefuted(case: Case, library: Sequence[Effect]) -> tuple[Case, Choice]:
    """Return what the search finds (`search`), without effects that a clean stage refutes."""
    tried = list(library)
    while True:
        found, choice = search(case, tried)
        refuted = refuted_by(found, choice)
        if not refuted:
            return found, choice
        tried = [effect for effect in tried if effect not in refuted]


def refuted_by(case: Case, choice: Choice) -> list[Effect]:
    """Return the effects found without which no clean output would be over its limit.

    Clean are the outputs within their limits with the nominal rig, as filed and with its settings.
    """
    effects = [step.effect for step in choice.steps]
    before = case.over_limit(case.nominal) | case.over_limit(choice.settled.rig)
    spoiled = case.over_limit(choice.fit.rig) - before if effects else set()
    if not spoiled:
        return []
    found = []
    for effect in effects:
        others = [other for other in choice.fit.effects if other is not effect]
        without = case.over_limit(case.with_only(choice.fit, others))
        if not spoiled & without:
            found.append(effect)
    return found
