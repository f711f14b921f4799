"""The candidates for what an output shows: screened, fitted beside what is known, and ranked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from itertools import count

import numpy as np

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.fit import Fit, touched
from coupled.gap.search.gain import Candidate, ranked_by_gain
from coupled.gap.search.information import informative
from coupled.gap.search.laws import leaves_only_noise, may_gain
from coupled.gap.search.screen import Screened, screen
from coupled.gap.search.shooting import screened_short, shot_starts
from coupled.gap.signals.output import stage_gaps, stage_limits
from coupled.gap.thresholds import (
    BEHIND_GAIN,
    BEHIND_SHARE,
    FLOWN_FIRST,
    HOPELESS_BEHIND,
    LOOP_NOISES,
    RACE_BEHIND,
    RACE_EVALUATIONS,
    RACE_FAR,
    RACE_FIRST,
    RACE_FLIGHTS,
)
from coupled.parallel import in_threads

Fits = list[tuple[Effect, Fit]]
Ends = Mapping[str, Mapping[str, float]]


def fitted_candidates(
    case: Case,
    current: Fit,
    library: Sequence[Effect],
    outputs: set[str],
    always: Collection[str] = (),
    ends: Ends | None = None,
    short: bool = False,
) -> list[Candidate]:
    """Return the effects that show in some outputs, fitted beside the current ones, best first.

    Those named in `always` are fitted however little their signature takes. `ends` are the values
    at which an earlier round's fits ended, by effect: a fit starts there, too. Another effect found
    since may have made the signature less clear than it was. By `short` replays, where outputs have
    them, other effects may come first, and begin elsewhere (`shooting`).
    """
    # A law of friction with its contact's numbers as its own is one beside which they are settings.
    same = {effect.yielding for effect in library} if case.contact else set()
    chosen = {effect.name for effect in current.effects}
    candidates = [
        effect
        for effect in library
        if effect.name not in chosen and effect.name not in same and outputs & set(effect.shows_in)
    ]
    if short:
        screened = screened_short(case, current, candidates)
    else:
        screened = screen(case, current, candidates, always)
    screened = [_from_ends(one, ends or {}) for one in screened]
    laws = [one for one in screened if one.effect.dry and not one.effect.yielding]
    found = _fitted(case, current, [one for one in screened if one not in laws])
    laws = [one for one in laws if may_gain(case, one.effect, found)]
    laws = [one._replace(starts=shot_starts(case, current, *one[:2], found)) for one in laws]
    found += _fitted(case, current, laws)
    closing = [one for one in found if not _opens_a_gap(case, current, one[1])]
    return informative(case, current, closing or found)


def _from_ends(one: Screened, ends: Ends) -> Screened:
    """Return a screened effect that starts where its last fit ended, too; not a law of friction."""
    end, keys = ends.get(one.effect.name, {}), [one.effect.value_key(p) for p in one.effect.free]
    # One that was asked by its level alone has no other numbers there.
    if one.effect.dry or len(keys) < 2 or not end.keys() >= set(keys):
        return one
    return one._replace(starts=[*one.starts, {key: end[key] for key in keys}])


FIRST, BEGUN = Descent("wide", RACE_FIRST), Descent("wide", RACE_EVALUATIONS - RACE_FIRST + 1)
WIDE = Descent("wide")
FLOWN = Descent("wide", RACE_FLIGHTS)


def _fitted(case: Case, current: Fit, screened: Sequence[Screened]) -> list[tuple[Effect, Fit]]:
    """Return the effects that fit beside the current ones, each with the best of its fits.

    By the loader's wide steps, and by its own where that may decide. Of effects that have to be
    flown those that take most come first, and the others if they may do nearly as well.
    """
    flown = [one for one in screened if STAGE_OF[one.effect.stage].flown]
    later = flown[FLOWN_FIRST:]
    tries = [(one.effect, start) for one in screened for start in one.starts]
    begun, many = count(), Counter(effect.name for effect, _ in tries)

    def first(effect: Effect) -> Descent:
        if STAGE_OF[effect.stage].flown:
            return FLOWN
        return FIRST if many[effect.name] > 1 else WIDE

    def begin(tried: tuple[Effect, dict[str, float]]) -> tuple[Effect, Fit]:
        effect, start = tried
        if case.tell is not None:
            case.tell(f"fitting {effect.name}", next(begun), len(tries))
        values = {**current.values, **start}
        return effect, _beside(case, current, effect, values, first(effect))

    def go_on(begun: tuple[Effect, Fit]) -> tuple[Effect, Fit]:
        effect, fitted = begun
        if first(effect) is WIDE:
            return begun
        return effect, _beside(case, current, effect, fitted.values, WIDE, fitted)

    def finish(near: tuple[Effect, Fit]) -> tuple[Effect, Fit]:
        effect, fitted = near
        return effect, _beside(case, current, effect, fitted.values, Descent("own"), fitted)

    late = {one.effect for one in later}

    def race(begun: tuple[Effect, Fit]) -> tuple[Effect, Fit]:
        effect, fitted = begun
        if first(effect) is not FIRST:
            return begun
        return effect, _beside(case, current, effect, fitted.values, BEGUN, fitted)

    fits = in_threads(begin, [each for each in tries if each[0] not in late])
    fits = in_threads(race, _not_far_behind(fits))
    hopeful = {one.effect for one in later if not _hopeless(case, current, one, fits)}
    fits += in_threads(begin, [each for each in tries if each[0] in hopeful])
    racing, given_up = _still_racing(case, fits)
    fits = [*in_threads(go_on, racing), *given_up]
    found = may_be_causes(case, list(_least(fits).values()))
    near = _near_the_best(case, current, found)
    far = [each for each in found if each not in near]
    return far + may_be_causes(case, in_threads(finish, near))


def _beside(
    case: Case,
    current: Fit,
    effect: Effect,
    values: Mapping[str, float],
    descent: Descent,
    near: Fit | None = None,
) -> Fit:
    """Return an effect fitted on every other stretch beside the current ones, from these values."""
    return case.fit((*current.effects, effect), "fitted", values, effect, descent, near)


def _hopeless(case: Case, current: Fit, flown: Screened, fits: Fits) -> bool:
    """Tell whether an effect takes far too little beside one that leaves noise alone there.

    What it takes is by its signature at one size, and a flight is nearly linear in its numbers; the
    settings beside it may take more.
    """
    ours = touched(case.outputs, [flown.effect])
    power = sum(float(np.sum(o.residual(current.rig) ** 2)) for o in ours)
    share_left = 1.0 - flown.taken / power
    cost = 0.5 * sum(float(np.sum(o.residual(current.rig, "fitted") ** 2)) for o in ours)
    return any(
        effect.shows_in == flown.effect.shows_in
        and leaves_only_noise(case, effect, fitted)
        and share_left * cost > HOPELESS_BEHIND * RACE_BEHIND * fitted.cost
        for effect, fitted in fits
    )


def _least(fits: Sequence[tuple[Effect, Fit]]) -> dict[str, tuple[Effect, Fit]]:
    """Return the best of each effect's fits, by its name."""
    best: dict[str, tuple[Effect, Fit]] = {}
    for each in fits:
        name = each[0].name
        if name not in best or each[1].cost < best[name][1].cost:
            best[name] = each
    return best


def _not_far_behind(begun: Fits) -> Fits:
    """Return the fits that do not stand far behind the best of the same effect."""
    best = _least(begun)
    return [each for each in begun if each[1].cost <= RACE_FAR * best[each[0].name][1].cost]


def _still_racing(case: Case, begun: Sequence[tuple[Effect, Fit]]) -> tuple[Fits, Fits]:
    """Return the fits of each effect that are not far behind its best one, and the effects left.

    Where that leaves noise alone, its others are given up. Of effects that have to be flown, one
    is left as it is where another leaves noise alone of the same outputs, and it is far behind.
    """
    best = _least(begun)
    noise = {name for name, one in best.items() if leaves_only_noise(case, *one)}
    least = {
        best[name][0].shows_in: best[name][1].cost
        for name in sorted(noise, key=lambda name: -best[name][1].cost)
    }
    left = {
        name
        for name, (effect, fitted) in best.items()
        if STAGE_OF[effect.stage].flown
        and fitted.cost > RACE_BEHIND * least.get(effect.shows_in, np.inf)
    }
    racing = [
        (effect, fitted)
        for effect, fitted in begun
        if effect.name not in left
        and fitted.cost
        <= (1.0 if effect.name in noise else RACE_BEHIND) * best[effect.name][1].cost
    ]
    return racing, [best[name] for name in best if name in left]


def may_be_causes(case: Case, found: Sequence[tuple[Effect, Fit]]) -> list[tuple[Effect, Fit]]:
    """Return the effects fitted that are away from their bounds, and beyond their settings.

    And beyond the noise of what drives them. Not those of a frequency too fast for the frames, but
    a tone's, which is known to fold.
    """
    fastest = 0.5 * min(output.frame_rate_Hz for output in case.outputs)
    return [
        (effect, fitted)
        for effect, fitted in found
        if not any(effect.value_key(p) in fitted.at_bound for p in effect.free)
        and not _within_tolerance(case, effect, fitted)
        and not _within_noise(case, effect, fitted)
        and all(fitted.values[key] < fastest for key in _frequencies(effect))
    ]


def _opens_a_gap(case: Case, current: Fit, fitted: Fit) -> bool:
    """Tell whether a stage that was within its limit stands out by a floor's power more.

    A cause explains where it shows; what imitates one elsewhere needs another to undo it there.
    """
    before, after = (stage_gaps(case.outputs, one.rig) for one in (current, fitted))
    limits = stage_limits(case.outputs)
    return any(
        before[stage] <= limits[stage]
        and after[stage] ** 2 > before[stage] ** 2 + limits[stage] ** 2
        for stage in after
    )


def _frequencies(effect: Effect) -> list[str]:
    """Return the names of an effect's numbers that are frequencies, in Hz, and do not fold."""
    numbers = [p for p in effect.free if p.name == "frequency_Hz" and not p.folds]
    return [effect.value_key(p) for p in numbers]


def _near_the_best(
    case: Case, current: Fit, found: Sequence[tuple[Effect, Fit]]
) -> list[tuple[Effect, Fit]]:
    """Return those whose gain may still be the best's, or its rival's."""
    ranked = ranked_by_gain(case.outputs, current, found)
    most = max((one.gain for one in ranked), default=0.0)
    least = most - max(BEHIND_GAIN, BEHIND_SHARE * most)
    near = {one.effect.name for one in ranked if one.gain >= least}
    return [each for each in found if each[0].name in near]


def _within_tolerance(case: Case, effect: Effect, fitted: Fit) -> bool:
    """Tell whether a nominal number moved by no more than its setting can be trusted to."""
    for p in effect.free:
        if p.tolerance and abs(fitted.values[effect.value_key(p)] - 1.0) <= p.tolerance:
            return True
    ends = case.ends(effect)
    if ends is None:
        return False
    (number,) = effect.free
    return ends[0] < fitted.values[effect.value_key(number)] < ends[1]


def _within_noise(case: Case, effect: Effect, fitted: Fit) -> bool:
    """Tell whether a loop is no wider than noise of its drive, which it only smooths then."""
    return any(
        fitted.values[effect.value_key(p)] <= LOOP_NOISES * output.noises.get(p.beyond, 0.0)
        for p in effect.free
        if p.beyond
        for output in touched(case.outputs, [effect])
    )
