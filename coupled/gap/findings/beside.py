"""Effects fitted again beside the closed form of a curve.

If an effect is fitted before a curve, its size includes part of the residual that the curve
describes: beside damping by the square of the speed, viscous damping is too large. The curve cannot
correct the size, since it contains a straight line, whose slope is the size. The closed form of the
curve contains no straight line. The effects found are therefore searched again with the closed form
in the nominal rig. Their sizes and probabilities are those of this search. An effect that the
search does not select was an approximation of the curve.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from coupled.gap.findings.answer import effects_of
from coupled.gap.findings.curves import Curves
from coupled.gap.findings.judge import Judge
from coupled.gap.findings.result import EffectResult
from coupled.gap.search.beam import search_sets
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.found import Choice, Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import explained_below
from coupled.gap.thresholds import LESSER
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Beside:
    """The effects beside a curve's closed form, and the curve in that form.

    `choice` has their sizes without the curve, `fitted` those of a fit to every other stretch.
    """

    effects: tuple[EffectResult, ...]
    choice: Choice
    fitted: Fit
    curves: Curves


def beside_closed_form(
    judge: Judge, case: Case, effects: Sequence[EffectResult], curves: Curves
) -> Beside | None:
    """Return the effects found, beside the closed form of the only curve.

    None if there are no effects, if there is no closed form without a kink, whose place is known
    only roughly, or if the form explains less than the curve.
    """
    formed = curves.in_closed_form(case)
    if formed is None or not effects:
        return None
    before = judge.choice
    after, choice = search_sets(
        replace(case, nominal=formed.rig), [step.effect for step in before.steps]
    )
    if not _explains_as_much(case, before, choice.fit.rig, curves.rig):
        return None
    again = replace(judge, outputs=after.outputs, choice=choice, last=after.gaps(choice.fit.rig))
    sized = {one.name: one for one in effects_of(after, choice, judge.readers, again.stages())}
    left = {one.name for one in effects} - sized.keys()
    odds = {name: math.exp(min(choice.tried.get(name, -math.inf), 0.0)) for name in left}
    formed = replace(formed, rig=choice.fit.rig, instead=odds)
    found, own = choice.fit, Descent("own")
    fitted = Problem(after).fit(found.effects, found.values, descent=own, part="fitted")
    return Beside(
        tuple(sized.get(one.name, formed.probable(one)) for one in effects),
        replace(before, fit=_without_curve(case, before.fit, found)),
        _without_curve(case, before.fit, fitted),
        formed,
    )


def _without_curve(case: Case, before: Fit, beside: Fit) -> Fit:
    """Return a fit with the sizes beside a curve, and the rig with them but without the curve."""
    found = replace(
        before,
        values={**before.values, **beside.values},
        low={**before.low, **beside.low},
        high={**before.high, **beside.high},
    )
    return replace(found, rig=case.with_only(found, found.effects))


def _explains_as_much(case: Case, choice: Choice, rig: Rig, curved: Rig) -> bool:
    """Tell whether each residual with a rig is about as small as that with the curve."""
    root = choice.without_effects.rig
    return all(
        output.gap(rig)
        <= max((1.0 + LESSER) * output.gap(curved), explained_below(output.gap(root), output.limit))
        for output in case.outputs
    )
