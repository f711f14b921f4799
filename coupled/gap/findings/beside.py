"""Effects fitted again beside the closed form of a curve.

If an effect is fitted before a curve, its size includes part of the residual that the curve
describes: beside damping by the square of the speed, viscous damping is too large. The curve cannot
correct the size, since it contains a straight line, whose slope is the size. The closed form of the
curve contains no straight line. The effects found are therefore searched again with the closed form
in the nominal rig. Their sizes and probabilities are those of this search. An effect that the
search does not select was an approximation of the curve, and is not in the improved rig.

The size of the closed form is from a linear model with a straight line beside it. If the form
without effects has more evidence at another size, all effects were approximations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from scipy.optimize import minimize_scalar

from coupled.gap.findings.answer import effects_of
from coupled.gap.findings.curves import Curves
from coupled.gap.findings.judge import Judge
from coupled.gap.findings.result import EffectResult
from coupled.gap.search.beam import search_sets
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.evidence import evidence, evidence_of, fewest_unexplained
from coupled.gap.search.found import Choice, Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import explained_below
from coupled.gap.thresholds import DOUBLED, LESSER
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
    beside = search_sets(replace(case, nominal=formed.rig), [one.effect for one in before.steps])
    sized = formed.scaled(case, _best_scale(case, formed))
    if sized is not None:
        alone = search_sets(replace(case, nominal=sized.rig), [])
        if _is_likelier(case, before, alone, beside):
            formed, beside = sized, alone
    after, choice = beside
    if not _explains_as_much(case, before, choice.fit.rig, curves.rig):
        return None
    again = replace(judge, outputs=after.outputs, choice=choice, last=after.gaps(choice.fit.rig))
    kept = {one.name: one for one in effects_of(after, choice, judge.readers, again.stages())}
    left = {one.name for one in effects} - kept.keys()
    odds = {name: math.exp(min(choice.tried.get(name, -math.inf), 0.0)) for name in left}
    formed = replace(formed, rig=choice.fit.rig, instead=odds)
    found, own = choice.fit, Descent("own")
    fitted = Problem(after).fit(found.effects, found.values, descent=own, part="fitted")
    return Beside(
        tuple(kept.get(one.name, formed.probable(one)) for one in effects),
        replace(before, fit=_without_curve(case, found)),
        _without_curve(case, fitted),
        formed,
    )


def _best_scale(case: Case, formed: Curves) -> float:
    """Return the factor on a closed form of the least misfit without effects."""
    problem = Problem(case)
    error = problem.model_error(case.nominal)
    samples = evidence_of(problem, formed.rig, error, 0.0).samples

    def worse(scale: float) -> float:
        sized = formed.scaled(case, scale)
        if sized is None:
            return math.inf
        return -evidence_of(problem, sized.rig, error, 0.0).log(samples)

    return float(minimize_scalar(worse, bounds=(1.0 / DOUBLED, DOUBLED), method="bounded").x)


def _is_likelier(
    case: Case, before: Choice, one: tuple[Case, Choice], other: tuple[Case, Choice]
) -> bool:
    """Tell whether a search has found at least the evidence of another with another curve."""
    error = Problem(case).model_error(before.without_effects.rig)
    known = [evidence(Problem(at), choice.fit, error) for at, choice in (one, other)]
    samples = fewest_unexplained(known)
    return known[0].log(samples) >= known[1].log(samples)


def _without_curve(case: Case, beside: Fit) -> Fit:
    """Return a fit of effects beside a curve, with the rig without the curve."""
    return replace(beside, rig=case.with_only(beside, beside.effects))


def _explains_as_much(case: Case, choice: Choice, rig: Rig, curved: Rig) -> bool:
    """Tell whether each residual with a rig is about as small as that with the curve."""
    root = choice.without_effects.rig
    return all(
        output.gap(rig)
        <= max((1.0 + LESSER) * output.gap(curved), explained_below(output.gap(root), output.limit))
        for output in case.outputs
    )
