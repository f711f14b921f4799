"""The results of a search: fits, the best set of effects, and the alternatives of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect
from coupled.gap.search.slopes import Slope
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Group:
    """The fit of effects that share outputs: values and 95 % interval by "effect.parameter".

    `cost` is half the weighted sum of squares in noise floors, without the priors. `information` is
    that of the log-likelihood, in the parameters' own units, without the priors. `penalty` is the
    log density of the nuisance parameters below its maximum. `slope` is that of the outputs that
    it touches, in noise floors.
    """

    values: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]
    at_bound: tuple[str, ...]
    cost: float
    information: Floats
    penalty: float = 0.0
    slope: Slope | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Fit:
    """A fitted set of effects: `values`, `low`, `high` (95 %) by "effect.parameter".

    `at_bound` are the parameters at a bound, or undetermined; `cost` is half the weighted sum of
    squares, in noise floors. `groups` are the parts that share no output.
    """

    effects: tuple[Effect, ...]
    values: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    at_bound: tuple[str, ...]
    rig: Rig
    cost: float
    groups: Mapping[tuple[Effect, ...], Group] = field(default_factory=dict, compare=False)


@dataclass(frozen=True)
class Candidate:
    """An alternative to an effect, its gain in log evidence, and the fit of its set."""

    gain: float
    effect: Effect
    fit: Fit


@dataclass(frozen=True)
class Found:
    """One effect of the best set.

    `gain` is the log evidence lost without the effect, `probability` the sum over all sets that
    contain it, `rivals` its alternatives in sets within `RIVAL_GAIN` of the best.
    """

    effect: Effect
    gain: float
    probability: float
    rivals: tuple[Candidate, ...]


@dataclass(frozen=True)
class Choice:
    """The effects of the best set, and their fit.

    `without_effects` is the fit of the nuisance parameters alone, within their tolerance. `tried`
    is the gain in log evidence of each effect alone, `rounds` that of each depth's sets by the
    effect added, `probability` the posterior probability of the best set.
    """

    steps: tuple[Found, ...]
    fit: Fit
    without_effects: Fit
    tried: dict[str, float] = field(default_factory=dict)
    rounds: tuple[dict[str, float], ...] = ()
    probability: float = 1.0
