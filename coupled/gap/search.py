"""The search for effects, and a second one with those in reserve, which pass for others."""

from __future__ import annotations

from collections.abc import Sequence

from coupled.gap.case import Case
from coupled.gap.choose import Choice, searched
from coupled.gap.effect import Effect
from coupled.gap.gain import ranked_by_gain
from coupled.gap.library import EFFECTS
from coupled.gap.output import stage_limits
from coupled.gap.thresholds import LEAST_GAIN


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

    An effect in reserve passes for others, and takes part in a second search alone: where the first
    leaves more of its stage than noise, or has found an effect of a number that it frees, too. Its
    answer must gain as any effect must.
    """
    plain = [effect for effect in library if not effect.reserve]
    found = searched(case, plain)
    open_ones = _open(case, found)
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


def _open(case: Case, choice: Choice) -> set[str]:
    """Return the outputs that the effects found leave wider than noise alone does."""
    limits = stage_limits(case.outputs)
    left = case.gaps(choice.fit.rig)
    return {at for at, gap in left.items() if gap > limits[at]}


def _gain(case: Case, first: Choice, second: Choice) -> float:
    """Return the held-out log-likelihood by which the second answer beats the first."""
    each = [case.fit(one.fit.effects, "fitted", one.fit.values) for one in (first, second)]
    shown = [(effect, each[1]) for effect in second.fit.effects[:1]]
    ranked = ranked_by_gain(case.outputs, each[0], shown)
    return ranked[0].gain if ranked else 0.0
