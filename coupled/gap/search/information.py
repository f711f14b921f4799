"""Whether a record says anything of an effect: none is named by an interval that holds nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect, value_of
from coupled.gap.effects.library import EFFECTS
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, ranked_by_gain
from coupled.gap.thresholds import BEGUN_AT, LEAST_GAIN, RIVAL_GAIN

ORDER = [effect.name for effect in EFFECTS]


def informative(case: Case, current: Fit, found: Sequence[tuple[Effect, Fit]]) -> list[Candidate]:
    """Return the candidates whose intervals say something, by their gain.

    Half of a record has few stretches for its intervals to go by: one that says nothing there, but
    foretells the other half far better than any that does, is asked on all of it. Where none gains,
    one of a single number may, whose interval is as wide as what the others leave: the whole record
    judges it in the end.
    """
    open_ones = [one for one in found if says_nothing(case, *one)]
    clear = [one for one in found if one not in open_ones]
    plainest = _plainest([effect for effect, _ in found])
    held = [_alone(case, *one) for one in open_ones if one[0] in plainest]
    clear += [one for one in held if not says_nothing(case, *one)]
    ranked = ranked_by_gain(case.outputs, current, clear)
    asked = _clear_on_all(case, current, ranked, open_ones)
    if asked:
        best, fitted = asked[0]
        anew = (best, _begun_elsewhere(case, best, fitted))
        ranked = ranked_by_gain(case.outputs, current, [*clear, anew, *asked[1:]])
    if ranked and ranked[0].gain >= LEAST_GAIN:
        return ranked
    single = [one for one in open_ones if len(one[0].free) == 1]
    others = ranked_by_gain(case.outputs, current, [*clear, *single])
    # Two that are one law differ by rounding alone: the library's order settles it.
    return sorted(others, key=lambda one: (-round(one.gain, 1), ORDER.index(one.effect.name)))


def _plainest(effects: Sequence[Effect]) -> list[Effect]:
    """Return the effects that may be asked by their level alone: of those with one, the plainest.

    The level alone is the same law by the name of either.
    """
    richest_first = sorted(filter(_goes_along, effects), key=lambda one: -len(one.free))
    return list({one.free[0].key: one for one in richest_first}.values())


def _goes_along(effect: Effect) -> bool:
    """Tell whether an effect has numbers beside its level that the rig has without it."""
    return len(effect.free) > 1 and all(p.mode == "factor" for p in effect.free[1:])


def _alone(case: Case, effect: Effect, fitted: Fit) -> tuple[Effect, Fit]:
    """Return an effect of its level alone, and its fit; its other numbers stay as they are filed.

    A dead time and how fast the servo is beside it may be one number to a record.
    """
    level = effect.free[0]
    alone = replace(effect, parameters=(level,))
    others = [one for one in fitted.effects if one is not effect]
    start = {key: value for key, value in fitted.values.items() if key in _keys(case, others)}
    start[effect.value_key(level)] = level.starts[0]
    return alone, case.fit((*others, alone), "fitted", start, alone)


def _keys(case: Case, effects: Sequence[Effect]) -> set[str]:
    every = (*effects, *case.nuisances(effects))
    return {one.value_key(p) for one in every for p in one.free}


def _clear_on_all(
    case: Case, current: Fit, clear: Sequence[Candidate], open_ones: Sequence[tuple[Effect, Fit]]
) -> list[tuple[Effect, Fit]]:
    """Return those of the open ones that gain far more, and say something on all of the record.

    The one that gains most comes first.
    """
    least = max([LEAST_GAIN, *(one.gain for one in clear)]) + RIVAL_GAIN
    better = [one for one in ranked_by_gain(case.outputs, current, open_ones) if one.gain > least]
    return [
        (one.effect, one.fit)
        for one in better
        if not says_nothing(case, one.effect, case.fit(one.fit.effects, start=one.fit.values))
    ]


def _begun_elsewhere(case: Case, effect: Effect, fitted: Fit) -> Fit:
    """Return the least of a fit and of those that begin at less and at more than its size.

    An interval that says nothing beside a large gain may be that of a hollow beside the end.
    """
    level = next(p for p in effect.free if not p.above)
    key, nothing = effect.value_key(level), level.neutral(case.nominal, case.control)
    starts = [
        {**fitted.values, key: nothing + times * (fitted.values[key] - nothing)}
        for times in (1.0, *BEGUN_AT)
    ]
    fits = [case.fit(fitted.effects, "fitted", start, effect) for start in starts]
    return min(fits, key=lambda one: one.cost)


def says_nothing(case: Case, effect: Effect, fitted: Fit) -> bool:
    """Tell whether an effect's interval holds the size at which it does nothing.

    By its first number, the level; the others shape it. Of a limit, none is no size. A number that
    counts from another of the rig, as the bend of what has hysteresis, may well be as it is filed;
    where a breakaway surely stands above the running friction, or a limit is surely one, what is
    filed of the level may be right.
    """
    level = next((p for p in effect.free if not p.above), None)
    if level is None or level.inverse:
        return False
    key, nothing = effect.value_key(level), level.neutral(case.nominal, case.control)
    if key not in fitted.low:
        return False
    filed = float(value_of(case.nominal, case.control, level.key)) > 0.0
    if filed and any([*_stands_above(case, effect, fitted), *_limits(effect, fitted)]):
        return False
    return fitted.low[key] <= nothing <= fitted.high[key]


def is_open(case: Case, effect: Effect, current: Fit) -> bool:
    """Tell whether all of the record leaves an effect open, or at a bound of one of its numbers."""
    at_bound = any(effect.value_key(p) in current.at_bound for p in effect.free)
    return at_bound or says_nothing(case, effect, current)


def _stands_above(case: Case, effect: Effect, fitted: Fit) -> list[bool]:
    """Tell of each number that stands above another of the rig whether it surely does."""
    return [
        fitted.low[effect.value_key(p)] > value_of(fitted.rig, case.control, p.above)
        for p in effect.free
        if p.above
    ]


def _limits(effect: Effect, fitted: Fit) -> list[bool]:
    """Tell of each limit whether it is one: its interval lies between its bounds."""
    limits = [(p, effect.value_key(p)) for p in effect.free if p.inverse]
    return [p.low < fitted.low[key] and fitted.high[key] < p.high for p, key in limits]


def shape_is_open(case: Case, richer: Effect, fitted: Fit, plainer: Effect) -> bool:
    """Tell whether nothing surely sets the richer of two effects apart from the plainer one.

    The richer one frees the plainer one's number and others, of which one may, by its interval, be
    what it is filed as, or a limit that is none.
    """
    shared = {p.key for p in plainer.free}
    if not shared or not shared < {p.key for p in richer.free}:
        return False
    sure = _limits(richer, fitted)
    for p in richer.free:
        # What only shapes a law, as how fast friction fades, has no size at which there is none.
        if p.key in shared or p.above or p.may_end or p.shape or p.inverse:
            continue
        key, nothing = richer.value_key(p), p.neutral(case.nominal, case.control)
        sure.append(not fitted.low[key] <= nothing <= fitted.high[key])
    return not all(sure)


def may_be_plainer(case: Case, richer: Effect, fitted: Fit, plainer: Effect) -> bool:
    """Tell whether the interval of the richer of two laws holds the plainer one.

    There its number stands above another of the rig by nothing: a breakaway no larger than the
    running friction.
    """
    if richer.alike is None or richer.alike.plainer != plainer.name:
        return False
    return not all(_stands_above(case, richer, fitted))
