"""What a search found: the best set of effects, and what may take the place of each effect."""

from __future__ import annotations

from dataclasses import dataclass, field

from coupled.gap.effects.effect import Effect
from coupled.gap.search.fit import Fit


@dataclass(frozen=True)
class Candidate:
    """An effect that may take another's place, its gain in log evidence, and the set's fit."""

    gain: float
    effect: Effect
    fit: Fit


@dataclass(frozen=True)
class Found:
    """One effect of the best set.

    `gain` is the log evidence that is lost without it, `probability` that of all sets that contain
    it, `rivals` the effects that take its place in sets within `RIVAL_GAIN` of the best.
    """

    effect: Effect
    gain: float
    probability: float
    rivals: tuple[Candidate, ...]


@dataclass(frozen=True)
class Choice:
    """What a search found: the effects of the best set, and their fit.

    `settled` is the fit without effects, its nuisance parameters within their tolerance; `tried`
    the gain in log evidence of each effect alone, `rounds` that of the sets of each depth, by the
    effect added.
    """

    steps: tuple[Found, ...]
    fit: Fit
    settled: Fit
    tried: dict[str, float] = field(default_factory=dict)
    rounds: tuple[dict[str, float], ...] = ()
