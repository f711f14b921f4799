"""The search that a diagnosis uses: sets of effects, and then effects that begin in the record.

A set of constant effects is searched first (`beam`). Where it leaves a stage unexplained, the time
history of each effect that gained most is estimated. If one begins within the record, the outputs
are predicted with its time history, and the search is repeated.
"""

from __future__ import annotations

from collections.abc import Sequence

from coupled.gap.beam.beam import search_sets
from coupled.gap.beam.courses import in_time
from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.found import Choice
from coupled.gap.signals.output import explained_below, stage_limits
from coupled.gap.thresholds import LATER_LEFT, LATER_TRIED


def search(case: Case, library: Sequence[Effect]) -> tuple[Case, Choice]:
    """Return the effects that explain a record's gap, and the case with its last noise floors."""
    found = search_sets(case, library)
    while (later := _later(*found, library)) is not None:
        found = later
    return found


def _later(case: Case, found: Choice, library: Sequence[Effect]) -> tuple[Case, Choice] | None:
    """Return the search with an effect that begins in the record, where that explains far more.

    The other effects found may only compensate for what the time history explains. One that grows
    late may gain nothing as a constant: without any effect found, those that did best are tried.
    """
    open_outputs = _open_outputs(case, found)
    gains = {step.effect.name: step.gain for step in found.steps} or found.tried
    for name in sorted(gains, key=lambda one: -gains[one])[:LATER_TRIED]:
        effect = BY_NAME[name]
        anew = in_time(effect, case) if open_outputs & set(effect.shows_in) else None
        if anew is None:
            continue
        after, choice = search_sets(anew, library)
        kept = any(after.timing(one) is not None for one in choice.fit.effects)
        if kept and _left(after, choice) < LATER_LEFT * _left(case, found):
            return after, choice
    return None


def _open_outputs(case: Case, choice: Choice) -> set[str]:
    """Return the outputs of which the effects found leave more than noise and physics' error."""
    first, limits = case.gaps(choice.settled.rig), stage_limits(case.outputs)
    left = case.gaps(choice.fit.rig)
    return {at for at, gap in left.items() if gap > explained_below(first[at], limits[at])}


def _left(case: Case, choice: Choice) -> float:
    """Return the sum of the outputs' mean squares over their noise's, less 1 each."""
    return sum(output.gap(choice.fit.rig) ** 2 - 1.0 for output in case.outputs)
