"""Fit a set of effects, with the nuisance parameters, to a record's stages by least squares.

The residuals are in noise floors, so each channel weighs by its noise. With the residual r of the
outputs, the effects' parameters θ and the nuisance parameters φ, a fit minimises

    ½·Σ_o w_o·Σ r_o(θ, φ)² + ½·u·Σ ((φ − φ₀)/σ)²

    w_o = min(q·λ)/(q_o·λ_o)    u = min w_o·q_o·τ_o

q_o is the mean square of output o's residual, 1 at least, and τ_o its autocorrelation time in
frames, both where the fit starts; records of one channel share their q_o, the mean over its frames,
since their noise and misfit are of one machine. λ_o is the autocorrelation time of the noise floor
(`Output.lasts`). An output that another effect disturbs weighs less. So does an output with noise
of long correlation: an error of the speed after a restart counts once, not in each of its frames.
u is one unit of −2 log-likelihood, so the nuisance parameters' Gaussian priors, the second sum,
weigh against the data as they do in a posterior. Fits run in several legs, so the weights follow
the residual.

A fit returns its outcome: values, 95 % intervals, the information matrix, and which parameters are
at a bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, Parameter, possible, touched
from coupled.gap.effects.settings import CONTACT
from coupled.gap.search.case import Case
from coupled.gap.search.descent import WHOLE, Descent, End, Slope
from coupled.gap.search.found import Fit, Group
from coupled.gap.search.intervals import cost_of_unit_likelihood, half_width, least_of, open_above
from coupled.gap.signals.output import TRIM, Output, Part
from coupled.gap.thresholds import DOUBLED, FAR, ROUNDS, SLOPES_KEPT, TINY, TRIM_SIGMAS
from coupled.parallel import go_on
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
Normal = tuple[float, float]  # mean and standard deviation
Cost = Callable[[float], float]  # half a sum of squares by the value of one scaled parameter


def fit_set(
    case: Case,
    effects: Sequence[Effect],
    nuisances: Sequence[Effect],
    priors: Mapping[str, Normal],
    start: Mapping[str, float],
    parent: Fit | None = None,
    descent: Descent = WHOLE,
    part: Part = "all",
) -> Fit:
    """Return the effects fitted to a part of the record, with the nuisance parameters free.

    A fit starts from each parameter's own starts, or from its value in `start`, and the best
    minimum is kept. Effects that share no output are fitted separately. Groups of `parent` that are
    the same, and start at their optimum, are reused. If the values give no valid rig, all
    parameters are at a bound. `priors` are by "effect.parameter", in the parameters' units.
    """
    every = [*effects, *nuisances]
    values: dict[str, float] = {}
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    bound: tuple[str, ...] = ()
    groups: dict[tuple[Effect, ...], Group] = {}
    for members in grouped(every):
        known = None if parent is None else parent.groups.get(tuple(members))
        if known is None or any(start.get(key, at) != at for key, at in known.values.items()):
            known = _remembered(case, members, priors, start, descent, parent, part)
        groups[tuple(members)] = known
        low, high, bound = low | known.low, high | known.high, bound + known.at_bound
        values |= known.values
    rig = possible(case.nominal, case.control, every, values)
    if rig is None:
        rig, bound = case.nominal, tuple(values)
    return Fit(tuple(effects), values, low, high, bound, rig, groups)


def fit_alone(
    rig: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    effects: Sequence[Effect],
    start: Mapping[str, float] | None = None,
    part: Part = "all",
) -> Fit:
    """Return effects fitted to a part of some outputs, without nuisance parameters."""
    return fit_set(Case(rig, control, outputs), effects, (), {}, start or {}, part=part)


def grouped(effects: Sequence[Effect]) -> list[list[Effect]]:
    """Return the effects in groups that share no output."""
    groups: list[tuple[set[str], list[Effect]]] = []
    for effect in effects:
        stages, members = set(effect.shows_in), [effect]
        separate = []
        for others, theirs in groups:
            if others & stages:
                stages, members = stages | others, theirs + members
            else:
                separate.append((others, theirs))
        groups = [*separate, (stages, members)]
    return [members for _, members in groups]


def _remembered(
    case: Case,
    members: Sequence[Effect],
    priors: Mapping[str, Normal],
    start: Mapping[str, float],
    descent: Descent,
    parent: Fit | None,
    part: Part,
) -> Group:
    """Return a fit from the cache; a fit that starts at the optimum of another one is that fit.

    Large Jacobians are not cached; that of a fit that ended here is in `descent`.
    """
    ours, known = touched(case.outputs, members), descent.known
    if descent.most < WHOLE.most and parent is not None:
        descent = replace(descent, held=_held(case, ours, _free(members)[0], parent))
    if known is None:
        return _fit(case, ours, members, priors, start, descent, part)
    coarse = any(output.stepped for output in ours) and descent.steps == "coarse"
    what = (tuple(members), coarse, descent.most, part)
    key = (*what, tuple(map(tuple, _starts(members, start))))
    if key not in known:
        found = _fit(case, ours, members, priors, start, descent, part)
        large = found.slope is not None and found.slope.jacobian.size > SLOPES_KEPT
        kept = replace(found, slope=None) if large else found
        known[key] = known[*what, (tuple(found.values.values()),)] = kept
        return found
    held: Group = known[key]
    return replace(held, slope=held.slope or descent.slopes.get(tuple(held.values)))


def _held(case: Case, ours: Sequence[Output], keys: Sequence[str], parent: Fit) -> Floats | None:
    """Return a parent's Jacobian, NaN in columns that it lacks; None if it lacks all."""
    edges = np.cumsum([0, *(len(output.measured) for output in ours)]).tolist()
    rows = {id(one): slice(*ends) for one, ends in zip(ours, pairwise(edges), strict=True)}
    found = np.full((edges[-1], len(keys)), np.nan)
    for members, group in parent.groups.items():
        theirs = [k for k, key in enumerate(group.values) if key in keys]
        if group.slope is None or not theirs:
            continue
        mine = [keys.index([*group.values][k]) for k in theirs]
        found[:, mine] = 0.0
        first = 0
        for output in touched(case.outputs, members):
            last = first + len(output.measured)
            if id(output) in rows:
                found[rows[id(output)], mine] = group.slope.jacobian[first:last, theirs]
            first = last
    return None if np.isnan(found).all() else found


def _fit(
    case: Case,
    ours: Sequence[Output],
    effects: Sequence[Effect],
    priors: Mapping[str, Normal],
    start: Mapping[str, float],
    descent: Descent = WHOLE,
    part: Part = "all",
    legs: int = ROUNDS,
) -> Group:
    """Return a fit; repeat a fit at the loader's own steps until its weights are consistent."""
    nominal, control = case.nominal, case.control
    keys, frees = _free(effects)
    if not ours or not keys:
        known = dict(zip(keys, _starts(effects, start)[0], strict=True))
        return Group(known, {}, {}, (), np.zeros((len(keys), len(keys))))
    scale = np.array([_scale(p) for p in frees])
    frames = [int(np.count_nonzero(output.rows(part))) for output in ours]

    def plain(scaled: Floats, coarse: bool = False, rough: bool = False) -> list[Floats]:
        go_on()
        values = dict(zip(keys, (scaled * scale).tolist(), strict=True))
        rig = possible(nominal, control, effects, values)
        if rig is None:
            return [np.full(count, FAR**2) for count in frames]
        return [output.residual(rig, part, coarse, rough) for output in ours]

    firsts = [np.array(first) / scale for first in _starts(effects, start)]
    begun = plain(firsts[0], coarse=True)
    squares = _squares(ours, begun)
    weights = _weights(ours, squares)

    def residual(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        lefts = zip(plain(scaled, coarse, rough), weights, strict=True)
        return np.concatenate([weight * left for left, weight in lefts])

    ends = np.array([p.bounds(nominal, control) for p in frees]).T
    low, high = ends / scale
    stepped = any(output.stepped for output in ours)
    unit = min(w**2 * _unit(o, left) for w, o, left in zip(weights, ours, begun, strict=True))
    prior = _Priors.of([priors.get(key) for key in keys], scale, unit)
    # The presliding parameters are free if the rig file has dry friction.
    dry = any(one.dry for one in effects) or any(p.key in CONTACT for p in frees)

    def with_prior(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        return np.concatenate((residual(scaled, coarse, rough), prior.rows(scaled)))

    rows = np.repeat(weights, frames)
    search, slope = _with_slopes(descent, keys, prior, rows, dry)
    best = prior.without(search.end(with_prior, firsts, (low, high), stepped, slope=slope))

    def cost_of(k: int) -> Cost:
        def cost(at: float) -> float:
            left = residual(_with(best.x, k, at))
            return 0.5 * float(left @ left)

        return cost

    for k in (k for k, p in enumerate(frees) if p.kind == "saturating"):
        most = cost_of(k)(float(high[k]))
        if most < best.cost:
            span = (float(best.x[k]), float(high[k]))
            edge = _with(best.x, k, least_of(cost_of(k), span, most))
            found = search.end(with_prior, [edge], (low, high), stepped)
            best = min(best, prior.without(found), key=lambda one: one.cost)
    free = _Free(keys, frees, scale, ends, ours, weights, frames)
    there = _with_trim(best, free) if descent.most == WHOLE.most else None
    if there is not None:
        found = search.end(with_prior, [np.clip(there, low, high)], (low, high), stepped)
        best = min(best, prior.without(found), key=lambda one: one.cost)
    changed = _changed(squares, best, free)
    if legs > 1 and descent.steps != "coarse" and changed > DOUBLED:
        again = dict(zip(keys, (best.x * scale).tolist(), strict=True))
        rest = replace(descent, slopes={})
        return _fit(case, ours, effects, priors, again, rest, part, legs - 1)
    best = replace(best, slope=None if search.held is not None else _plain(best.slope, rows))
    number = [1000 * output.record + output.stretches[output.rows(part)] for output in ours]
    errors = _errors(ours, weights, part)
    return _group(case, np.concatenate(number), free, best, prior, cost_of, errors)


def _errors(outputs: Sequence[Output], weights: Sequence[float], part: Part) -> Floats:
    """Return samples of the inputs' error in the weighted residuals, shape (samples, rows)."""
    samples = max(len(output.errors) for output in outputs)
    return np.array(
        [
            np.concatenate(
                [
                    weight / one.floor * one.errors[k][one.rows(part)]
                    if k < len(one.errors)
                    else np.zeros(np.count_nonzero(one.rows(part)))
                    for one, weight in zip(outputs, weights, strict=True)
                ]
            )
            for k in range(samples)
        ]
    )


@dataclass(frozen=True)
class _Free:
    """The free parameters of a fit: keys, scales, and `ends`, their bounds.

    `weights` are those of the `outputs`' residuals, `frames` their numbers of frames.
    """

    keys: list[str]
    numbers: list[Parameter]
    scale: Floats
    ends: Floats
    outputs: Sequence[Output]
    weights: list[float]
    frames: list[int]

    def parts(self) -> Iterator[tuple[Output, slice, float]]:
        """Yield each output in a fit, its rows, and their weight."""
        edges = pairwise(np.cumsum([0, *self.frames]).tolist())
        for output, (first, last), weight in zip(self.outputs, edges, self.weights, strict=True):
            yield output, slice(first, last), weight


def _group(
    case: Case,
    stretches: NDArray[np.intp],
    free: _Free,
    best: End,
    prior: _Priors,
    cost_of: Callable[[int], Cost],
    errors: Floats,
) -> Group:
    """Return the values of a converged fit, with their intervals, and which are at a bound.

    `stretches` are by row, `cost_of` is the cost by the value of a numbered parameter, `errors` are
    samples of the inputs' error, shape (samples, rows).
    """
    (low, high), scale = free.ends / free.scale, free.scale
    half = half_width(best, free.frames, stretches, prior.precision, errors) * scale
    # A lower bound at which nothing is left of the filed value is a valid result, not a bound.
    gone = np.isclose(best.x, low, atol=1e-4) & (free.ends[0] < [p.low for p in free.numbers])
    values = best.x * scale
    for end, bound in zip((low, high), free.ends, strict=True):  # the descent ends just beside it
        values = np.where(np.isclose(best.x, end, rtol=0.0, atol=TINY**2), bound, values)
    values = np.where(gone, free.ends[0], values)
    pairs = zip(free.numbers, values, strict=True)
    half = np.hypot(half, [p.error(v, case.nominal, case.control) for p, v in pairs])
    # A small value may be near its bound on the scale of the start, but differ significantly.
    small = np.isclose(best.x, low, atol=1e-4) & ((best.x - low) * scale <= half)
    stuck = small | np.isclose(best.x, high, rtol=1e-4)
    stuck &= ~np.array([p.may_end for p in free.numbers]) & ~gone
    # A limit that is never reached is undetermined; this does not invalidate the other parameters.
    stuck |= ~np.isfinite(half) & ~np.array([p.may_end and p.is_limit for p in free.numbers])
    lower, upper = values - half, values + half
    for k in (k for k, p in enumerate(free.numbers) if p.kind == "saturating"):
        span, unit = (float(low[k]), float(high[k])), cost_of_unit_likelihood(best, free.frames)
        open_one = open_above(cost_of(k), float(best.x[k]), span, unit)
        if open_one is not None:
            values[k], lower[k], upper[k] = open_one[0] * scale[k], open_one[1] * scale[k], np.inf
            stuck[k] = False
    return Group(
        dict(zip(free.keys, values.tolist(), strict=True)),
        dict(zip(free.keys, lower.tolist(), strict=True)),
        dict(zip(free.keys, upper.tolist(), strict=True)),
        tuple(key for key, at in zip(free.keys, stuck, strict=True) if at),
        _information(best, free) / np.outer(scale, scale),
        prior.penalty(best.x),
        best.slope,
    )


def _unit(output: Output, left: Floats) -> float:
    """Return the sum of squares that is one unit of −2 log-likelihood of an output's residual."""
    return max(float(np.mean(left**2)), 1.0) * len(left) / output.samples(left)


def _squares(outputs: Sequence[Output], lefts: Sequence[Floats]) -> list[float]:
    """Return the mean square of each output's channel, floors², 1 at least."""
    channels = [(output.stage, output.channel) for output in outputs]
    found = []
    for channel in channels:
        same = [left for left, other in zip(lefts, channels, strict=True) if other == channel]
        found.append(max(float(np.mean(np.concatenate(same) ** 2)), 1.0))
    return found


def _weights(outputs: Sequence[Output], squares: Sequence[float]) -> list[float]:
    """Return √w_o of each output, from its mean square q_o."""
    noisy = [square * output.lasts for square, output in zip(squares, outputs, strict=True)]
    return [math.sqrt(min(noisy) / one) for one in noisy]


def _with_slopes(
    descent: Descent, keys: Sequence[str], prior: _Priors, rows: Floats, dry: bool
) -> tuple[Descent, Slope | None]:
    """Return the options of a fit with priors, and the Jacobian of a fit that ended at its start.

    `rows` are the weights of the residual's rows.
    """
    before, held = descent.slopes.get(tuple(keys)), descent.held
    slope = None if before is None else prior.in_slope(before, rows)
    if held is not None:
        held = np.vstack((rows[:, None] * held, prior.slopes))
    return replace(descent, dry=dry, held=held), slope


def _with_trim(end: End, free: _Free) -> Floats | None:
    """Return the parameters with which the model trims as the records do; None if it does.

    A flight beyond the trim's error is moved to the model's own trim (`openloop`), so that the cost
    has another minimum. Of the parameters with the record's trim, to first order, these increase
    the cost least.
    """
    trims = [rows for output, rows, _ in free.parts() if output.channel == TRIM]
    if not trims:
        return None
    left = np.concatenate([end.fun[rows] for rows in trims])
    slope = np.concatenate([end.jac[rows] for rows in trims]).mean(axis=0)
    toward = np.linalg.pinv(end.jac.T @ end.jac) @ slope
    reach = float(slope @ toward)
    if abs(left.mean()) * math.sqrt(len(left)) <= TRIM_SIGMAS or reach <= 0.0:
        return None
    return np.asarray(end.x - toward * left.mean() / reach)


def _changed(squares: Sequence[float], end: End, free: _Free) -> float:
    """Return the largest factor by which a channel's mean square changed in a weighted fit."""
    ended = _squares(free.outputs, [end.fun[rows] / weight for _, rows, weight in free.parts()])
    return max(max(a / b, b / a) for a, b in zip(squares, ended, strict=True))


def _plain(slope: Slope | None, weights: Floats) -> Slope | None:
    """Return a weighted fit's Jacobian without the rows' weights and the priors' rows."""
    if slope is None:
        return None
    left, jacobian = slope.residual[: len(weights)], slope.jacobian[: len(weights)]
    return Slope(slope.at, left / weights, jacobian / weights[:, None])


def _information(end: End, free: _Free) -> Floats:
    """Return the information matrix of the log-likelihood at the end of a weighted fit."""
    total = np.zeros((end.jac.shape[1], end.jac.shape[1]))
    for output, rows, weight in free.parts():
        jacobian = end.jac[rows] / weight
        total += jacobian.T @ jacobian / _unit(output, end.fun[rows] / weight)
    return total


@dataclass(frozen=True)
class _Priors:
    """The Gaussian priors of scaled parameters: `at` numbers those that have one.

    `unit` is the part of a sum of squares that is one unit of −2 log-likelihood.
    """

    at: NDArray[np.intp]
    mean: Floats
    sigma: Floats
    numbers: int
    unit: float

    @classmethod
    def of(cls, each: Sequence[Normal | None], scale: Floats, unit: float) -> _Priors:
        """Return the priors of parameters; None in `each` for a parameter without a prior."""
        known = [(k, prior) for k, prior in enumerate(each) if prior is not None]
        at = np.array([k for k, _ in known], dtype=np.intp)
        mean = np.array([prior[0] for _, prior in known]) / scale[at]
        sigma = np.array([prior[1] for _, prior in known]) / scale[at]
        return cls(at, mean, sigma, len(each), unit)

    def rows(self, scaled: Floats) -> Floats:
        """Return the residual rows of the priors."""
        return np.asarray(np.sqrt(self.unit) * (scaled[self.at] - self.mean) / self.sigma)

    @property
    def precision(self) -> Floats:
        """1/variance of each scaled parameter's prior, 0 without a prior."""
        found = np.zeros(self.numbers)
        found[self.at] = self.sigma**-2.0
        return found

    def penalty(self, scaled: Floats) -> float:
        """Return the log density of the priors below its maximum."""
        return 0.5 * float(np.sum(((scaled[self.at] - self.mean) / self.sigma) ** 2))

    @property
    def slopes(self) -> Floats:
        """The Jacobian of the rows, shape (rows, parameters)."""
        found = np.zeros((len(self.at), self.numbers))
        found[np.arange(len(self.at)), self.at] = np.sqrt(self.unit) / self.sigma
        return found

    def in_slope(self, slope: Slope, weights: Floats) -> Slope:
        """Return another fit's Jacobian with weighted rows, and the rows of these priors."""
        left = np.concatenate((weights * slope.residual, self.rows(slope.at)))
        return Slope(slope.at, left, np.vstack((weights[:, None] * slope.jacobian, self.slopes)))

    def without(self, end: End) -> End:
        """Return the end of a fit without the priors' rows."""
        if not len(self.at):
            return end
        left, jacobian = end.fun[: -len(self.at)], end.jac[: -len(self.at)]
        return replace(end, fun=left, jac=jacobian, cost=0.5 * float(left @ left))


def _with(x: Floats, k: int, at: float) -> Floats:
    """Return scaled parameters with one of them at another value."""
    other = x.copy()
    other[k] = at
    return other


def _scale(p: Parameter) -> float:
    """Return the scale of a parameter, of which a hundredth is a small step."""
    return max(abs(start) for start in p.starts) or 0.5 * (p.high - p.low)


def _free(effects: Sequence[Effect]) -> tuple[list[str], list[Parameter]]:
    """Return the keys and parameters that a fit frees; of two of one rig key, the first."""
    owners: dict[str, tuple[str, Parameter]] = {}
    for effect in effects:
        for p in effect.free:
            owners.setdefault(p.key, (effect.value_key(p), p))
    return [key for key, _ in owners.values()], [p for _, p in owners.values()]


def _starts(effects: Sequence[Effect], start: Mapping[str, float]) -> list[list[float]]:
    pairs = list(zip(*_free(effects), strict=True))
    tries = max((len(p.starts) for key, p in pairs if key not in start), default=1)
    return [
        [start.get(key, p.starts[min(i, len(p.starts) - 1)]) for key, p in pairs]
        for i in range(tries)
    ]
