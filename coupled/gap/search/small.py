"""What is claimed of a gap that noise, a setting or the physics of a right effect might leave.

There an effect must do more than gain: it is known by its mark, or stands beyond what a setting can
be, or leaves noise alone of what a larger gap beside it would have hidden.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect, possible
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.candidates import fitted_candidates
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit, touched
from coupled.gap.search.gain import Candidate, ranked_by_gain
from coupled.gap.signals.output import stage_gaps, stage_limits
from coupled.gap.thresholds import (
    FAR_BELOW_NOISE,
    JUST_WITHIN,
    LEAST_GAIN,
    RIVAL_GAIN,
    STRAINED_GAIN,
    SWITCH_LEAVES,
)


def beside_a_larger(
    case: Case, current: Fit, library: Sequence[Effect], outputs: set[str]
) -> list[Candidate]:
    """Return the candidates for outputs over their limits by no more than a right effect may leave.

    None but where the best leaves noise alone. Not beside dry friction, of which no law is exact.
    """
    limits = stage_limits(case.outputs)
    rubs = is_dry(case.nominal, case.control) or any(effect.dry for effect in current.effects)
    exact = outputs - {"loader"} if rubs else outputs
    for at in sorted(exact if current.effects else ()):
        ranked = fitted_candidates(case, current, library, {at})
        best = ranked[0] if ranked and ranked[0].gain >= LEAST_GAIN else None
        if best is not None and case.gaps(best.fit.rig)[at] <= limits[at]:
            return ranked
    return []


def strained(case: Case, current: Fit, library: Sequence[Effect]) -> list[Candidate]:
    """Return the candidates for the stages that settings may keep within their limits.

    One stands at the end of its tolerance there, and the stage is off by more; or a stage that was
    over its limit is only just within. None but where the best is surely beyond its setting, or
    gains far more than any setting there and needs none at its end.
    """
    # Where far less is left than the noise known beside what was found, as of air whose motion is
    # known by an error, a setting at its end says nothing.
    lost = {at for at, gap in case.gaps(current.rig).items() if gap < FAR_BELOW_NOISE}
    held = _at_end(case, current).items()
    at_end = {name: one for name, one in held if not lost & set(one.shows_in)}
    shown = {s for one in at_end.values() for s in one.shows_in} | _just_within(case, current)
    ranked = fitted_candidates(case, current, library, shown, at_end)
    relieved = _relieves(ranked, list(at_end.values()))
    return ranked if _surely_beyond(case, ranked) or relieved else []


def shown_by_mark(case: Case, current: Fit, library: Sequence[Effect]) -> list[Candidate]:
    """Return the candidate that an output shows by its mark, though it is within its limit.

    Its gain is what that output says alone: there the mark is known, and has no number to fit. None
    that leaves more of the output on the whole record, nor one that needs a setting at the end of
    its tolerance which did not stand there before.
    """
    for effect in library:
        ours = [output for output in case.outputs if output.stage == effect.mark]
        if not ours or effect in current.effects:
            continue
        effects = (*current.effects, effect)
        beside = (*effects, *case.nuisances(effects))
        rig = possible(case.nominal, case.control, beside, {**case.neutral, **current.values})
        worse = rig is None or any(one.gap(rig) > one.gap(current.rig) for one in ours)
        shown = [] if worse or rig is None else [(effect, replace(current, rig=rig))]
        if shown and ranked_by_gain(ours, current, shown)[0].gain >= LEAST_GAIN:
            fitted = case.fit(effects, "fitted", current.values, effect)
            # A mark that the other outputs contradict, by settings that it drives to their ends.
            if set(fitted.at_bound) <= set(current.at_bound):
                return ranked_by_gain(ours, current, [(effect, fitted)])
    return []


def taken_by_switch(case: Case, current: Fit, library: Sequence[Effect]) -> list[Candidate]:
    """Return the candidate without a number that halves what an output leaves within its limit.

    A floor may be too high, and hide what is no noise. It must gain far more than chance.
    """
    for switch in library:
        if switch.free or switch in current.effects:
            continue
        rig = case.with_only(current, (*current.effects, switch))
        ours = touched(case.outputs, [switch])
        if not any(one.gap(rig) <= SWITCH_LEAVES * one.gap(current.rig) for one in ours):
            continue
        fitted = case.fit((*current.effects, switch), "fitted", current.values, switch)
        ranked = ranked_by_gain(case.outputs, current, [(switch, fitted)])
        if ranked[0].gain >= STRAINED_GAIN and set(fitted.at_bound) <= set(current.at_bound):
            return ranked
    return []


def _at_end(case: Case, current: Fit) -> dict[str, Effect]:
    """Return the settings that stand at the end of their tolerance, and would gain beyond.

    By the names of the effects that free the same numbers.
    """
    known = {} if case.only_wide else case.known
    at = set(current.at_bound)
    return {
        name: one for name, one in known.items() if any(one.value_key(p) in at for p in one.free)
    }


def _just_within(case: Case, current: Fit) -> set[str]:
    """Return the stages over their limits as filed that settings alone bring just within them.

    Not the loader where there is dry friction, of which no law is exact.
    """
    limits, filed = stage_limits(case.outputs), stage_gaps(case.outputs, case.nominal)
    rubs = is_dry(case.nominal, case.control) or any(effect.dry for effect in current.effects)
    explained = {at for effect in current.effects for at in effect.shows_in}
    asked = set(limits) - explained - ({"loader"} if rubs else set())
    if case.only_wide or not any(filed[at] > limits[at] for at in asked):
        return set()
    now = case.gaps(current.rig)
    least = {at: 1.0 + JUST_WITHIN * (limits[at] - 1.0) for at in asked}
    return {at for at in asked if filed[at] > limits[at] >= now[at] > least[at]}


def _surely_beyond(case: Case, ranked: Sequence[Candidate]) -> bool:
    """Tell whether the best candidate is a number off by more than its setting, and nothing else.

    In a stage within its limit no other effect is claimed.
    """
    ends = case.ends(ranked[0].effect) if ranked else None
    if ends is None:
        return False
    best = ranked[0]
    (number,) = best.effect.free
    key = best.effect.value_key(number)
    beyond = best.fit.low[key] > ends[1] or best.fit.high[key] < ends[0]
    return beyond and all(other.gain < best.gain - RIVAL_GAIN for other in ranked[1:])


def _relieves(ranked: Sequence[Candidate], at_end: Sequence[Effect]) -> bool:
    """Tell whether the best candidate alone gains far more than chance, and needs no setting so.

    No law of dry friction does: a contact's settings take up what is left of one.
    """
    if not ranked or ranked[0].effect.dry or ranked[0].gain < STRAINED_GAIN:
        return False
    best = ranked[0]
    still = {one.value_key(p) for one in at_end for p in one.free} & set(best.fit.at_bound)
    return not still and all(other.gain < best.gain - RIVAL_GAIN for other in ranked[1:])
