"""A fitted set of effects, and the outputs that effects act on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from coupled.gap.effects.effect import Effect
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Fit:
    """A fitted set of effects: `values`, `low`, `high` (95 %) by "effect.parameter".

    `at_bound` are the parameters at a bound, or undetermined; `cost` is half the weighted sum of
    squares, in noise floors.
    """

    effects: tuple[Effect, ...]
    values: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    at_bound: tuple[str, ...]
    rig: Rig
    cost: float


def touched(outputs: Sequence[Output], effects: Sequence[Effect]) -> list[Output]:
    """Return the outputs that these effects act on."""
    stages = {stage for effect in effects for stage in effect.shows_in}
    return [output for output in outputs if output.stage in stages]
