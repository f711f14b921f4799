"""The results of a search: fits, the best set of effects, and the alternatives of each.

Fitted numbers are inseparable if their signatures nearly cancel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from coupled.errors import joined
from coupled.gap.effects.effect import Effect
from coupled.gap.search.descent import Slope
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import MINOR, ROUGH
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Group:
    """The fit of effects that share outputs: values and 95 % interval by "effect.parameter".

    `information` is that of the log-likelihood, in the parameters' units, without priors. `penalty`
    is the log density of the nuisance parameters below its maximum, `slope` the Jacobian in noise
    floors.
    """

    values: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]
    at_bound: tuple[str, ...]
    information: Floats
    penalty: float = 0.0
    slope: Slope | None = field(default=None, repr=False, compare=False)


@dataclass(frozen=True)
class Fit:
    """A fitted set of effects: `values`, `low`, `high` (95 %) by "effect.parameter".

    `at_bound` are the parameters at a bound, or undetermined, `groups` the parts that share no
    output.
    """

    effects: tuple[Effect, ...]
    values: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    at_bound: tuple[str, ...]
    rig: Rig
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

    `without_effects` is the fit of the nuisance parameters alone, within their tolerance; `tried`
    the gain in log evidence of each effect alone, `rounds` that of each round's sets by the effect
    added, `probability` the posterior probability of the best set.
    """

    steps: tuple[Found, ...]
    fit: Fit
    without_effects: Fit
    tried: dict[str, float] = field(default_factory=dict)
    rounds: tuple[dict[str, float], ...] = ()
    probability: float = 1.0


# Why two numbers may act alike, by the last parts of their keys.
WHY = {
    frozenset(("friction", "damping")): "the speeds differ too little",
    frozenset(("friction", "offset")): "the motion is too much in one direction",
    frozenset(("mass", "basic_gradient")): "the frequencies differ too little",
    frozenset(("servo_frequency", "servo_damping_ratio")): "the motion is slow beside the servo",
}


@dataclass(frozen=True)
class Alike:
    """Numbers that these records do not distinguish, by their keys, and why."""

    keys: tuple[str, ...]
    why: str

    @property
    def words(self) -> str:
        """What is to be said of them."""
        count = {2: "one number", 3: "two numbers"}.get(len(self.keys), "fewer numbers")
        because = f"{self.why}: " if self.why else ""
        return f"{because}{joined(self.keys)} are {count} in these records"

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {"keys": list(self.keys), "why": self.why, "words": self.words}


def alike(group: Group) -> list[Alike]:
    """Return the numbers that were fitted together, and that records determine only together.

    They are in the directions of small eigenvalues of the signatures' cosines.
    """
    size = np.sqrt(np.diag(group.information))
    moved = size > 0.0
    if moved.sum() < 2:
        return []
    keys = [name.rstrip(".") for name in group.values]  # of numbers without a name of their own
    shown = [key for key, on in zip(keys, moved, strict=True) if on]
    cosines = group.information[np.ix_(moved, moved)] / np.outer(size[moved], size[moved])
    strengths, directions = np.linalg.eigh(cosines)
    found = []
    for strength, direction in zip(strengths, directions.T, strict=True):
        if strength > MINOR:
            break
        least = ROUGH * float(np.max(np.abs(direction)))
        shares = [key for key, d in zip(shown, direction, strict=True) if abs(d) >= least]
        found.append(Alike(tuple(shares), _why(shares)))
    return found


def inseparable(found: Fit, control: ControlName) -> tuple[Alike, ...]:
    """Return the numbers of a fit's effects that a control's records determine only together."""
    ours = {e.value_key(p): f"{e.name}.{p.named(control)}" for e in found.effects for p in e.free}
    each = (one for group in found.groups.values() for one in alike(group))
    known = [one for one in each if ours.keys() >= {*one.keys}]
    return tuple(replace(one, keys=tuple(ours[key] for key in one.keys)) for one in known)


def _why(keys: Sequence[str]) -> str:
    """Return why numbers act alike, where it is known."""
    words = [key.partition(".")[2] for key in keys]
    for pair, why in WHY.items():
        if len(words) == 2 and all(any(w.startswith(name) for w in words) for name in pair):
            return why
    return ""
