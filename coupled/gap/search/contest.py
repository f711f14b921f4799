"""A contest of two effects on all of the record: the one found, and another in its place.

Every other stretch was fitted when it was found, from a hollow maybe, or beside less than is known
now. One that came close behind it then is asked again at the end.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.candidates import may_be_causes
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, likelier_by
from coupled.gap.search.information import is_open, says_nothing
from coupled.gap.search.rivals import Found, weight
from coupled.gap.signals.output import stage_gaps
from coupled.gap.thresholds import LEAST_GAIN, RIVAL_GAIN, SWITCH_LEAVES


def contested(
    case: Case, current: Fit, effect: Effect, other: Effect, starts: Sequence[Mapping[str, float]]
) -> tuple[Fit, Fit] | None:
    """Return the fits of all of the record with an effect found and with another in its place.

    None where the other is no cause.
    """
    there = _instead(case, current, effect, other, starts)
    if not may_be_causes(case, [(other, there)]) or says_nothing(case, other, there):
        return None
    return _again(case, current, effect, there), there


def _instead(
    case: Case, current: Fit, effect: Effect, other: Effect, starts: Sequence[Mapping[str, float]]
) -> Fit:
    """Return the fit with another effect in place of one, begun from each of the starts."""
    effects = [other if one is effect else one for one in current.effects]
    return min((case.fit(effects, start=one) for one in starts), key=lambda one: one.cost)


def _again(case: Case, current: Fit, effect: Effect, there: Fit) -> Fit:
    """Return the fit of what was found, begun from where the other effect's ended, too.

    Beside dry friction it may stand in a hollow. Where the other is likelier, the contact is sought
    anew as well.
    """
    start = {**there.values, **own_values(effect, current)}
    here = min(current, case.fit(current.effects, start=start), key=lambda one: one.cost)
    anew = case.but_for_contact(start)
    if anew != start and likelier_by(case.outputs, here, there) <= -RIVAL_GAIN:
        here = min(here, case.fit(current.effects, start=anew), key=lambda one: one.cost)
    return here


def overtaken(case: Case, current: Fit, step: Found) -> tuple[Found, Fit]:
    """Return a step and the fit, with the effect that came close behind if that is likelier.

    By all of the record, and surely. One of more numbers is not asked: it can bend farther.
    """
    best, last = step, current
    for close in step.behind:
        if close.effect in current.effects:
            continue
        own = own_values(close.effect, close.fit)
        starts = [{**current.values, **own}, {**current.values, **close.fit.values}]
        fits = contested(case, current, step.effect, close.effect, starts)
        if fits is None:
            continue
        less = likelier_by(case.outputs, *fits)
        if less <= -RIVAL_GAIN and likelier_by(case.outputs, last, fits[1]) < 0.0:
            odds = weight(-less)
            best = replace(step, effect=close.effect, probability=1 / (1 + odds), rivals=())
            last = fits[1]
    return best, last


def switched(case: Case, library: Sequence[Effect], current: Fit, step: Found) -> tuple[Found, Fit]:
    """Return a step and the fit, with an effect without a number where that does as much.

    It was passed over where another number stood wrong without the step's effect: a switch has none
    to make up for it. It is the simpler answer, so it need not be likelier.
    """
    rest = [one for one in current.effects if one is not step.effect]
    without = stage_gaps(case.outputs, case.with_only(current, rest))
    for switch in library:
        shown = set(switch.shows_in) & set(step.effect.shows_in) & set(without)
        if switch.free or switch in current.effects or not shown:
            continue
        left = stage_gaps(case.outputs, case.with_only(current, [*rest, switch]))
        if max(left[at] for at in shown) > SWITCH_LEAVES * max(without[at] for at in shown):
            continue
        fits = contested(case, current, step.effect, switch, [current.values])
        if fits is None or not set(fits[1].at_bound) <= set(fits[0].at_bound):
            continue
        if likelier_by(case.outputs, *fits) < RIVAL_GAIN:
            return replace(step, effect=switch, rivals=(), behind=()), fits[1]
    return step, current


def distinguished(case: Case, current: Fit, step: Found) -> tuple[Found, Fit]:
    """Return a step without the rivals that all of the record tells from it beside dry friction.

    Either may stand in a hollow there, so that each is begun from where the other ended, and with
    its contact sought anew. One of more numbers is not asked, since it can bend farther; nor, on a
    rig that does not rub, what has no contact against a law of friction.
    """
    rubs = is_dry(case.nominal, case.control)
    rubs |= any(one.dry for one in current.effects if one is not step.effect)
    if not rubs and not step.effect.dry:
        return step, current
    left = list[Candidate]()
    odds = 1.0 / step.probability - 1.0
    for rival in step.rivals:
        fits = None
        as_free = len(rival.effect.free) <= len(step.effect.free)
        as_free &= rubs or rival.effect.dry == step.effect.dry
        if as_free and rival.effect not in current.effects:
            own = own_values(rival.effect, rival.fit)
            starts = [{**current.values, **own}, {**current.values, **rival.fit.values}]
            starts.append(case.but_for_contact(starts[0]))
            # One that is no cause by all of the record is none of half of it, if it is less likely.
            there = _instead(case, current, step.effect, rival.effect, starts)
            fits = _again(case, current, step.effect, there), there
        if fits is None:
            left.append(rival)
            continue
        here, there = fits
        less = min(likelier_by(case.outputs, *fits), -likelier_by(case.outputs, there, here))
        if less < RIVAL_GAIN:
            left.append(rival)
            continue
        current = here
        odds += weight(less) - weight(step.gain - rival.gain)
    return replace(step, probability=1.0 / (1.0 + max(odds, 0.0)), rivals=tuple(left)), current


def in_place_of_open(case: Case, steps: Sequence[Found], current: Fit) -> tuple[list[Found], Fit]:
    """Return the steps and the fit, with a rival for an effect that all of the record leaves open.

    Half of a record did not tell the two apart. The rival has to say something, and to be surely
    likelier than the rig without either.
    """
    found = list(steps)
    for i, step in enumerate(steps):
        if not step.rivals or not is_open(case, step.effect, current):
            continue
        rest = [one for one in current.effects if one is not step.effect]
        without = case.fit(rest, start=current.values)
        for rival in step.rivals:
            effects = [*rest, rival.effect]
            if rival.effect in rest:
                continue
            fitted = case.fit(effects, start={**current.values, **rival.fit.values})
            causes = may_be_causes(case, [(rival.effect, fitted)])
            more = likelier_by(case.outputs, fitted, without)
            if causes and not is_open(case, rival.effect, fitted) and more >= LEAST_GAIN:
                found[i] = replace(step, effect=rival.effect, rivals=(), behind=())
                current = fitted
                break
    return found, current


def own_values(effect: Effect, fitted: Fit) -> dict[str, float]:
    """Return the values of an effect's own numbers."""
    return {effect.value_key(p): fitted.values[effect.value_key(p)] for p in effect.free}
