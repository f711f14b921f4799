"""The budget of a gap: how much of a stage's residual each effect found explains, and what is left.

A stage's power is the mean square of its residuals over all of the records, in floors, with the
settings as they were found and no effect. Each effect's share is what it takes off, on the mean
over all orders in which the effects could be added (Shapley 1953): with one effect, what leaving
it out brings back. What all of them leave is noise, as far as noise can be that large, and a
structure that is not explained. The shares sum to 1.

Noise is that of the residual without any effect, one floor². An effect may raise the floor: the
air's motion is found with an error, and a contact that yields lets the force's noise pass. By so
much more it leaves, and that is of its own power, not the rig's noise.

A few numbers hardly fit thousands of frames' noise, and what happens rarely, as a limit that is met
twice, lies unevenly in two halves of a record: so all of it counts, not what was held out alone.
The intervals come from drawing its stretches anew (the bootstrap of `shrink`): they say how far
another such record's budget would differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect, touched
from coupled.gap.findings.shapley import shapley_weights
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import BOOTSTRAPS

Floats = NDArray[np.float64]
UNEXPLAINED, NOISE = "unexplained", "noise"


@dataclass(frozen=True)
class Share:
    """A share of a stage's residual power, with its 95 % interval. Below 0: it adds to the gap."""

    name: str
    value: float
    low: float
    high: float


@dataclass(frozen=True)
class StageBudget:
    """The shares of a guilty stage: of each effect, of unexplained structure, of noise; sum 1."""

    stage: str
    effects: tuple[Share, ...]
    unexplained: Share
    noise: Share

    @property
    def shares(self) -> tuple[Share, ...]:
        """All of them."""
        return (*self.effects, self.unexplained, self.noise)

    @property
    def remains(self) -> float:
        """The share of the gap, noise apart, that no effect explains, 0 to 1."""
        gap = 1.0 - self.noise.value
        return min(max(self.unexplained.value / gap, 0.0), 1.0) if gap > 0.0 else 0.0

    def of(self, effect: str) -> float:
        """Return the share of the gap, noise apart, that an effect explains."""
        gap = 1.0 - self.noise.value
        found = next((share.value for share in self.effects if share.name == effect), 0.0)
        return found / gap if gap > 0.0 else 0.0

    def as_dict(self) -> dict[str, float]:
        """Return the JSON: the shares."""
        return {share.name: share.value for share in self.shares}

    def intervals(self) -> dict[str, Any]:
        """Return the JSON of the intervals."""
        return {share.name: [share.low, share.high] for share in self.shares}


def stage_budget(
    stage: str, case: Case, settled: Fit, found: Fit, floors: Mapping[tuple[int, str], float]
) -> StageBudget | None:
    """Return a stage's budget; None where no output of its own or its neighbours' judges it.

    `floors` are those of the improved rig by record and channel, where they are higher.
    """
    outputs = _outputs(stage, case.outputs, settled, found)
    if not outputs:
        return None
    players = [e for e in found.effects if touched(outputs, [e])]
    blocks = _powers(outputs, case, found, players)
    floor = [max(1.0, floors.get((o.record, o.channel), 0.0) / o.floor) ** 2 for o in outputs]
    noise = np.concatenate(
        [np.full(len(np.unique(o.stretches)), f) for o, f in zip(outputs, floor, strict=True)]
    )
    draws = np.random.default_rng(7).integers(0, len(noise), (BOOTSTRAPS, len(noise)))
    weights = _Weights(players)
    whole = weights.shares(blocks, noise, np.arange(len(noise)))
    drawn = np.array([weights.shares(blocks, noise, pick) for pick in draws])
    low, high = np.percentile(drawn, [2.5, 97.5], axis=0)
    names = [*(effect.name for effect in players), UNEXPLAINED, NOISE]
    each = [Share(n, *map(float, v)) for n, *v in zip(names, whole, low, high, strict=True)]
    return StageBudget(stage, tuple(each[:-2]), each[-2], each[-1])


def _outputs(stage: str, outputs: Sequence[Output], settled: Fit, found: Fit) -> list[Output]:
    """Return the outputs whose power is shared out: those that show a gap.

    They are the stage's own; of a stage without any, those of its neighbours in which its effects
    show: what else is wrong with a neighbour is no part of it.
    """
    shown = {at for e in found.effects if e.stage == stage for at in e.shows_in}
    own = [output for output in outputs if output.stage in STAGE_OF[stage].outputs]
    own = own or [output for output in outputs if output.stage in shown]
    wide = [output for output in own if output.gap(settled.rig) > output.limit]
    return wide or sorted(own, key=lambda o: -o.gap(settled.rig))[:1]


@dataclass(frozen=True)
class _Blocks:
    """Sums of squares, floors², by subset of the effects and stretch; and a stretch's frames."""

    sums: Floats  # (subsets, stretches)
    frames: Floats  # (stretches,)


def _powers(
    outputs: Sequence[Output], case: Case, found: Fit, players: Sequence[Effect]
) -> _Blocks:
    """Return the power that each subset of the effects leaves; subset 0 has none of them."""
    frames: list[float] = []
    sums: list[list[float]] = []
    for subset in range(2 ** len(players)):
        kept = [e for i, e in enumerate(players) if subset & 1 << i]
        rig = case.with_only(found, [*kept, *(e for e in found.effects if e not in players)])
        row: list[float] = []
        for output in outputs:
            number, square = output.stretches, output.residual(rig) ** 2
            row += [float(np.sum(square[number == b])) for b in np.unique(number)]
            if subset == 0:
                frames += [float(np.sum(number == b)) for b in np.unique(number)]
        sums.append(row)
    return _Blocks(np.array(sums), np.array(frames))


class _Weights:
    """Shapley's weights of each subset's power in each effect's share."""

    def __init__(self, players: Sequence[Effect]) -> None:
        self._of = shapley_weights(len(players))

    def shares(self, blocks: _Blocks, noise: Floats, pick: NDArray[np.intp]) -> Floats:
        """Return the shares of the effects, of what is not explained, and of noise; they sum to 1.

        `noise` is the power that noise alone leaves with the effects on each stretch, floors².
        """
        frames = blocks.frames[pick]
        power = blocks.sums[:, pick].sum(axis=1) / frames.sum()
        floor = min(float(noise[pick] @ frames / frames.sum()), float(power[-1]))
        named = self._of @ power
        if power[0] <= 0.0:  # stretches without any residual: nothing but noise, of size zero
            return np.array([*(0.0 * named), 0.0, 1.0])
        own, taken = min(floor, 1.0), float(named.sum())
        if taken > 0.0:
            named = named * (1.0 + (floor - own) / taken)
        else:
            own = floor
        return np.asarray(np.array([*named, power[-1] - floor, own]) / power[0])
