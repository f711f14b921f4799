"""The reduction of the gap by the effects, on held-out stretches."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import touched
from coupled.gap.search.case import Case
from coupled.gap.search.found import Choice, Fit
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import BOOTSTRAPS, FEW_STRETCHES
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class ChannelShrink:
    """One channel's RMS residual on held-out stretches, in its own unit, and its noise floor.

    `closed` is (before − after)/(before − floor) with its 95 % interval; None if no effect was
    found or there was no gap. `reliable`: computed from at least `FEW_STRETCHES` stretches.
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

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON, without the keys that are None."""
        known = {
            "channel": self.channel,
            "before": self.before,
            "after": self.after,
            "floor": self.floor,
            "blocks": self.blocks,
            "closed": self.closed,
            "low": self.low,
            "high": self.high,
            "reliable": self.reliable,
        }
        return {name: value for name, value in known.items() if value is not None}


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


Floors = Mapping[tuple[int, str], float]


def floors_of(case: Case, choice: Choice) -> dict[tuple[int, str], float]:
    """Return the noise floors with the improved rig by record and channel."""
    if not choice.fit.effects or case.outputs_with_noise_of is None:
        return {}
    return {(o.record, o.channel): o.floor for o in case.outputs_with_noise_of(choice.fit.rig)}


def shrink(case: Case, fitted: Fit, floors: Floors) -> Shrink:
    """Return the reduction of the gap on held-out stretches, for a fit to the other stretches."""
    rig, outputs, effects, found = case.nominal, case.outputs, fitted.effects, fitted.rig
    pool = touched(outputs, effects) if effects else list(outputs)
    widest = max(pool, key=lambda output: output.gap(rig))

    def held(output: Output) -> ChannelShrink:
        floor = max(output.floor, floors.get((output.record, output.channel), 0.0))
        return channel_shrink(output, rig, found, floor / output.floor, bool(effects))

    return Shrink(held(widest), tuple(held(output) for output in pool))


def channel_shrink(
    output: Output, rig: Rig, found: Rig, floor: float, improved: bool
) -> ChannelShrink:
    """Return one channel's RMS residual before and after, and its floor, in its own unit.

    `floor` is that of the improved rig, relative to the output's own.
    """
    number = output.stretches[output.rows("held")]
    held = np.unique(number)
    old, new = output.residual(rig, "held") ** 2, output.residual(found, "held") ** 2
    sums = np.array([[np.sum(x[number == b]) for x in (old, new, np.ones(len(old)))] for b in held])
    before, after = _rms(sums)
    result = ChannelShrink(
        channel=output.channel,
        before=float(before * output.floor),
        after=float(after * output.floor),
        floor=floor * output.floor,
        blocks=len(held),
    )
    if not improved or before <= floor:
        return result
    picks = np.random.default_rng(7).integers(0, len(held), (BOOTSTRAPS, len(held)))
    drawn = np.array([_rms(sums[pick]) for pick in picks])
    closed = (drawn[:, 0] - drawn[:, 1]) / np.maximum(drawn[:, 0] - floor, 1e-9)
    low, high = np.percentile(np.minimum(closed, 1.0), [2.5, 97.5]).tolist()
    return replace(
        result,
        closed=min(1.0, float((before - after) / (before - floor))),
        low=low,
        high=high,
        reliable=len(held) >= FEW_STRETCHES,
    )


def _rms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the roots of two mean squares, from sums of squares and counts by stretch."""
    total = sums.sum(axis=0)
    return np.asarray(np.sqrt(total[:2] / total[2]))
