"""The criterion that ranks sets of effects: the log evidence of a set, given the record.

For a set E of effects with parameters θ, nuisance parameters φ, and outputs o of N_o frames each:

    ln Z(E) = Σ_o L_o + ln P(E) + ln p(φ̂) − ½·ln det(I + S·H·S)

    L_o  = −½·N_o·m(q_o)              log-likelihood
    q_o  = mean(r_o²)/v_o             r_o: residual over the noise floor, at the fitted parameters
    m(q) = ln q/τ_n where q > 1       the residual's own variance is estimated: noise or misfit
           (q − 1)/τ_o elsewhere      the residual cannot be smaller than the known noise
    τ_o  = (τ_n + e_o·τ_g)/v_o        autocorrelation time of noise and model error together
    v_o  = 1 + e_o                    variance of noise and model error
    e_o  = (ε·(g_o − 1))²             model error: a share ε of the residual without effects, g_o
    ln P(E) = −Σ_effects (A + B·(parameters − 1))
    p(φ)    the Gaussian priors of the nuisance parameters, relative to their maximum
    H = Σ_o J_oᵀJ_o/(τ_n·max(q_o, 1))  information matrix of the log-likelihood
    S = diag(s)                       prior widths, so that s·√(2π) is 1/(prior density at the fit)

If the noise floor includes the model error of the healthy machine, a residual below it is no
evidence, and q_o is at least 1.

The last term is the Laplace approximation of the ratio of posterior to prior volume. The prior of a
size is uniform in its logarithm over Λ = ln 10⁴, so s = |θ̂ − θ₀|·Λ/√(2π), with the neutral value
θ₀; the size is taken as at least its standard error. The evidence is then independent of the unit.
Sizes of one effect that may each be zero, such as friction by direction, have the width of their
largest. The prior of a nuisance parameter is Gaussian, or uniform between its bounds.

τ_n is the integrated autocorrelation time of the smallest residual of output o in any set, and at
least that of the noise floor, where samples of its error are known (`Output.samples`). It is the
same for all sets, so that the longer correlation of a worse residual does not reduce its weight.
τ_g is that of the residual without effects: the model error is a share of it, and is as smooth. A
difference of two sets that is smaller than the model error is then little evidence, however long
the record.

MacKay, Information Theory, Inference, and Learning Algorithms (2003), ch. 28, has the theory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coupled.gap.effects.effect import Effect, Parameter
from coupled.gap.search.found import Fit, Group
from coupled.gap.search.problem import ModelError, Problem
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import NORMAL_95, PRIOR_EFFECT, PRIOR_NUMBER, PRIOR_SPAN
from coupled.rig.rig import Rig


def misfit(square: Floats, smooth: Floats | float = 1.0) -> Floats:
    """Return −2 log-likelihood per sample of residuals of given mean square, less that of 1.

    It is τ_n·m(q); `smooth` is τ_n/τ_o.
    """
    return np.where(square > 1.0, np.log(np.maximum(square, 1.0)), smooth * (square - 1.0))


@dataclass(frozen=True)
class Evidence:
    """The terms of a set's evidence: `rest` is the sum of all terms except Σ L_o.

    `squares` are q_o, `samples` N_o/τ_n from the set's own residuals, shape (outputs,).
    """

    squares: Floats
    samples: Floats
    rest: float
    error: ModelError

    def log(self, samples: Floats) -> float:
        """Return ln Z with given effective samples of each output, shape (outputs,)."""
        misfits = misfit(self.squares, self.error.smooth(samples))
        return self.rest - 0.5 * float(samples @ misfits)


def fewest_unexplained(known: Sequence[Evidence]) -> Floats:
    """Return N_o/τ_n from the smallest residual of each output o, shape (outputs,)."""
    squares = np.array([one.squares for one in known])
    counts = np.array([one.samples for one in known])
    return np.asarray(counts[np.argmin(squares, axis=0), np.arange(squares.shape[1])])


def evidence(problem: Problem, fitted: Fit, error: ModelError) -> Evidence:
    """Return the evidence of the set of a fit."""
    rest = sum(
        _laplace(problem, members, group) - group.penalty
        for members, group in fitted.groups.items()
    )
    return evidence_of(problem, fitted.rig, error, rest + sum(map(log_prior, fitted.effects)))


def evidence_of(problem: Problem, rig: Rig, error: ModelError, rest: float) -> Evidence:
    """Return the evidence of a rig, with all terms but the log-likelihood in `rest`."""
    lefts = [output.residual(rig) for output in problem.outputs]
    squares = np.array([float(np.mean(left**2)) for left in lefts]) / error.variance
    if problem.case.model_error_in_floors:
        squares = np.maximum(squares, 1.0)
    samples = np.array([o.samples(left) for o, left in zip(problem.outputs, lefts, strict=True)])
    return Evidence(squares, samples, rest, error)


def log_prior(effect: Effect) -> float:
    """Return the log prior probability of an effect, relative to its absence.

    An effect that changes several quantities of the rig is as unlikely as that many effects, so
    that it is named only if no effect of one quantity explains the record.
    """
    return -PRIOR_EFFECT * effect.changes - PRIOR_NUMBER * max(len(effect.free) - 1, 0)


def _laplace(problem: Problem, members: Sequence[Effect], group: Group) -> float:
    """Return the Laplace term of the parameters of one group."""
    if not group.values or not group.low:
        return 0.0
    owners = {one.value_key(p): (one, p) for one in members for p in one.free}
    width = np.array([_width(problem, *owners[key], group) for key in group.values])
    scaled = group.information * np.outer(width, width)
    _, logarithm = np.linalg.slogdet(np.eye(len(width)) + scaled)
    return -0.5 * float(logarithm)


def _width(problem: Problem, effect: Effect, p: Parameter, group: Group) -> float:
    """Return the width s of a parameter's prior at its fitted value, in its unit."""
    key, case = effect.value_key(p), problem.case
    if (prior := problem.priors.get(key)) is not None:
        return prior.sigma
    low, high = p.bounds(case.nominal, case.control)
    flat = (high - low) / math.sqrt(2.0 * math.pi)
    sides = [q for q in effect.free if q.may_end and q.mode == "added"]
    if p.may_end and p not in sides:
        return flat
    size = max(
        q.size(group.values[effect.value_key(q)], case.nominal, case.control)
        for q in (sides if p in sides else [p])
    )
    error = 0.5 * (group.high[key] - group.low[key]) / NORMAL_95
    size = min(max(size, error), flat) if math.isfinite(error) else flat
    return size * PRIOR_SPAN / math.sqrt(2.0 * math.pi)


def likelier_by(outputs: Sequence[Output], right: Fit, wrong: Fit) -> float:
    """Return the log-likelihood by which the `right` fit of whole records beats the `wrong` one.

    Effective samples follow from the autocorrelation time of the right fit's residual.
    """
    gain = 0.0
    for output in outputs:
        lefts = output.residual(right.rig), output.residual(wrong.rig)
        better, worse = misfit(np.array([float(np.mean(left**2)) for left in lefts]))
        gain += 0.5 * output.samples(lefts[0]) * float(worse - better)
    return gain
