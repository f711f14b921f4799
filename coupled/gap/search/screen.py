"""Screening: select effects that may explain a residual, by projection on their signatures.

A signature is the change of the residual that an effect of a given size makes. Signatures are
computed at sizes over three decades, in both directions, since friction, play and rate limits are
strongly nonlinear in their size; of effects near the best, also at the size that the projection
predicts. The projection is independent of scale. A fit starts from the size of least residual.

The power of the projection is the statistic of the score test, and gives the predicted gain in
log-likelihood (Rao, Math. Proc. Camb. Phil. Soc. 44, 1948). An effect is fitted only if this gain
exceeds its log prior. Signatures depend little on the other effects of a set. They are computed
once, and again only with the best set.

A candidate may be significant only if the sizes of the present effects change with it: a wrong
scale takes most of the residual of damping and friction. The best candidate by the part of its
signature that the present effects cannot make (the efficient score) is therefore fitted as well,
or all of them if no other is worth a fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, touched
from coupled.gap.search.evidence import misfit
from coupled.gap.search.found import Fit
from coupled.gap.search.problem import ModelError, Problem
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import (
    BEAM_CANDIDATES,
    BEAM_FACTORS,
    BEAM_SIZES,
    FURTHER,
    LIMIT_BISECTIONS,
    LIMIT_SHARES,
    NEGLIGIBLE,
    SCREEN_LESS,
    SCREEN_NEAR,
    SERVO_SHARES,
    SMALL,
    TINY,
)
from coupled.parallel import go_on, in_threads
from coupled.rig.rig import Rig

Values = dict[str, float]


class Screened(NamedTuple):
    """A candidate, the starts of its fits, and the projection of the residual on its signature.

    `taken` is the power of the projection, noise floors², `gain` the predicted log-likelihood gain.
    `refitted` as in `_screened`.
    """

    effect: Effect
    starts: list[Values]
    taken: float
    gain: float
    refitted: bool


class Worth(NamedTuple):
    """The `least` predicted gain for a fit, and `counts`, the effective samples of each output."""

    least: float
    counts: Floats


class _Signature(NamedTuple):
    """The change of the residual by an effect with given values, noise floors."""

    values: Values
    shape: int
    change: Floats

    @property
    def power(self) -> float:
        return float(self.change @ self.change)


@dataclass
class Screen:
    """The screen of candidates to add to a set, with a cache of their signatures."""

    problem: Problem
    error: ModelError
    known: dict[str, list[_Signature]] = field(default_factory=dict)

    def best(
        self,
        current: Fit,
        candidates: Sequence[Effect],
        worth: Worth,
        most: int = BEAM_CANDIDATES,
        anew: bool = False,
    ) -> list[Screened]:
        """Return the candidates with the largest projections of the residual, the best first.

        Candidates far below the best, or with too small a predicted gain (`worth`), are left out.
        Signatures are computed with the current effects if they are not cached, or if `anew`.
        """
        wanted = [e for e in candidates if anew or e.name not in self.known]
        for effect, made in zip(
            wanted, in_threads(lambda e: self._signatures(current, e), wanted), strict=True
        ):
            self.known[effect.name] = made
        self._refine(current, wanted)
        found = self._worth_a_fit(current, candidates, worth, most)
        if current.effects and (anew or not found):
            others = [e for e in candidates if all(one.effect is not e for one in found)]
            found += self._worth_a_fit(current, others, worth, 1 if found else most, refitted=True)
        return found

    def _worth_a_fit(
        self,
        current: Fit,
        candidates: Sequence[Effect],
        worth: Worth,
        most: int,
        refitted: bool = False,
    ) -> list[Screened]:
        """Return the candidates of the largest projections; `refitted` as in `_screened`."""
        found = [self._screened(current, e, worth.counts, refitted) for e in candidates]
        found = [one for one in found if one.starts and one.gain > worth.least]
        found.sort(key=lambda one: -one.taken)
        least = SCREEN_NEAR * found[0].taken if found else 0.0
        return [one for one in found[:most] if one.taken >= least]

    def still_worth(
        self, current: Fit, screened: Sequence[Screened], worth: Worth
    ) -> list[Screened]:
        """Return the screened candidates whose gain, with other effective samples, is enough."""
        again = [self._screened(current, e.effect, worth.counts, e.refitted) for e in screened]
        return [one for one, now in zip(screened, again, strict=True) if now.gain > worth.least]

    def _ours(self, effect: Effect) -> list[int]:
        """Return the indices of the outputs in which an effect shows."""
        return [k for k, one in enumerate(self.problem.outputs) if one.stage in effect.shows_in]

    def _edges(self, ours: Sequence[int]) -> NDArray[np.int64]:
        """Return the first frame of each of some outputs in their joint residual."""
        return np.cumsum([0, *(len(self.problem.outputs[k].measured) for k in ours[:-1])])

    def _samples(self, ours: Sequence[int], left: Floats) -> Floats:
        """Return the effective samples of some outputs' residuals."""
        parts = np.split(left, self._edges(ours)[1:])
        outputs = [self.problem.outputs[k] for k in ours]
        return np.array([one.samples(part) for one, part in zip(outputs, parts, strict=True)])

    def _gain(self, ours: Sequence[int], before: Floats, after: Floats, samples: Floats) -> float:
        """Return the increase of the log-likelihood of some outputs from one residual to another.

        `samples` are the effective samples of each output.
        """
        smooth = self.error.of(ours).smooth(samples)
        misfits = [misfit(self._squares(ours, left), smooth) for left in (before, after)]
        return 0.5 * float(samples @ (misfits[0] - misfits[1]))

    def _slopes(self, current: Fit, effect: Effect) -> Floats:
        """Return an orthonormal basis of the current effects' signatures, (frames, parameters).

        The frames are those of the outputs of `effect`. Slopes that were not kept are left out.
        """
        problem, own = self.problem, {e.value_key(p) for e in current.effects for p in e.free}
        ours = touched(problem.outputs, [effect])
        columns = [np.zeros((sum(len(output.measured) for output in ours), 0))]
        for members, group in current.groups.items():
            numbers = [k for k, key in enumerate(group.values) if key in own]
            if group.slope is None or not numbers:
                continue
            theirs = touched(problem.outputs, members)
            edges = np.cumsum([len(output.measured) for output in theirs])[:-1]
            parts = np.split(group.slope.jacobian[:, numbers], edges)
            known = {id(output): part for output, part in zip(theirs, parts, strict=True)}
            lacking = [np.zeros((len(output.measured), len(numbers))) for output in ours]
            columns.append(
                np.vstack([known.get(id(o), none) for o, none in zip(ours, lacking, strict=True)])
            )
        basis, size, _ = np.linalg.svd(np.hstack(columns), full_matrices=False)
        return np.asarray(basis[:, size > TINY * size.max(initial=0.0)])

    def _squares(self, ours: Sequence[int], left: Floats) -> Floats:
        """Return the mean squares of some outputs' residuals, over their variance."""
        frames = np.array([len(self.problem.outputs[k].measured) for k in ours])
        squares = np.add.reduceat(left**2, self._edges(ours)) / frames
        return np.asarray(squares / self.error.variance[list(ours)])

    def _screened(
        self, current: Fit, effect: Effect, counts: Floats, refitted: bool = False
    ) -> Screened:
        """Return a candidate with the best start of each shape, least residual first.

        `refitted`: the parameters of the current effects change with it, and its gain is that of
        its effective samples without it and them.
        """
        now, ours = _residual(self.problem, effect, current.rig), self._ours(effect)
        beside = self._slopes(current, effect) if refitted else np.zeros((len(now), 0))

        def gain_to(left: Floats) -> float:
            samples = self._samples(ours, left) if refitted else counts[ours]
            return self._gain(ours, now, left, samples)

        taken, gain, starts = 0.0, 0.0, dict[int, tuple[float, Values]]()
        for values, shape, whole in self.known[effect.name]:
            size = float(whole @ whole)
            # A limit that is never reached does not change the residual.
            if size <= NEGLIGIBLE**2 * len(now):
                continue
            change = whole - beside @ (beside.T @ whole)
            if float(change @ change) <= TINY * size:
                continue
            size = float(change @ change)
            share = float(now @ change) / size
            taken = max(taken, share**2 * size)
            gain = max(gain, gain_to(now - share * change))
            left = float((now + change) @ (now + change))
            # A slope's start has a usual size; the projection gives its sign, or a smaller size.
            times = min(max(-share, -1.0), 1.0) if effect.flies else 1.0
            if shape not in starts or left < starts[shape][0]:
                starts[shape] = left, _times(self.problem, effect, values, times)
        found = [values for _, values in sorted(starts.values(), key=lambda one: one[0])]
        return Screened(effect, found, taken, gain, refitted)

    def _signatures(self, current: Fit, effect: Effect) -> list[_Signature]:
        """Return an effect's signatures with the current effects.

        That of an effect that needs flights is its slope, from a small step: between trims further
        apart, what the trim has left of the accelerations jumps.
        """
        part = SMALL if effect.flies else 1.0
        return [
            one
            for shape, tries in enumerate(_tries(self.problem, current, effect))
            for values in tries
            for one in self._signature(current, effect, values, shape, part)
        ]

    def _signature(
        self, current: Fit, effect: Effect, values: Values, shape: int, part: float = 1.0
    ) -> list[_Signature]:
        """Return an effect's signature, from a part of the sizes; none if it is no valid rig."""
        go_on()
        rig = _with(self.problem, current, effect, _times(self.problem, effect, values, part))
        if rig is None:
            return []
        ours = touched(self.problem.outputs, [effect])
        change = np.concatenate([output.change(current.rig, rig) for output in ours])
        return [_Signature(values, shape, change / part)]

    def _refine(self, current: Fit, effects: Sequence[Effect]) -> None:
        """Add signatures of other sizes than the usual ones, of effects that need no flight.

        Larger sizes are tried of all these effects. Of those whose projections are then near the
        largest, the sizes that the projections predict are tried too: if a residual is not linear
        in a size, its gain is predicted well only near the size of least residual. Single limits
        have sizes of their own.
        """
        some = [e for e in effects if not (e.flies or e.seen or is_limit(e))]
        in_threads(lambda effect: self._refine_one(current, effect, False), some)
        each = [(self._taken(current, effect), effect) for effect in effects]
        least = SCREEN_NEAR * max((taken for taken, _ in each), default=0.0)
        near = [effect for taken, effect in each if taken >= least and effect in some]
        in_threads(lambda effect: self._refine_one(current, effect, True), near)

    def _taken(self, current: Fit, effect: Effect) -> float:
        """Return the power of the residual's largest projection on the effect's signatures."""
        now = _residual(self.problem, effect, current.rig)
        each = ((one.change, float(one.change @ one.change)) for one in self.known[effect.name])
        enough = NEGLIGIBLE**2 * len(now)
        return max((float(now @ a) ** 2 / size for a, size in each if size > enough), default=0.0)

    def _refine_one(self, current: Fit, effect: Effect, by_projection: bool) -> None:
        """Add signatures of larger sizes, or of predicted ones, while they reduce the residual.

        Their best size is a further start of the fit, of shape `~shape`, since beside other effects
        one of the usual sizes may be right.
        """
        now, found = _residual(self.problem, effect, current.rig), list[_Signature]()
        known = self.known[effect.name]

        def left(one: _Signature) -> float:
            return float((now + one.change) @ (now + one.change))

        for shape in sorted({one.shape for one in known if one.shape >= 0}):
            ours = [one for one in known if one.shape in (shape, ~shape)]
            while (best := min(ours, key=left)).power > NEGLIGIBLE**2 * len(now):
                times = -float(now @ best.change) / best.power
                if not by_projection:
                    larger = [one for one in ours if one.power > best.power]
                    times = 0.0 if any(now @ one.change < 0.0 for one in larger) else FURTHER
                if times <= 0.0:
                    break
                values = _times(self.problem, effect, best.values, times)
                more = self._signature(current, effect, values, ~shape)
                if values == best.values or not more:
                    break
                if left(best) - left(more[0]) < SMALL * float(now @ now):
                    break
                ours.append(more[0])
            found += ours
        self.known[effect.name] = found


def _residual(problem: Problem, effect: Effect, rig: Rig) -> Floats:
    ours = touched(problem.outputs, [effect])
    return np.concatenate([output.residual(rig, coarse=True) for output in ours])


def _with(problem: Problem, current: Fit, effect: Effect, values: Values) -> Rig | None:
    """Return the current rig with one more effect; None if it is no valid rig."""
    return problem.rig_of((*current.effects, effect), {**current.values, **values})


def _times(problem: Problem, effect: Effect, values: Values, times: float) -> Values:
    """Return values whose sizes are so many times as far from their neutral ones, in bounds."""
    case, found = problem.case, dict(values)
    for p in effect.free if times != 1.0 else ():
        if p.is_size:
            key, none = effect.value_key(p), p.neutral(case.nominal, case.control)
            far = values[key] / times if p.is_limit else none + times * (values[key] - none)
            found[key] = float(np.clip(far, *p.bounds(case.nominal, case.control)))
    return found


def _tries(problem: Problem, current: Fit, effect: Effect) -> list[list[Values]]:
    """Return values of an effect's parameters to try, by shape; each shape may give a start."""
    if is_limit(effect) and not effect.flies:
        key = effect.value_key(effect.free[0])
        now = _residual(problem, effect, current.rig)

        def shows(value: float) -> bool:
            go_on()
            rig = _with(problem, current, effect, {key: value})
            if rig is None:
                return False
            change = _residual(problem, effect, rig) - now
            return float(change @ change) > NEGLIGIBLE**2 * len(now)

        return [[{key: value} for value in each] for each in limits(effect, shows)]
    if effect.seen is None:
        shapes = max([len(p.starts) for p in effect.free], default=1)
        return [_sizes(problem, current, effect, shape) for shape in range(shapes)]
    seen = effect.seen(problem.outputs, current.rig, problem.case.control)
    return [
        [
            {effect.value_key(p): float(np.clip(one[p.name], p.low, p.high)) for p in effect.free}
            for one in seen
        ]
    ]


def _sizes(problem: Problem, current: Fit, effect: Effect, shape: int) -> list[Values]:
    """Return values of an effect's parameters to try; a single one if each needs a flight."""
    sizes = [(size, factor) for size, factor in zip(BEAM_SIZES, BEAM_FACTORS, strict=True)]
    if any(p.mode == "added" and p.is_size and p.low < 0.0 for p in effect.free):
        sizes += [(-size, factor) for size, factor in sizes]
    found = []
    for size, away in sizes[: 1 if effect.flies or not effect.free else None]:
        values = {}
        for p in effect.free:
            start = value = p.starts[min(shape, len(p.starts) - 1)]
            if not effect.flies and p.mode == "factor":
                value = 1.0 + away * (start - 1.0)
            elif not effect.flies and p.is_size:
                value = size * start
            value += p.base(current.rig, problem.case.control)
            values[effect.value_key(p)] = float(np.clip(value, p.low, p.high))
        found.append(values)
    return found + _less(problem, effect, found[0])


def _less(problem: Problem, effect: Effect, first: Values) -> list[Values]:
    """Return values that reduce a nonzero value of the rig file."""
    found = []
    for share in SCREEN_LESS:
        values = dict(first)
        for p in effect.free:
            least = p.bounds(problem.case.nominal, problem.case.control)[0]
            if p.is_size and least < p.low:
                values[effect.value_key(p)] = share * least
        found += [values] if values != first else []
    return found


def is_limit(effect: Effect) -> bool:
    """Tell whether an effect is a single limit."""
    return len(effect.free) == 1 and effect.free[0].is_limit


def limits(effect: Effect, shows: Callable[[float], bool]) -> list[list[float]]:
    """Return sets of limits to try, from the largest limit that shows down, in the limit's unit.

    The best of each set is a start. The first set ends with the limit's own starts below it: a
    stiffness may be far below the largest that shows. `shows` returns whether a limit changes the
    prediction. Return no set if not even the lowest limit does.
    """
    number = effect.free[0]
    low, high = math.log(number.low), math.log(number.high)
    if not shows(number.low):
        return []
    for _ in range(LIMIT_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shows(math.exp(middle)) else (low, middle)
    sets = (LIMIT_SHARES, SERVO_SHARES) if effect.stage == "linkage" else (LIMIT_SHARES,)
    most = math.exp(low)
    found = [[max(share * most, number.low) for share in shares] for shares in sets]
    below = [start for start in number.starts if start < min(found[0])]
    found[0] += sorted(below, reverse=True)
    return found
