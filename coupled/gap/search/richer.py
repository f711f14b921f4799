"""The richer and the plainer of two laws, asked on all of the record where the other was found.

Half of a record may hold too few breakaways to earn a law of friction its place, or leave open how
a servo with a dead time is damped, or whether a bend has a loop; and a fit to it may end in a
hollow. On all of it the richer law must do more, since it can bend farther: by `RICHER_GAIN` of dry
friction, of which no law is exact, and by `LEAST_GAIN` of a bend and of a servo. Of friction whose
contact holds rigidly, by `RIVAL_GAIN`, as of two laws with as many numbers. What a richer law could
gain is foretold first (`laws`, `score`), which spares most fits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from coupled.gap.effects.effect import Effect, Parameter
from coupled.gap.search.candidates import may_be_causes
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, likelier_by
from coupled.gap.search.information import may_be_plainer, says_nothing
from coupled.gap.search.laws import Starts, foretold, little_richer
from coupled.gap.search.rivals import Found, weight
from coupled.gap.search.score import Try, begins_at_one, scored
from coupled.gap.search.shooting import shot
from coupled.gap.thresholds import (
    BESIDE_ONE,
    ELASTIC_SHARES,
    FORETOLD_LEAST,
    LEAST_GAIN,
    RICHER_GAIN,
    RICHER_STARTS,
    RIVAL_GAIN,
    SCREEN_SIZES,
    SHAPES,
)
from coupled.parallel import in_threads


def richer_on_all(
    case: Case, library: Sequence[Effect], steps: Sequence[Found], current: Fit
) -> tuple[list[Found], Fit]:
    """Return the steps and the fit, with a richer law in place of a plainer one if that is it.

    Of several the likeliest, and those that all of the record does not tell from it are its rivals.
    """
    found = list(steps)
    for i, step in enumerate(steps):
        asked = list[Candidate]()
        for law, least, tries in _richer(case, library, step.effect, current):
            one = _asked(case, law, step.effect, tries, current)
            if one is not None and one.gain >= least:
                asked.append(one)
        if not asked:
            continue
        best = max(asked, key=lambda one: one.gain)
        others = [one for one in asked if one is not best]
        odds = weight(best.gain) + sum(weight(best.gain - one.gain) for one in others)
        rivals = tuple(
            replace(one, gain=step.gain + one.gain - best.gain)
            for one in others
            if one.gain > best.gain - RIVAL_GAIN
        )
        sure = 1.0 / (1.0 + odds)
        found[i] = replace(step, effect=best.effect, probability=sure, rivals=rivals, behind=())
        current = best.fit
    return found, current


def with_richer_rivals(
    case: Case, library: Sequence[Effect], steps: Sequence[Found], current: Fit
) -> list[Found]:
    """Return the steps, each with the richer law that all of the record does not tell from it.

    A law with one number more is named from `LEAST_GAIN` on, and no rival under `RIVAL_GAIN`. What
    lies between is the draw of the noise as often as not, so that the answer gives both.
    """
    found = list[Found]()
    for step in steps:
        rivals = list(step.rivals)
        for law in library if not rivals else ():
            if law in current.effects or not _holds(law, step.effect):
                continue
            if len(law.free) != len(step.effect.free) + 1:
                continue
            tries = _promising(case, law, step.effect, current)
            asked = _asked(case, law, step.effect, tries, current)
            if asked is not None and asked.gain >= RIVAL_GAIN:
                rivals.append(replace(asked, gain=step.gain))
        odds = 1.0 / step.probability + len(rivals) - len(step.rivals)
        found.append(replace(step, probability=1.0 / odds, rivals=tuple(rivals)))
    return found


def _asked(
    case: Case, law: Effect, plain: Effect, tries: Sequence[Try], current: Fit
) -> Candidate | None:
    """Return a richer law's fit in place of the plainer one's, and by how much it is likelier.

    None where nothing is to be tried, or where it is no cause.
    """
    effects = [law if one is plain else one for one in current.effects]
    fits = in_threads(partial(_fitted, case, effects), [one.start for one in tries])
    both = min(zip(fits, tries, strict=True), key=lambda one: one[0].cost, default=None)
    if both is None or not _is_cause(case, law, plain, both[0], current):
        return None
    return Candidate(min(likelier_by(case.outputs, both[0], current), both[1].most), law, both[0])


def plainer_on_all(
    case: Case, library: Sequence[Effect], steps: Sequence[Found], current: Fit
) -> tuple[list[Found], Fit]:
    """Return the steps and the fit, with a plainer law in place of a richer one if that does.

    Not of dry friction, whose laws their intervals distinguish.
    """
    found = list(steps)
    for i, step in enumerate(steps):
        for law in library:
            if law in current.effects or not _holds(step.effect, law):
                continue
            effects = [law if one is step.effect else one for one in current.effects]
            known = {p.key: current.values[step.effect.value_key(p)] for p in step.effect.free}
            sizes = {law.value_key(p): [known[p.key], p.starts[0], *p.starts] for p in law.free}
            level = law.free[0]  # which may be right while what shapes it is not
            sizes[law.value_key(level)][1] = known[level.key]
            fits = in_threads(partial(_fitted, case, effects), _each(current.values, sizes))
            fitted = min(fits, key=lambda one: one.cost)
            causes = may_be_causes(case, [(law, fitted)]) and not says_nothing(case, law, fitted)
            least = LEAST_GAIN if law.reserve else RIVAL_GAIN
            if causes and likelier_by(case.outputs, current, fitted) < least:
                found[i] = replace(step, effect=law, rivals=(), behind=())
                current = fitted
                break
    return found, current


def _fitted(case: Case, effects: Sequence[Effect], start: Mapping[str, float]) -> Fit:
    return case.fit(effects, start=start)


def _richer(
    case: Case, library: Sequence[Effect], plain: Effect, current: Fit
) -> Iterator[tuple[Effect, float, list[Try]]]:
    """Yield the laws richer than one, by how much they must be likelier, and where fits start."""
    for law in library:
        if law in current.effects:
            continue
        if law.alike is not None and law.alike.plainer == plain.name:
            rigid = _holds_rigidly(case, current)
            gain = None if rigid else foretold(case, law, plain, current, "all")
            promising = gain is None or gain >= RICHER_GAIN
            starts = little_richer(case, law, plain, current) if promising else []
            starts = [case.but_for_contact(start) for start in starts] if rigid else starts
            # What is foretold is of a little breakaway, and one that opens a gap is none.
            if case.over_limit(current.rig) & {*law.shows_in}:
                starts += shot(case, law, plain, current, "all")
            if starts:
                tries = [Try(np.inf, start) for start in starts]
                yield law, RIVAL_GAIN if rigid else RICHER_GAIN, tries
        elif _holds(law, plain):
            yield law, LEAST_GAIN, _promising(case, law, plain, current)


def _holds_rigidly(case: Case, current: Fit) -> bool:
    """Tell whether a contact holds nearly all that friction takes before any of it slips.

    A fit ends there where friction falls as it slips: the contact then does what a breakaway does,
    with as many numbers, and must be sought anew beside one.
    """
    shares = (current.values.get(one.value_key(one.free[0]), 0.0) for one in case.contact[1:])
    return any(share >= max(ELASTIC_SHARES) for share in shares)


def _promising(case: Case, law: Effect, plain: Effect, current: Fit) -> list[Try]:
    """Return where fits of a richer law begin: where most is foretold, and not too little."""
    tries = scored(case, law, plain, current, _begun(law, plain, current))
    best = sorted(tries, key=lambda one: -one.gain)[:RICHER_STARTS]
    return [one for one in best if one.gain >= FORETOLD_LEAST]


def _begun(law: Effect, plain: Effect, current: Fit) -> Starts:
    """Return where a richer law is tried: at the plainer one's end, by each of its shapes."""
    known = {p.key: current.values[plain.value_key(p)] for p in plain.free}
    shared = {law.value_key(p): known[p.key] for p in law.free if p.key in known}
    sizes = {law.value_key(p): _sizes(p) for p in law.free if p.key not in known}
    return _each({**current.values, **shared}, sizes)


def _each(values: Mapping[str, float], sizes: Mapping[str, Sequence[float]]) -> Starts:
    """Return values with each of the sizes of some numbers, of the shorter ones the last."""
    return [
        {**values, **{key: each[min(shape, len(each) - 1)] for key, each in sizes.items()}}
        for shape in range(max(map(len, sizes.values())))
    ]


def _sizes(number: Parameter) -> list[float]:
    """Return the values at which a number is tried: a limit over three decades.

    A factor that begins at 1 is tried beside that: nothing is foretold of what changes nothing.
    """
    if begins_at_one(number):
        return list(BESIDE_ONE)
    if not number.inverse:
        return list(number.starts)
    wide = [times * number.starts[0] for times in SCREEN_SIZES]
    return sorted({min(max(one, number.low), number.high) for one in wide})


def _holds(law: Effect, plain: Effect) -> bool:
    """Tell whether a law is the richer of two: it frees what the other does, and more.

    Neither is of dry friction, and both are looked for in the same search.
    """
    alike = law.stage == plain.stage and law.reserve == plain.reserve
    wet = not law.dry and not plain.dry
    return alike and wet and bool(plain.free) and _keys(plain) < _keys(law)


def _keys(effect: Effect) -> set[str]:
    """Return the numbers of the rig that an effect frees."""
    return {p.key for p in effect.free}


def _is_cause(case: Case, law: Effect, plain: Effect, fitted: Fit, current: Fit) -> bool:
    """Tell whether a law says something by its fit, and that it is not the plainer one.

    Where the plainer one's contact holds rigidly, likelihood alone says the latter: a breakaway and
    how far it yields are hardly apart there, and the breakaway's interval is as wide. One that
    fades over less than the slowest speed that is tried is that contact's sharp corner.
    """
    silent = says_nothing(case, law, fitted)
    if law.alike is not None and _holds_rigidly(case, current):
        slowest = min(SHAPES)
        speeds = [(p, fitted.values[law.value_key(p)]) for p in law.free if p.shape]
        silent = silent or any(value < slowest * p.starts[0] for p, value in speeds)
    else:
        silent = silent or may_be_plainer(case, law, fitted, plain)
    return bool(may_be_causes(case, [(law, fitted)])) and not silent
