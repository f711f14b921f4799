"""The search that a diagnosis uses, of sets and then of time histories, and each effect's history.

A set of constant effects is searched first (`beam`). Where it leaves a stage unexplained, the time
history of each effect that gained most is estimated. If one begins within the record, the outputs
are predicted with its time history, and the search is repeated. If the scale of a sensor drifts,
other effects may grow from the record's start instead: the search is repeated with the likeliest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.gap.effects.effect import Effect
from coupled.gap.search.beam import search_sets
from coupled.gap.search.case import Case
from coupled.gap.search.course import (
    Bounds,
    Course,
    Timing,
    course_of,
    course_of_events,
    timing_of,
)
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained
from coupled.gap.search.found import Choice, Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Floats, unexplained
from coupled.gap.thresholds import ENDS, PARTLY, RIVAL_GAIN, ROUNDS, WINDOW_s
from coupled.parallel import in_threads
from coupled.record.record import Record

Parts = list[tuple[Floats, Floats]]  # action of an effect and residual, of each output


def search(case: Case, library: Sequence[Effect]) -> tuple[Case, Choice]:
    """Return the effects that explain a record's gap, and the case with its last noise floors."""
    found = _search_with_longer_contact(*search_sets(case, library), library)
    while (later := _search_with_onset(*found, library)) is not None:
        found = later
    return _search_with_drift(*found, library) or found


def _search_with_longer_contact(
    case: Case, found: Choice, library: Sequence[Effect]
) -> tuple[Case, Choice]:
    """Repeat the search with presliding up to the motion, if the largest length was found.

    Other effects compensate for a presliding length that is too short. Return the likelier result.
    """
    larger = case.with_longer_contact(found.fit)
    if larger is None:
        return case, found
    problem, (after, other) = Problem(case), search_sets(larger, library)
    error = problem.model_error(found.without_effects.rig)
    one, more = (evidence(Problem(at), c.fit, error) for at, c in ((case, found), (after, other)))
    samples = fewest_unexplained([one, more])
    return (after, other) if more.log(samples) > one.log(samples) else (case, found)


def _search_with_drift(
    case: Case, found: Choice, library: Sequence[Effect]
) -> tuple[Case, Choice] | None:
    """Repeat the search with an effect that grows from the start, as likely as a sensor's drift.

    None if no sensor drifts, or if its drift is far likelier than growth of any other effect.
    """
    others = tuple(effect for effect in found.fit.effects if not effect.gradual)
    shown = {o for effect in found.fit.effects if effect.gradual for o in effect.shows_in}
    tries = [
        (case.timed(one, Timing(0.0, grows=True), Bounds(0.0, 0.0, 0.0)), one)
        for one in library
        if len(one.free) == 1 and _is_constant(one, case) and one not in others
        if shown & {*one.shows_in}
    ]
    if not tries or len({output.record for output in case.outputs}) > 1:
        return None
    problem = Problem(case)
    error = problem.model_error(found.without_effects.rig)

    def known(one: tuple[Case, Effect]) -> Evidence:
        anew = Problem(one[0])
        return evidence(anew, anew.fit((*others, one[1]), found.fit.values), error)

    each = [evidence(problem, found.fit, error), *in_threads(known, tries)]
    samples = fewest_unexplained(each)
    sensor, *logs = (one.log(samples) for one in each)
    if max(logs) < sensor - RIVAL_GAIN:
        return None
    return search_sets(tries[int(np.argmax(logs))][0], library)


def _search_with_onset(
    case: Case, found: Choice, library: Sequence[Effect]
) -> tuple[Case, Choice] | None:
    """Repeat the search with an effect that begins within the record, if that explains far more.

    Other effects of the set may compensate for the missing time history. If no effect was found,
    the best single ones are tried: one that grows late may gain nothing as a constant.
    """
    open_outputs = _open_outputs(case, found)
    gains = {step.effect.name: step.gain for step in found.steps} or found.tried
    known = {effect.name: effect for effect in library}
    for name in sorted(gains, key=lambda one: -gains[one])[:ROUNDS]:
        effect = known[name]
        anew = in_time(effect, case) if open_outputs & set(effect.shows_in) else None
        if anew is None:
            continue
        after, choice = search_sets(anew, library)
        kept = any(after.timing(one) is not None for one in choice.fit.effects)
        if kept and _left(after, choice) < PARTLY * _left(case, found):
            return after, choice
    return None


def _open_outputs(case: Case, choice: Choice) -> set[str]:
    """Return the outputs of which the effects found leave more than noise and physics' error."""
    first, left = case.gaps(choice.without_effects.rig), case.gaps(choice.fit.rig)
    return unexplained(first, left, case.outputs)


def _left(case: Case, choice: Choice) -> float:
    """Return the sum of the outputs' mean squares over their noise's, less 1 each."""
    return sum(output.gap(choice.fit.rig) ** 2 - 1.0 for output in case.outputs)


def course_in(effect: Effect, case: Case, found: Fit, records: list[Record]) -> Course | None:
    """Return the time history of an effect in the record with most of its action.

    None for a discrete effect, for a limit, whose action is not proportional to its size, and
    without action.
    """
    if not effect.free:
        return None
    parts = _parts(effect, case, found)
    if not parts:
        return None
    most = max(parts, key=lambda k: sum(float(action @ action) for action, _ in parts[k]))
    record, rate_Hz = records[most], case.nominal.frame_rate
    if effect.sampled is not None and effect.sampled.times is not None:
        at_s = effect.sampled.times(record)
        return course_of_events(at_s, len(record) / rate_Hz) if at_s.size else None
    if effect.free[0].is_limit:
        return None
    value = _size(effect, case, found)
    begun = case.timing(effect)
    if begun is not None:
        return begun[0].course(begun[1], len(record) / rate_Hz, value)
    return course_of(parts[most], rate_Hz, value, effect.gradual)


def in_time(effect: Effect, case: Case) -> Case | None:
    """Return the case with the time history of an effect that begins within the one record.

    None if the effect acts from the start, or has no size. It is fitted alone, since other effects
    may have absorbed the error of a constant size.
    """
    if not _is_constant(effect, case):
        return None
    alone = Problem(case).fit((effect,))
    parts = _parts(effect, case, alone)
    if len(parts) != 1:
        return None
    ((_, ours),) = parts.items()
    rate_Hz = case.nominal.frame_rate
    seen = course_of(ours, rate_Hz, _size(effect, case, alone), effect.gradual)
    # A change from the record's start may be any drift: it is reported, and not taken as a cause.
    if seen.onset_s is None or seen.onset_s.low < (ENDS + 1) * WINDOW_s:
        return None
    anew = case.timed(effect, timing_of(ours, rate_Hz), seen.onset_s)
    # Estimate again at the fitted size: friction and play are not linear in their size.
    ((_, ours),) = _parts(effect, case, Problem(anew).fit((effect,))).items()
    return case.timed(effect, timing_of(ours, rate_Hz), seen.onset_s)


def _is_constant(effect: Effect, case: Case) -> bool:
    """Tell whether an effect has a size, which is the same throughout the records."""
    number = effect.free[0] if effect.free else None
    sized = number is not None and not number.is_limit and not effect.gradual
    events = effect.sampled is not None and effect.sampled.times is not None
    return sized and not events and case.timing(effect) is None


def _parts(effect: Effect, case: Case, found: Fit) -> dict[int, Parts]:
    """Return {record: (action of an effect, residual) of each output}, in noise floors."""
    parts: dict[int, Parts] = {}
    for output, action, left in case.actions(found, effect):
        parts.setdefault(output.record, []).append((action, left))
    return parts


def _size(effect: Effect, case: Case, found: Fit) -> Bounds:
    """Return an effect's first parameter less its neutral value, with its 95 % interval."""
    first = effect.free[0]
    key, nothing = effect.value_key(first), first.neutral(case.nominal, case.control)
    each = (bound.get(key, np.nan) for bound in (found.values, found.low, found.high))
    return Bounds(*(float(bound - nothing) for bound in each))
