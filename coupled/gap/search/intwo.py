"""Two effects that explain a gap together, where neither is worth having alone.

Each alone leaves what the other does, which is slow, so that few samples speak for either: a servo
too slow and a play that yields, a wrong gradient and a wrong mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect
from coupled.gap.search.candidates import fitted_candidates
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.signals.output import explained_below, stage_limits
from coupled.gap.thresholds import FIRST_OF_TWO, LEAST_GAIN


def in_two(
    case: Case, settled: Fit, library: Sequence[Effect], output: str, ranked: Sequence[Candidate]
) -> list[Candidate]:
    """Return the candidates that explain an output with one more, by what both gain, best first.

    `ranked` are those that were tried alone. None but where two together leave what an effect may.
    """
    enough = explained_below(case.gaps(settled.rig)[output], stage_limits(case.outputs)[output])
    found = []
    for first in [one for one in ranked if one.gain > 0.0][:FIRST_OF_TWO]:
        seconds = fitted_candidates(case, first.fit, library, {output})
        worth = [one for one in seconds if min(one.gain, first.gain + one.gain) >= LEAST_GAIN]
        if worth and case.gaps(worth[0].fit.rig)[output] <= enough:
            found.append(replace(first, gain=first.gain + worth[0].gain))
    return sorted(found, key=lambda one: -one.gain)
