"""The richer of two laws asked on all of the record, where the plainer one was found.

Half of a record may hold too few breakaways to earn a law of friction its place, or leave open how
a servo with a dead time is damped; and a fit to it may end in a hollow. On all of it the richer law
must do more, since it can bend farther: by `RICHER_GAIN` of dry friction, of which no law is exact.
What that could gain is foretold first (`laws`): it costs six replays and spares most of the fits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.search.candidates import may_be_causes
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import likelier_by
from coupled.gap.search.information import may_be_plainer, says_nothing
from coupled.gap.search.laws import Starts, foretold, little_richer
from coupled.gap.search.rivals import Found, weight
from coupled.gap.thresholds import RICHER_GAIN, RIVAL_GAIN


def richer_on_all(
    case: Case, library: Sequence[Effect], steps: Sequence[Found], current: Fit
) -> tuple[list[Found], Fit]:
    """Return the steps and the fit, with a richer law in place of a plainer one if that is it."""
    found = list(steps)
    for i, step in enumerate(steps):
        for law, least, starts in _richer(case, library, step.effect, current):
            effects = [law if one is step.effect else one for one in current.effects]
            fits = [case.fit(effects, start=start) for start in starts]
            fitted = min(fits, key=lambda one: one.cost, default=None)
            if fitted is None or not _is_cause(case, law, step.effect, fitted):
                continue
            more = likelier_by(case.outputs, fitted, current)
            if more >= least:
                sure = 1.0 / (1.0 + weight(more))
                found[i] = replace(step, effect=law, probability=sure, rivals=(), behind=())
                current = fitted
                break
    return found, current


def _richer(
    case: Case, library: Sequence[Effect], plain: Effect, current: Fit
) -> Iterator[tuple[Effect, float, Starts]]:
    """Yield the laws richer than one, by how much they must be likelier, and where fits start."""
    for law in library:
        if law in current.effects:
            continue
        if law.alike is not None and law.alike.plainer == plain.name:
            gain = foretold(case, law, plain, current, "all")
            if gain is None or gain >= RICHER_GAIN:
                yield law, RICHER_GAIN, little_richer(case, law, plain, current)
        elif plain.reserve and law.reserve and _keys(plain) < _keys(law):
            known = {p.key: current.values[plain.value_key(p)] for p in plain.free}
            start = {law.value_key(p): known.get(p.key, p.starts[0]) for p in law.free}
            yield law, RIVAL_GAIN, [{**current.values, **start}]


def _keys(effect: Effect) -> set[str]:
    """Return the numbers of the rig that an effect frees."""
    return {p.key for p in effect.free}


def _is_cause(case: Case, law: Effect, plain: Effect, fitted: Fit) -> bool:
    """Tell whether a law says something by its fit, and that it is not the plainer one."""
    silent = says_nothing(case, law, fitted) or may_be_plainer(case, law, fitted, plain)
    return bool(may_be_causes(case, [(law, fitted)])) and not silent
