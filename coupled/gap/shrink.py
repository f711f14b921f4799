"""How far the gap shrinks: on stretches used neither to fit nor to choose, and in closed loop."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.case import Case
from coupled.gap.choose import Choice
from coupled.gap.fit import touched
from coupled.gap.output import Output
from coupled.rig.rig import Rig

BOOTSTRAPS = 400
FEW = 8  # blocks under which a bootstrap interval is not to be relied on


def shrink(case: Case, choice: Choice) -> dict[str, Any]:
    """Return how far the widest gap shrinks, fitted on every other stretch, held out between."""
    rig, outputs, effects = case.nominal, case.outputs, choice.fit.effects
    found = case.fit(effects, "fitted", choice.fit.values).rig
    floors = {}
    if effects and case.refloored is not None:  # what noise leaves depends on the rig
        floors = {(o.record, o.channel): o.floor for o in case.refloored(choice.fit.rig)}
    pool = touched(outputs, effects) if effects else list(outputs)
    widest = max(pool, key=lambda output: output.gap(rig))

    def told(output: Output) -> dict[str, Any]:
        floor = max(output.floor, floors.get((output.record, output.channel), 0.0))
        return _of(output, rig, found, floor / output.floor, bool(effects))

    return told(widest) | {"channels": [told(output) for output in pool]}


def _of(output: Output, rig: Rig, found: Rig, floor: float, improved: bool) -> dict[str, Any]:
    """Return one channel's rms residual before and after, and its floor, in its own unit.

    `floor` is that of the improved rig, over the output's own.
    """
    number = output.stretches[output.rows("held")]
    held = np.unique(number)
    old, new = output.residual(rig, "held") ** 2, output.residual(found, "held") ** 2
    sums = np.array([[np.sum(x[number == b]) for x in (old, new, np.ones(len(old)))] for b in held])
    before, after = _rms(sums)
    result: dict[str, Any] = {
        "channel": output.channel,
        "before": float(before * output.floor),
        "after": float(after * output.floor),
        "floor": floor * output.floor,
        "blocks": len(held),
    }
    if improved and before > floor:
        picks = np.random.default_rng(7).integers(0, len(held), (BOOTSTRAPS, len(held)))
        drawn = np.array([_rms(sums[pick]) for pick in picks])
        closed = (drawn[:, 0] - drawn[:, 1]) / np.maximum(drawn[:, 0] - floor, 1e-9)
        result["closed"] = min(1.0, float((before - after) / (before - floor)))
        result["low"], result["high"] = np.percentile(np.minimum(closed, 1.0), [2.5, 97.5]).tolist()
        result["reliable"] = len(held) >= FEW
    return result


def _rms(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return roots of mean squares, from blocks' sums of two squares and their counts."""
    total = sums.sum(axis=0)
    return np.asarray(np.sqrt(total[:2] / total[2]))
