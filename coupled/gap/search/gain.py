"""By how much an effect is worth having: a log-likelihood ratio on stretches held out.

Counted by effective samples, the frames divided by the residual's memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coupled.gap.effects.effect import Effect
from coupled.gap.search.fit import Fit
from coupled.gap.signals.output import Output, memory
from coupled.gap.thresholds import NO_GAP_LEFT


@dataclass(frozen=True)
class Candidate:
    """An effect fitted beside those found so far, and its gain on held-out stretches."""

    gain: float
    effect: Effect
    fit: Fit


def ranked_by_gain(
    outputs: Sequence[Output], current: Fit, found: Sequence[tuple[Effect, Fit]]
) -> list[Candidate]:
    """Return fitted candidates by the held-out log-likelihood that they gain, best first.

    A sample counts as the best candidate's residual lets it, the same for all: a worse one's
    longer memory is its own fault, and no reason to weigh its misfit less.
    """
    if not found:
        return []
    before = [float(np.mean(o.residual(current.rig, "held") ** 2)) + NO_GAP_LEFT for o in outputs]
    lefts = [[o.residual(fitted.rig, "held") for o in outputs] for _, fitted in found]
    squares = [[float(np.mean(left**2)) + NO_GAP_LEFT for left in each] for each in lefts]
    best = min(range(len(found)), key=lambda i: float(np.sum(np.log(squares[i]))))
    counts = [0.5 * len(left) / memory(left) for left in lefts[best]]
    ranked = []
    for (effect, fitted), after in zip(found, squares, strict=True):
        terms = zip(counts, before, after, strict=True)
        gain = float(sum(n * np.log(b / a) for n, b, a in terms))
        ranked.append(Candidate(gain, effect, fitted))
    return sorted(ranked, key=lambda candidate: -candidate.gain)
