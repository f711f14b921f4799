"""By how much an effect is worth having: a log-likelihood ratio on stretches held out.

Counted by effective samples, the frames divided by the residual's memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect
from coupled.gap.search.fit import Fit
from coupled.gap.signals.output import Output, Part, memory


@dataclass(frozen=True)
class Candidate:
    """An effect fitted beside those found so far, and its gain on held-out stretches."""

    gain: float
    effect: Effect
    fit: Fit


def ranked_by_gain(
    outputs: Sequence[Output], current: Fit, found: Sequence[tuple[Effect, Fit]]
) -> list[Candidate]:
    """Return fitted candidates by the log-likelihood that they gain where not fitted, best first.

    One that consists of events seen is judged on the whole record: it is counted, not fitted, and
    two events may both lie in one half.
    """
    seen = [each for each in found if each[0].events is not None]
    fitted = [each for each in found if each[0].events is None]
    ranked = [*_ranked(outputs, current, fitted, "held"), *_ranked(outputs, current, seen, "all")]
    return sorted(ranked, key=lambda candidate: -candidate.gain)


def _ranked(
    outputs: Sequence[Output], current: Fit, found: Sequence[tuple[Effect, Fit]], part: Part
) -> list[Candidate]:
    """Return fitted candidates with what they gain in a part of the record.

    A sample counts as the best candidate's residual lets it, the same for all: a worse one's
    longer memory is its own fault, and no reason to weigh its misfit less.
    """
    if not found:
        return []
    before = [misfit(o.residual(current.rig, part)) for o in outputs]
    lefts = [[o.residual(fitted.rig, part) for o in outputs] for _, fitted in found]
    misfits = [[misfit(left) for left in each] for each in lefts]
    best = min(range(len(found)), key=lambda i: sum(misfits[i]))
    counts = [0.5 * len(left) / memory(left) for left in lefts[best]]
    ranked = []
    for (effect, fitted), after in zip(found, misfits, strict=True):
        terms = zip(counts, before, after, strict=True)
        gain = float(sum(n * (b - a) for n, b, a in terms))
        ranked.append(Candidate(gain, effect, fitted))
    return ranked


def misfit(left: NDArray[np.float64]) -> float:
    """Return −2 log-likelihood a sample of a residual in floors, less that of one floor.

    Over the floor the noise is as large as what is left, which takes the logarithm; under it, as
    large as the floor says, so that what is far below counts for little.
    """
    square = float(np.mean(left**2))
    return float(np.log(square)) if square > 1.0 else square - 1.0


def likelier_by(outputs: Sequence[Output], right: Fit, wrong: Fit) -> float:
    """Return the log-likelihood by which one fit of all of the record beats another."""
    gain = 0.0
    for output in outputs:
        left = output.residual(right.rig)
        count = 0.5 * len(left) / memory(left)
        gain += count * (misfit(output.residual(wrong.rig)) - misfit(left))
    return gain
