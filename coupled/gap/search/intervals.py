"""How well a fit's numbers are known: the wider of two 95 % intervals.

White residuals widened by their memory count every frame; the scatter of the score from stretch to
stretch (the sandwich; White, Econometrica 48, 1980) counts misfit wherever it sits, and needs more
stretches than there are numbers. Where a record is short, its stretches are therefore cut, down to
parts that hold many times the residual's memory.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from coupled.gap.search.descent import End
from coupled.gap.signals.output import memory
from coupled.gap.thresholds import EDGE_BISECTIONS, LEAST_MEMORIES, STRETCHES_A_NUMBER

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]


def half_width(found: End, outputs: int, groups: Numbers, known: Floats) -> Floats:
    """Return half of each scaled parameter's 95 % interval; infinite where nothing determines it.

    The larger of two: white residuals widened by their memory, and the scatter of the score from
    stretch to stretch (the sandwich), which counts misfit wherever it sits. `known` is what is
    known beforehand, 1/variance: of a setting, that it is anywhere within its tolerance.
    """
    jacobian, left = found.jac, found.fun
    variance, widen = _counted(left, outputs)
    before = np.diag(known)
    plain = np.linalg.pinv(jacobian.T @ jacobian / (variance * widen) + before)
    bread = np.linalg.pinv(jacobian.T @ jacobian / variance + before)
    parts = cut(groups, jacobian.shape[1], widen)
    names, number = np.unique(parts, return_inverse=True)
    scores = np.zeros((len(names), jacobian.shape[1]))
    np.add.at(scores, number, jacobian * left[:, None])
    freedom = max(1, len(names) - jacobian.shape[1])
    scatter = scores.T @ scores * (len(names) / freedom) / variance**2
    filled = bread @ (scatter + before) @ bread
    square = np.maximum(np.maximum(np.diag(plain), np.diag(filled)), 0.0)
    half = stdtrit(freedom, 0.975) * np.sqrt(square)
    half[(np.linalg.norm(jacobian, axis=0) < 1e-9) & (known == 0.0)] = np.inf
    return np.asarray(half)


def open_above(
    cost: Callable[[float], float], found: float, ends: tuple[float, float], worth: float
) -> tuple[float, float] | None:
    """Return the least number that does as well as one found, and the lower end of its interval.

    None but where any larger one does as well, up to the greater of its `ends`, and none at the
    lesser does not: a play wider than a motion swallows all of it, and no record tells how wide it
    is. `cost` is half a sum of squares, and `worth` how much of that a log-likelihood of 1 is.
    """
    least, most = ends
    margin = 0.5 * float(chdtri(1.0, 0.05)) * worth  # χ² of one number, 95 %
    now, there = cost(found), cost(most)
    if abs(there - now) > margin or cost(least) - max(there, now) <= margin:
        return None
    edge = least_of(cost, (least, found), now) if there == now else found
    return edge, least_of(cost, (least, edge), max(there, now) + margin)


def least_of(cost: Callable[[float], float], ends: tuple[float, float], limit: float) -> float:
    """Return the least number between two `ends` that costs no more than a limit, as the last."""
    below, above = ends
    for _ in range(EDGE_BISECTIONS):
        middle = 0.5 * (below + above)
        below, above = (below, middle) if cost(middle) <= limit else (middle, above)
    return above


def worth_of(found: End, outputs: int) -> float:
    """Return how much of half the sum of squares a log-likelihood of 1 is, at a fit's end."""
    square, memories = _counted(found.fun, outputs)
    return square * memories


def _counted(left: Floats, outputs: int) -> tuple[float, float]:
    """Return a residual's mean square, and the most frames that count as one."""
    rows = len(left) // outputs
    memories = max(memory(left[i * rows : (i + 1) * rows]) for i in range(outputs))
    return max(float(np.mean(left**2)), 1e-12), memories


def cut(groups: Numbers, numbers: int, memories: float) -> Numbers:
    """Return each frame's stretch, cut where there are too few for so many numbers.

    `memories` is how many frames count as one. A part holds `LEAST_MEMORIES` times as many or more,
    and at the same place in every output.
    """
    begins = np.flatnonzero(np.diff(groups, prepend=groups[0] - 1))
    lengths = np.diff(np.append(begins, len(groups)))
    wanted = STRETCHES_A_NUMBER * numbers / len(np.unique(groups))
    room = float(np.median(lengths)) / (LEAST_MEMORIES * memories)
    parts = int(min(np.ceil(wanted), room))
    if parts < 2:
        return groups
    since = np.arange(len(groups)) - np.repeat(begins, lengths)
    part = since * parts // np.repeat(lengths, lengths)
    return np.asarray(groups * parts + part)
