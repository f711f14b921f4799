"""The search for effects, and a second one with those in reserve where the first leaves a gap."""

from __future__ import annotations

from collections.abc import Sequence

from coupled.gap.case import Case
from coupled.gap.choose import Choice, searched
from coupled.gap.effect import Effect
from coupled.gap.library import EFFECTS
from coupled.gap.output import explained_below, stage_gaps, stage_limits


def search(case: Case, library: Sequence[Effect] = EFFECTS) -> tuple[Case, Choice]:
    """Return the effects that explain a record's gap, and the case with the floors they leave.

    What a gap does passes for noise. Where a rig with the effects found leaves less of it, the
    search is made again over that, as long as less comes out.
    """
    while True:
        found = _search(case, library)
        anew = case.heard_anew(found.fit.rig) if found.steps else None
        if anew is None:
            return case, found
        case = anew


def _search(case: Case, library: Sequence[Effect]) -> Choice:
    """Return the effects that explain a case's gap.

    An effect in reserve passes for others, and takes part in a second search alone, where the
    first leaves its stage unexplained. The one that leaves less is the answer.
    """
    plain = [effect for effect in library if not effect.reserve]
    found = searched(case, plain)
    wide = _unexplained(case, found)
    more = [effect for effect in library if effect.reserve and wide & set(effect.shows_in)]
    if not more:
        return found
    return min((found, searched(case, [*more, *plain])), key=lambda one: _left(case, one))


def _unexplained(case: Case, choice: Choice) -> set[str]:
    """Return the outputs that the effects found leave wider than noise could."""
    first, limits = stage_gaps(case.outputs, choice.settled.rig), stage_limits(case.outputs)
    left = case.gaps(choice.fit.rig)
    return {at for at, gap in left.items() if gap > explained_below(first[at], limits[at])}


def _left(case: Case, choice: Choice) -> float:
    """Return what a choice leaves of all outputs, the sum of their mean squares in floors."""
    return sum(output.gap(choice.fit.rig) ** 2 for output in case.outputs)
