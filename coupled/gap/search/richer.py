"""The richer law of dry friction asked on all of the record, where plain friction was found.

Half of a record may hold too few breakaways to earn that law its place, or its fit ends there in a
hollow. On all of it the law must do more, since it can bend farther: `RICHER_GAIN`. What it could
gain is foretold first (`laws`), which costs six replays and spares most of the fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.search.candidates import may_be_causes
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import likelier_by
from coupled.gap.search.information import may_be_plainer, says_nothing
from coupled.gap.search.laws import foretold, little_richer
from coupled.gap.search.rivals import Found, weight
from coupled.gap.thresholds import RICHER_GAIN


def richer_on_all(
    case: Case, library: Sequence[Effect], steps: Sequence[Found], current: Fit
) -> tuple[list[Found], Fit]:
    """Return the steps and the fit, with a richer law in place of plain friction if that is it."""
    found = list(steps)
    plain = next((one.effect for one in steps if one.effect.yielding), None)
    for law in library:
        if plain is None or law.alike is None or law.alike.plainer != plain.name:
            continue
        fitted = _fitted(case, law, plain, current)
        if fitted is None:
            continue
        more = min(
            likelier_by(case.outputs, fitted, current), -likelier_by(case.outputs, current, fitted)
        )
        if more >= RICHER_GAIN:
            sure = 1.0 / (1.0 + weight(more))
            return [
                replace(one, effect=law, probability=sure, rivals=(), behind=())
                if one.effect is plain
                else one
                for one in found
            ], fitted
    return found, current


def _fitted(case: Case, law: Effect, plain: Effect, current: Fit) -> Fit | None:
    """Return the fit of all of the record with a richer law in place of the plain one.

    None where little is foretold, or the law is no cause, or may be plain friction after all.
    """
    gain = foretold(case, law, plain, current, "all")
    if gain is not None and gain < RICHER_GAIN:
        return None
    effects = [law if one is plain else one for one in current.effects]
    starts = little_richer(case, law, plain, current)
    fits = (case.fit(effects, start=start) for start in starts)
    best = min(fits, key=lambda one: one.cost, default=None)
    if best is None or not may_be_causes(case, [(law, best)]):
        return None
    if says_nothing(case, law, best) or may_be_plainer(case, law, best, plain):
        return None
    return best
