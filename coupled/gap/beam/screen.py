"""Screening: which effects may explain a residual, by the projection on each effect's signature.

A signature is the change of the residual that an effect makes at a size. Signatures are taken at
sizes over three decades, since friction, play and rate limits do nothing at one size and everything
at another; the projection itself is free of scale. The size that leaves least is where a fit
starts.

The power that a signature takes of the residual is the score test's statistic, and gives the gain
in log-likelihood that the effect is predicted to make (Rao, Math. Proc. Camb. Phil. Soc. 44, 1948).
An effect whose predicted gain is less than what its prior costs is not fitted. The signatures
beside one set of effects are nearly those beside another: they are taken once, and again only
beside the best set.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coupled.gap.beam.evidence import misfit
from coupled.gap.beam.fit import SetFit
from coupled.gap.beam.problem import Problem
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect
from coupled.gap.search.fit import touched
from coupled.gap.search.limits import is_limit, limits
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import (
    BEAM_CANDIDATES,
    BEAM_FACTORS,
    BEAM_SIZES,
    SCREEN_LESS,
    SCREEN_NEAR,
    SCREEN_SHOWN,
)
from coupled.parallel import go_on, in_threads
from coupled.rig.rig import Rig

Values = dict[str, float]


class Screened(NamedTuple):
    """A candidate, where its fits start, and what its signature takes of the residual.

    `taken` is the power, noise floors², `gain` the predicted log-likelihood gain.
    """

    effect: Effect
    starts: list[Values]
    taken: float
    gain: float


class Worth(NamedTuple):
    """The `least` predicted gain for which an effect is fitted, and the outputs' samples."""

    least: float
    counts: Floats


class _Signature(NamedTuple):
    """The change of the residual that an effect of some values makes, noise floors, by shape."""

    values: Values
    shape: int
    change: Floats


@dataclass
class Screen:
    """Screens candidates beside sets of effects, and keeps their signatures."""

    problem: Problem
    variance: Floats
    known: dict[str, list[_Signature]] = field(default_factory=dict)

    def best(
        self,
        current: SetFit,
        candidates: Sequence[Effect],
        worth: Worth,
        most: int = BEAM_CANDIDATES,
        anew: bool = False,
    ) -> list[Screened]:
        """Return the candidates whose signatures take most of the residual, the best first.

        Those that take far less than the best are left out, and those that are not `worth` it.
        Signatures are taken beside the current effects if they are unknown, or requested
        `anew`.
        """
        wanted = [e for e in candidates if anew or e.name not in self.known]
        for effect, made in zip(
            wanted, in_threads(lambda e: self._signatures(current, e), wanted), strict=True
        ):
            self.known[effect.name] = made
        found = [self._screened(current, effect, worth.counts) for effect in candidates]
        found = [one for one in found if one.starts and one.gain > worth.least]
        found.sort(key=lambda one: -one.taken)
        least = SCREEN_NEAR * found[0].taken if found else 0.0
        return [one for one in found[:most] if one.taken >= least]

    def _screened(self, current: SetFit, effect: Effect, counts: Floats) -> Screened:
        """Return a candidate with the start of each shape that leaves least."""
        now = _residual(self.problem, effect, current.rig)
        outputs = touched(self.problem.outputs, [effect])
        ours = [k for k, one in enumerate(self.problem.outputs) if one.stage in effect.shows_in]
        edges = np.cumsum([0, *(len(one.measured) for one in outputs[:-1])])

        def unlikely(left: Floats) -> float:
            frames = np.array([len(one.measured) for one in outputs])
            squares = np.add.reduceat(left**2, edges) / frames / self.variance[ours]
            return 0.5 * float(counts[ours] @ misfit(squares))

        taken, gain, starts = 0.0, 0.0, dict[int, tuple[float, Values]]()
        for values, shape, change in self.known[effect.name]:
            size = float(change @ change)
            # A limit that is never met leaves the residual as it is, and a fit where it was.
            if size <= SCREEN_SHOWN * len(now):
                continue
            share = float(now @ change) / size
            taken = max(taken, share**2 * size)
            gain = max(gain, unlikely(now) - unlikely(now - share * change))
            left = float((now + change) @ (now + change))
            if shape not in starts or left < starts[shape][0]:
                starts[shape] = left, values
        return Screened(effect, [values for _, values in starts.values()], taken, gain)

    def _signatures(self, current: SetFit, effect: Effect) -> list[_Signature]:
        """Return an effect's signatures beside the current effects."""
        now = _residual(self.problem, effect, current.rig)
        found = []
        for shape, tries in enumerate(_tries(self.problem, current, effect)):
            for values in tries:
                go_on()
                rig = _with(self.problem, current, effect, values)
                if rig is not None:
                    change = _residual(self.problem, effect, rig) - now
                    found.append(_Signature(values, shape, change))
        return found


def _residual(problem: Problem, effect: Effect, rig: Rig) -> Floats:
    ours = touched(problem.outputs, [effect])
    return np.concatenate([output.residual(rig, wide=True) for output in ours])


def _with(problem: Problem, current: SetFit, effect: Effect, values: Values) -> Rig | None:
    """Return the current rig with one more effect, None where the physics cannot give it."""
    return problem.rig_of((*current.effects, effect), {**current.values, **values})


def _tries(problem: Problem, current: SetFit, effect: Effect) -> list[list[Values]]:
    """Return sets of an effect's parameters to try, by shapes of which each may give a start."""
    if is_limit(effect) and not STAGE_OF[effect.stage].flown:
        key = effect.value_key(effect.free[0])
        now = _residual(problem, effect, current.rig)

        def shows(value: float) -> bool:
            go_on()
            rig = _with(problem, current, effect, {key: value})
            if rig is None:
                return False
            change = _residual(problem, effect, rig) - now
            return float(change @ change) > SCREEN_SHOWN * len(now)

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


def _sizes(problem: Problem, current: SetFit, effect: Effect, shape: int) -> list[Values]:
    """Return sets of an effect's parameters to try; one where each has to be flown."""
    flown = STAGE_OF[effect.stage].flown
    found = []
    for k in range(1 if flown or not effect.free else len(BEAM_SIZES)):
        values = {}
        for p in effect.free:
            start = value = p.starts[min(shape, len(p.starts) - 1)]
            if not flown and p.mode == "factor":
                value = 1.0 + BEAM_FACTORS[k] * (start - 1.0)
            elif not flown and p.scanned:
                value = BEAM_SIZES[k] * start
            value += p.base(current.rig, problem.case.control)
            values[effect.value_key(p)] = float(np.clip(value, p.low, p.high))
        found.append(values)
    return found + _less(problem, effect, found[0])


def _less(problem: Problem, effect: Effect, first: Values) -> list[Values]:
    """Return sets with less of what is filed than the rig file says, where some of it is."""
    found = []
    for share in SCREEN_LESS:
        values = dict(first)
        for p in effect.free:
            least = p.bounds(problem.case.nominal, problem.case.control)[0]
            if p.scanned and least < p.low:
                values[effect.value_key(p)] = share * least
        found += [values] if values != first else []
    return found
