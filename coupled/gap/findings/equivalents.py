"""Effects whose predictions equal those of an effect found: nothing in the records favours either.

A zero of the force gauge and a constant force on the loader, or a scale of the force and one of the
deflection on an axis without a spring, change an output alike. Of such effects the search may fit
one only, and the evidence of those that it fits differs by the priors of their sizes alone. An
effect of one parameter is therefore replaced in turn by every other one that shows in the same
outputs. A replacement is equivalent if its fit has the same log-likelihood. Equivalent effects
share their probability equally, and are alternatives of each other.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect, keys_of, touched
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.evidence import likelier_by
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.search.problem import Problem
from coupled.gap.thresholds import ALIKE, SAME_LIKELIHOOD
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


def with_equivalents(choice: Choice, case: Case, library: Sequence[Effect]) -> Choice:
    """Return a choice in which equivalent effects are alternatives of equal probability."""
    steps = tuple(_with_equivalents(step, choice, case, library) for step in choice.steps)
    return replace(choice, steps=steps)


def _with_equivalents(step: Found, choice: Choice, case: Case, library: Sequence[Effect]) -> Found:
    """Return an effect found with its equivalents among its alternatives."""
    known = [one for one in step.rivals if _as_many(one.fit, choice.fit)]
    alike = [one for one in known if _is_as_likely(case, choice.fit, one.fit)]
    others = [e for e in library if e.name not in {one.effect.name for one in step.rivals}]
    fits = _fitted_in_place(step.effect, choice.fit, case, others)
    new = [
        Candidate(step.gain, fit.effects[-1], fit)
        for fit in fits
        if _is_as_likely(case, choice.fit, fit)
    ]
    if not alike and not new:
        return step
    # The probabilities of the search are relative to the sets that it fitted: more sets, each as
    # probable as the set found, share the same total.
    weights = [choice.probability * math.exp(one.gain - step.gain) for one in alike]
    more = len(new) * step.probability
    shared = (step.probability + sum(weights) + more) / (1.0 + more) / (1 + len(alike) + len(new))
    probability = min(step.probability, shared)
    return replace(step, probability=probability, rivals=(*step.rivals, *new))


def _as_many(one: Fit, other: Fit) -> bool:
    """Tell whether two sets have as many effects, with as many parameters."""
    each = ([len(effect.free) for effect in fit.effects] for fit in (one, other))
    first, second = each
    return len(first) == len(second) and sum(first) == sum(second)


def _is_as_likely(case: Case, found: Fit, other: Fit) -> bool:
    """Tell whether another fit has the log-likelihood of the fit found, or a larger one."""
    ours = touched(case.outputs, [*found.effects, *other.effects])
    return likelier_by(ours, found, other) < SAME_LIKELIHOOD


def _fitted_in_place(
    effect: Effect, found: Fit, case: Case, library: Sequence[Effect]
) -> list[Fit]:
    """Return fits with an effect of one parameter replaced by effects that change outputs alike.

    The changes are alike if the cosine between them exceeds 1 − `ALIKE`.
    """
    outputs = touched(case.outputs, [effect])
    stages = {output.stage for output in outputs}
    if len(effect.free) != 1 or STAGE_OF[effect.stage].flown:
        return []
    rest = tuple(one for one in found.effects if one is not effect)
    taken, problem, fits = keys_of(found.effects), Problem(case), list[Fit]()

    def residual(rig: Rig) -> Floats:
        return np.concatenate([output.residual(rig, coarse=True) for output in outputs])

    without = residual(case.with_only(found, rest))
    action = without - residual(found.rig)
    for other in library:
        shown = {output.stage for output in touched(case.outputs, [other])}
        if len(other.free) != 1 or shown != stages or not taken.isdisjoint(keys_of([other])):
            continue
        (p,) = other.free
        none = p.neutral(case.nominal, case.control)
        start = p.base(case.nominal, case.control) + p.starts[0]
        key, values = other.value_key(p), dict(found.values)
        rig = problem.rig_of((*rest, other), values | {key: start})
        if rig is None:
            continue
        change = without - residual(rig)
        size, along = float(change @ change), float(change @ action)
        if abs(along) <= (1.0 - ALIKE) * math.sqrt(size * float(action @ action)):
            continue
        low, high = p.bounds(case.nominal, case.control)
        value = none + (start - none) * along / size
        begun = values | {key: min(max(value, low), high)}
        fit = problem.fit((*rest, other), begun, None, Descent("own"))
        fits += [fit] if key not in fit.at_bound else []
    return fits
