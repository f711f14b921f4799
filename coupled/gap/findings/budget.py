"""The share of each effect in a residual, and by how much all of them reduce it.

The power is the mean square of the stage's residuals over all records, in units of the noise floor
squared, with the fitted nuisance parameters and without effects. The share of an effect is the
power that adding it removes, averaged over all orders of adding the effects (Shapley 1953). The
power that remains with all effects is noise, up to the noise floor, and unexplained structure. The
shares sum to 1.

Noise counts as one floor², that of the filed rig. If an effect raises the noise floor (for example
because presliding friction transmits the force's noise), the increase counts to the effects.

All stretches are used, not only those held out: few parameters hardly fit the noise of thousands of
frames, and a rare event is unevenly divided between two halves of a record. The intervals are from
a bootstrap over stretches: they include the scatter between records, not the fit's error. The
reduction by all of them together is that on held-out stretches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import touched
from coupled.gap.search.case import Case
from coupled.gap.search.found import Choice, Fit
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import BOOTSTRAPS, FEW_STRETCHES, MOST_PLAYERS
from coupled.results import Plain
from coupled.rig.rig import Rig


def shapley_subsets(players: int) -> tuple[list[int], Floats]:
    """Return the subsets whose powers are needed, and their weights, (players, subsets).

    Subset 0 is the first and that of all players the last. For more than `MOST_PLAYERS` players,
    the reductions of each as the first and as the last one are averaged, which is exact if the
    power is the mean square of a sum of the players' actions.
    """
    if players <= MOST_PLAYERS:
        return list(range(2**players)), shapley_weights(players)
    whole, alone = 2**players - 1, [1 << i for i in range(players)]
    one, none = np.eye(players), np.ones((players, 1))
    weights = 0.5 * np.hstack([none, -one, one, -none])
    return [0, *alone, *(whole - i for i in alone), whole], weights


def shapley_weights(players: int) -> Floats:
    """Return the weight of each subset's power in each player's share, (players, 2^players).

    Bit i of a subset's number is set if player i belongs to it.
    """
    weights = np.zeros((players, 2**players))
    for i in range(players):
        others = [j for j in range(players) if j != i]
        for size in range(players):
            weight = factorial(size) * factorial(players - size - 1) / factorial(players)
            for some in combinations(others, size):
                without = sum(1 << j for j in some)
                weights[i, without] += weight
                weights[i, without | 1 << i] -= weight
    return weights


UNEXPLAINED, NOISE = "unexplained", "noise"
Floors = Mapping[tuple[int, str], float]  # noise floors by record and channel


@dataclass(frozen=True)
class Share:
    """A share of a stage's residual power, with its 95 % interval; negative if it adds power."""

    name: str
    value: float
    low: float
    high: float


def share_of(budgets: Sequence[StageBudget], stage: str, effect: str) -> str:
    """Return an effect's share of its stage's residual for people, in per cent; "" for none."""
    shares = (share for one in budgets if one.stage == stage for share in one.effects)
    found = next((share for share in shares if share.name == effect), None)
    return "" if found is None else f"{100 * found.value:.1f} %"


@dataclass(frozen=True)
class StageBudget:
    """The shares of a faulty stage: of each effect, of unexplained structure, of noise; sum 1."""

    stage: str
    effects: tuple[Share, ...]
    unexplained: Share
    noise: Share

    @property
    def shares(self) -> tuple[Share, ...]:
        """The shares of the effects, of unexplained structure and of noise."""
        return (*self.effects, self.unexplained, self.noise)

    @property
    def remains(self) -> float:
        """The share of the power without noise that no effect explains, 0 to 1."""
        gap = 1.0 - self.noise.value
        return min(max(self.unexplained.value / gap, 0.0), 1.0) if gap > 0.0 else 0.0

    def of(self, effect: str) -> float:
        """Return the share of the power without noise that an effect explains."""
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
    stage: str, case: Case, root: Fit, found: Fit, floors: Floors
) -> StageBudget | None:
    """Return a stage's budget; None if neither it nor its neighbours have an output.

    `floors` are the noise floors of the improved rig by record and channel, where they are higher.
    """
    outputs = _outputs(stage, case.outputs, root, found)
    if not outputs:
        return None
    players = [e for e in found.effects if touched(outputs, [e])]
    lengths = [np.bincount(o.stretches) for o in outputs]
    powers = []
    for subset in range(2 ** len(players)):
        kept = [e for i, e in enumerate(players) if subset & 1 << i]
        rig = case.with_only(found, [*kept, *(e for e in found.effects if e not in players)])
        lefts = [by_stretch(o.residual(rig) ** 2, o.stretches) for o in outputs]
        powers.append(np.concatenate(lefts))
    floor = [max(1.0, floors.get((o.record, o.channel), 0.0) / o.floor) ** 2 for o in outputs]
    noise = np.repeat(floor, list(map(len, lengths)))
    frames = np.concatenate(lengths).astype(float)
    given = shapley_weights(len(players)), np.array(powers), frames, noise
    whole = _shares(*given, np.arange(len(noise)))
    draws = np.random.default_rng(7).integers(0, len(noise), (BOOTSTRAPS, len(noise)))
    low, high = np.percentile([_shares(*given, pick) for pick in draws], [2.5, 97.5], axis=0)
    names = [*(effect.name for effect in players), UNEXPLAINED, NOISE]
    each = [Share(n, *map(float, v)) for n, *v in zip(names, whole, low, high, strict=True)]
    return StageBudget(stage, tuple(each[:-2]), each[-2], each[-1])


def _outputs(stage: str, outputs: Sequence[Output], root: Fit, found: Fit) -> list[Output]:
    """Return the stage's outputs with a gap, or the one with the largest if none has.

    For a stage without outputs they are those of the stages in which its effects show.
    """
    shown = {at for e in found.effects if e.stage == stage for at in e.shows_in}
    own = [output for output in outputs if output.stage in STAGE_OF[stage].outputs]
    own = own or [output for output in outputs if output.stage in shown]
    over_limit = [output for output in own if output.gap(root.rig) > output.limit]
    return over_limit or sorted(own, key=lambda o: -o.gap(root.rig))[:1]


def by_stretch(signal: Floats, stretches: NDArray[np.intp]) -> Floats:
    """Return the sum of a signal in each stretch."""
    return np.array([float(np.sum(signal[stretches == n])) for n in np.unique(stretches)])


def _shares(
    weights: Floats, powers: Floats, frames: Floats, noise: Floats, pick: NDArray[np.intp]
) -> Floats:
    """Return the shares of the effects, of unexplained structure and of noise; sum 1.

    `weights` are those of Shapley, `powers` sums of squares, floors², by subset of the effects
    and stretch; subset 0 is empty. By stretch, `frames` are numbers of frames and `noise` the power
    of noise with the effects, floors²; `pick` are the stretches that count.
    """
    counts = frames[pick]
    power = powers[:, pick].sum(axis=1) / counts.sum()
    floor = min(float(noise[pick] @ counts / counts.sum()), float(power[-1]))
    named = weights @ power
    if power[0] <= 0.0:  # no residual at all
        return np.array([*(0.0 * named), 0.0, 1.0])
    own, taken = min(floor, 1.0), float(named.sum())
    if taken > 0.0:
        named = named * (1.0 + (floor - own) / taken)
    else:
        own = floor
    return np.asarray(np.array([*named, power[-1] - floor, own]) / power[0])


@dataclass(frozen=True)
class ChannelShrink(Plain):
    """One channel's RMS residual on held-out stretches, in its own unit, and its noise floor.

    `closed` is (before − after)/(before − floor) with its 95 % interval; None without an effect or
    a gap. There is no interval if stretches drawn anew may have no gap. `reliable`: from at least
    `FEW_STRETCHES` stretches.
    """

    channel: str
    before: float
    after: float
    floor: float
    blocks: int
    closed: float | None = None
    low: float | None = None
    high: float | None = None
    reliable: bool | None = None


@dataclass(frozen=True)
class Shrink:
    """The reduction of the gap in each channel that the effects change, and in the widest one."""

    widest: ChannelShrink
    channels: tuple[ChannelShrink, ...]

    @property
    def closed(self) -> float | None:
        """The share of the widest gap that is closed."""
        return self.widest.closed

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return self.widest.as_dict() | {"channels": [c.as_dict() for c in self.channels]}


def floors_of(case: Case, choice: Choice) -> Floors:
    """Return the noise floors with the improved rig by record and channel."""
    if not choice.fit.effects or case.outputs_with_noise_of is None:
        return {}
    return {(o.record, o.channel): o.floor for o in case.outputs_with_noise_of(choice.fit.rig)}


def shrink(case: Case, fitted: Fit, floors: Floors) -> Shrink:
    """Return the reduction of the gap on held-out stretches, for a fit to the other stretches."""
    rig, effects = case.nominal, fitted.effects
    pool = touched(case.outputs, effects) if effects else list(case.outputs)
    each = []
    for output in pool:
        floor = max(output.floor, floors.get((output.record, output.channel), 0.0)) / output.floor
        each.append(channel_shrink(output, rig, fitted.rig, floor, bool(effects)))
    gaps = [output.gap(rig) for output in pool]
    return Shrink(each[gaps.index(max(gaps))], tuple(each))


def channel_shrink(
    output: Output, rig: Rig, found: Rig, floor: float, improved: bool
) -> ChannelShrink:
    """Return one channel's RMS residual before and after, and its floor, in its own unit.

    `floor` is that of the improved rig, relative to the output's own.
    """
    number = output.stretches[output.rows("held")]
    old, new = output.residual(rig, "held") ** 2, output.residual(found, "held") ** 2
    sums = np.column_stack([by_stretch(x, number) for x in (old, new, np.ones(len(old)))])
    before, after = _rms(sums)
    result = ChannelShrink(
        channel=output.channel,
        before=float(before * output.floor),
        after=float(after * output.floor),
        floor=floor * output.floor,
        blocks=len(sums),
    )
    if not improved or before <= floor:
        return result
    picks = np.random.default_rng(7).integers(0, len(sums), (BOOTSTRAPS, len(sums)))
    drawn = np.array([_rms(sums[pick]) for pick in picks])
    gaps = drawn[:, 0] - floor
    closed = min(1.0, float((before - after) / (before - floor)))
    result = replace(result, closed=closed, reliable=len(sums) >= FEW_STRETCHES)
    if np.percentile(gaps, 2.5) <= 0.0:
        return result
    shares = np.minimum((drawn[:, 0] - drawn[:, 1]) / np.maximum(gaps, 1e-9), 1.0)
    low, high = np.percentile(shares, [2.5, 97.5]).tolist()
    return replace(result, low=low, high=high)


def _rms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the roots of two mean squares, from sums of squares and counts by stretch."""
    total = sums.sum(axis=0)
    return np.asarray(np.sqrt(total[:2] / total[2]))
