"""Whether one function of the aircraft's model explains a gap better than the effects found.

The library's effects change whole forces, and the usual derivatives. A JSBSim model has more
functions: the drag at no lift, or the yawing moment due to a roll rate. If one function is wrong,
several effects approximate it, each with an evidence far above its prior, or one effect whose size
drifts. So if several effects of the airframe were found, or an uncertain effect, or if the residual
exceeds the noise, a factor on each function is fitted in place of the effects. These fits are
compared with the best set by log evidence.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.effect import Effect
from coupled.gap.findings.result import EffectResult
from coupled.gap.search.beam import is_admissible
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.evidence import evidence, fewest_unexplained
from coupled.gap.search.found import Candidate, Choice, Found
from coupled.gap.search.problem import Problem
from coupled.gap.search.screen import Screen, Worth
from coupled.gap.signals.output import unexplained
from coupled.gap.thresholds import CERTAIN, RIVAL_GAIN, TRIES
from coupled.parallel import in_threads


def needs_a_function(case: Case, choice: Choice, effects: Sequence[EffectResult]) -> bool:
    """Tell whether effects of the airframe are several or not certain, or leave more than noise."""
    if case.timings:
        return False
    names = {effect.name for effect in choice.fit.effects if AIRFRAME in effect.shows_in}
    doubtful = any(one.name in names and one.probability < CERTAIN for one in effects)
    first, left = case.gaps(choice.without_effects.rig), case.gaps(choice.fit.rig)
    open_one = AIRFRAME in unexplained(first, left, case.outputs)
    return doubtful or len(names) > 1 or open_one


def by_one_function(case: Case, choice: Choice, functions: Sequence[Effect]) -> Choice | None:
    """Return the choice of one function in place of the effects of the airframe.

    None if no function explains the airframe with more log evidence than the effects have.
    """
    problem, root = Problem(case), choice.without_effects
    kept = [one for one in choice.fit.effects if AIRFRAME not in one.shows_in]
    base = problem.fit(kept, choice.fit.values) if kept else root
    error = problem.model_error(root.rig)
    best = evidence(problem, choice.fit, error)
    counts = fewest_unexplained([evidence(problem, base, error), best])
    screened = Screen(problem, error).best(base, functions, Worth(0.0, counts), TRIES)
    starts = [((*kept, one.effect), {**base.values, **one.starts[0]}) for one in screened]
    before = case.gaps(root.rig)
    fits = [
        fit
        for fit in in_threads(lambda one: problem.fit(*one, descent=Descent("own")), starts)
        if is_admissible(problem, fit)
        and AIRFRAME not in unexplained(before, case.gaps(fit.rig), case.outputs)
    ]
    if not fits:
        return None
    each = [best, *(evidence(problem, fit, error) for fit in fits)]
    counts = fewest_unexplained(each)
    logs = np.array([one.log(counts) for one in each])
    first = int(np.argmax(logs))
    if logs[first] - logs[0] <= RIVAL_GAIN:
        return None
    weights = np.exp(logs - logs[first])
    weights /= weights.sum()
    found, none = fits[first - 1], evidence(problem, base, error).log(counts)
    rivals = tuple(
        Candidate(float(log) - none, fit.effects[-1], fit)
        for log, fit in zip(logs[1:], fits, strict=True)
        if fit is not found and log > logs[first] - RIVAL_GAIN
    )
    gain, share = float(logs[first]) - none, float(weights[first])
    steps = [step for step in choice.steps if step.effect in kept]
    steps.append(Found(found.effects[-1], gain, share, rivals))
    steps.sort(key=lambda step: -step.gain)
    return Choice(tuple(steps), found, root, choice.tried, choice.rounds, share)
