"""The problem that the search over sets solves: a case with priors of nuisance parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from coupled.gap.effects.effect import Effect, possible
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.case import Case
from coupled.gap.search.descent import WHOLE, Descent
from coupled.gap.search.fit import fit_set
from coupled.gap.search.found import Fit
from coupled.gap.signals.output import Floats, Output, Part, stage_gaps, stage_limits
from coupled.gap.thresholds import MISMATCH, NORMAL_95
from coupled.rig.rig import Rig

EXACT = ("schedule", "compensation", "linkage")  # outputs predicted without model error


class Prior(NamedTuple):
    """The Gaussian prior of a nuisance parameter, in the parameter's own unit."""

    mean: float
    sigma: float


@dataclass(frozen=True)
class ModelError:
    """The error of a correct effect's physics in each output, beside noise of variance 1.

    `power` is its variance in noise floors², `samples` the effective samples of the residual of
    which it is a share, shape (outputs,) each.
    """

    power: Floats
    samples: Floats

    @property
    def variance(self) -> Floats:
        """The variance of each output's residual, noise floors²."""
        return np.asarray(1.0 + self.power)

    def smooth(self, noise: Floats) -> Floats:
        """Return the autocorrelation time of noise, of `noise` samples, over that of both."""
        return np.asarray(self.variance / (1.0 + self.power * noise / self.samples))

    def of(self, index: Sequence[int]) -> ModelError:
        """Return the model error of some outputs."""
        return ModelError(self.power[list(index)], self.samples[list(index)])


@dataclass(frozen=True)
class Problem:
    """A case with Gaussian priors of nuisance parameters: tolerances are 95 % intervals."""

    case: Case
    _known: dict[Any, Any] = field(default_factory=dict, init=False, repr=False, compare=False)

    @property
    def outputs(self) -> Sequence[Output]:
        """The outputs that are judged."""
        return self.case.outputs

    @cached_property
    def nuisances(self) -> tuple[Effect, ...]:
        """The nuisance parameters on which the outputs depend, each as an effect."""
        return tuple(_unlimited(name, one) for name, one in self.case.settings.items())

    @cached_property
    def priors(self) -> dict[str, Prior]:
        """The nuisance parameters' priors, by "effect.parameter"."""
        found = {}
        for one in self.case.settings.values():
            (p,) = one.free
            half = max(p.high - p.starts[0], p.starts[0] - p.low)
            found[one.value_key(p)] = Prior(p.starts[0], half / NORMAL_95)
        return found

    def beside(self, effects: Sequence[Effect]) -> list[Effect]:
        """Return the nuisance parameters of a set: those that no effect of the set frees.

        Presliding parameters are included if the set has dry friction, or if the rig file has it
        and the loader's residual exceeds the noise.
        """
        freed = {p.key for effect in effects for p in effect.parameters}
        free = list(self.nuisances)
        dry = any(e.dry for e in effects)
        if dry or is_dry(self.case.nominal, self.case.control):
            free += [one for one in self.case.contact if dry or self.case.is_open(one)]
        return [one for one in free if freed.isdisjoint(p.key for p in one.free)]

    def fit(
        self,
        effects: Sequence[Effect],
        start: Mapping[str, float] | None = None,
        parent: Fit | None = None,
        descent: Descent = WHOLE,
        near: Fit | None = None,
        part: Part = "all",
    ) -> Fit:
        """Return a set fitted together with the nuisance parameters, to the whole record or a part.

        Groups of effects of `parent` at the same values are reused. `near` is a fit of the set that
        ended at the start.
        """
        free = self.beside(effects)
        begun = self.case.with_contact(effects, free, start or {})
        slopes = {} if near is None else {tuple(g.values): g.slope for g in near.groups.values()}
        known = replace(descent, known=self._known, slopes=slopes)
        return fit_set(self.case, effects, free, self.priors, begun, parent, known, part)

    def rig_of(self, effects: Sequence[Effect], values: Mapping[str, float]) -> Rig | None:
        """Return the rig with a set and its values; None if these give no valid rig."""
        every = (*effects, *self.beside(effects))
        known = {**self.case.neutral, **values}
        return possible(self.case.nominal, self.case.control, every, known)

    def within_tolerance(self, found: Fit) -> Fit:
        """Return a fit with its nuisance parameters clipped to their 95 % intervals."""
        ends = {key: NORMAL_95 * prior.sigma for key, prior in self.priors.items()}
        values, penalty = dict(found.values), dict[str, float]()
        for key, prior in self.priors.items():
            if key in values:
                low, high = prior.mean - ends[key], prior.mean + ends[key]
                values[key] = min(max(values[key], low), high)
                penalty[key] = 0.5 * ((values[key] - prior.mean) / prior.sigma) ** 2
        rig = self.rig_of(found.effects, values)
        groups = {
            members: replace(group, penalty=sum(penalty.get(key, 0.0) for key in group.values))
            for members, group in found.groups.items()
        }
        return found if rig is None else replace(found, values=values, rig=rig, groups=groups)

    def with_initial_contact(self, found: Fit) -> Fit | None:
        """Return a fit with its presliding parameters at their initial values; None if they are."""
        keys = {one.value_key(p) for one in self.case.contact for p in one.free}
        values = {**found.values, **{k: self.case.neutral[k] for k in keys & found.values.keys()}}
        rig = None if values == found.values else self.rig_of(found.effects, values)
        return None if rig is None else replace(found, values=values, rig=rig)

    def without_colour_allowance(self, root: Rig) -> Problem:
        """Return the problem without the allowance for noise colour (`Case`)."""
        anew = Problem(self.case.without_colour_allowance(root))
        anew._known.update(self._known)  # fits do not depend on limits
        return anew

    def over_limit(self, rig: Rig) -> set[str]:
        """Return the outputs over their limits, by the present noise floors."""
        gaps, limits = stage_gaps(self.outputs, rig), stage_limits(self.outputs)
        return {at for at, gap in gaps.items() if gap > limits[at]}

    @cached_property
    def by_shots(self) -> Problem | None:
        """The problem with outputs predicted by multiple shooting; None if no output has it."""
        short = self.case.by_shots
        return None if short is None else Problem(short)

    def model_error(self, without: Rig) -> ModelError:
        """Return each output's model error, a share of its residual without effects."""
        gaps = np.array([output.gap(without) for output in self.outputs])
        share = np.array([0.0 if one.stage in EXACT else MISMATCH for one in self.outputs])
        samples = np.array([output.samples(output.residual(without)) for output in self.outputs])
        return ModelError((share * np.maximum(gaps - 1.0, 0.0)) ** 2, samples)


def _unlimited(name: str, setting: Effect) -> Effect:
    """Return a nuisance parameter with the bounds of the effect that frees the same key."""
    (p,) = setting.free
    effects = (BY_NAME[name],) if name in BY_NAME else EFFECTS
    freed = next(q for effect in effects for q in effect.free if q.key == p.key)
    low, high = min(p.low, freed.low), max(p.high, freed.high)
    return replace(setting, parameters=(replace(p, low=low, high=high, may_end=True),))
