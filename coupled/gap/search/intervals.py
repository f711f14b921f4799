"""Confidence intervals of fitted parameters: the widest of three 95 % intervals.

The first assumes a stationary residual with a correlation time. The second is the sandwich
estimator from the scatter of the score between stretches (White, Econometrica 48, 1980); it
includes misfit, and needs more stretches than parameters. The stretches of a short record are
therefore divided into parts much longer than the residual's correlation time (`memory`). Parameters
that only their priors determine take no degree of freedom of Student's t.

Neither sees an error of the input that lasts: the fit takes it for the parameters' effect. The
third is the scatter of the estimates (JᵀJ)⁻¹·Jᵀ·e of samples e of the input's propagated error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from coupled.gap.search.descent import End
from coupled.gap.signals.output import Floats, memory
from coupled.gap.thresholds import DOUBLED, EDGE_BISECTIONS, LEAST_MEMORIES

Numbers = NDArray[np.intp]


def half_width(
    found: End, frames: Sequence[int], groups: Numbers, known: Floats, errors: Floats
) -> Floats:
    """Return half of each scaled parameter's 95 % interval; infinite if it is undetermined.

    `frames` are the outputs' numbers of rows, `groups` the stretch numbers of the rows, `known` the
    1/variance of the priors, `errors` samples of the input's error, shape (samples, rows).
    """
    jacobian, left = found.jac, found.fun
    variance, unit, widen = _counted(left, frames)
    before = np.diag(known)
    plain = np.linalg.pinv(jacobian.T @ jacobian / unit + before)
    slopes = jacobian.T @ jacobian / variance
    bread = np.linalg.pinv(slopes + before)
    parts = cut(groups, jacobian.shape[1], widen)
    names, number = np.unique(parts, return_inverse=True)
    scores = np.zeros((len(names), jacobian.shape[1]))
    np.add.at(scores, number, jacobian * left[:, None])
    freedom = max(1, len(names) - jacobian.shape[1])
    scatter = scores.T @ scores * (len(names) / freedom) / variance**2
    filled = bread @ (scatter + before) @ bread
    square = np.maximum(np.maximum(np.diag(plain), np.diag(filled)), 0.0)
    determined = float(np.trace(bread @ slopes))  # parameters that the data determine
    half = stdtrit(max(1.0, len(names) - determined), 0.975) * np.sqrt(square)
    if len(errors):
        moved = (errors @ jacobian / variance) @ bread
        half = np.maximum(half, stdtrit(len(errors), 0.975) * np.sqrt(np.mean(moved**2, axis=0)))
    half[(np.linalg.norm(jacobian, axis=0) < 1e-9) & (known == 0.0)] = np.inf
    return np.asarray(half)


def open_above(
    cost: Callable[[float], float], found: float, ends: tuple[float, float], worth: float
) -> tuple[float, float] | None:
    """Return the least value as likely as the fitted one, and the lower limit of its interval.

    None unless every larger value, up to the upper of the `ends`, is as likely, and the lower end
    is not: as of a play wider than the motion, whose width the data do not determine. `cost` is
    half a sum of squares, `worth` the cost of one unit of log-likelihood.
    """
    least, most = ends
    margin = 0.5 * float(chdtri(1.0, 0.05)) * worth  # χ² of one number, 95 %
    now, there = cost(found), cost(most)
    if abs(there - now) > margin or cost(least) - max(there, now) <= margin:
        return None
    edge = least_of(cost, (least, found), now) if there == now else found
    return edge, least_of(cost, (least, edge), max(there, now) + margin)


def least_of(cost: Callable[[float], float], ends: tuple[float, float], limit: float) -> float:
    """Return the least value between two `ends` whose cost is within a limit, by bisection."""
    below, above = ends
    for _ in range(EDGE_BISECTIONS):
        middle = 0.5 * (below + above)
        below, above = (below, middle) if cost(middle) <= limit else (middle, above)
    return above


def cost_of_unit_likelihood(found: End, frames: Sequence[int]) -> float:
    """Return the cost, half a sum of squares, of one unit of log-likelihood at the optimum."""
    return _counted(found.fun, frames)[1]


def _counted(left: Floats, frames: Sequence[int]) -> tuple[float, float, float]:
    """Return the largest of each of three numbers of the outputs of a weighted residual.

    They are the mean square, the mean square times the correlation time, and that time, frames.
    """
    parts = np.split(left, np.cumsum(frames)[:-1])
    squares = np.array([max(float(np.mean(part**2)), 1e-12) for part in parts])
    memories = np.array([memory(part) for part in parts])
    return float(squares.max()), float((squares * memories).max()), float(memories.max())


def cut(groups: Numbers, numbers: int, memories: float) -> Numbers:
    """Return each frame's stretch number, with stretches divided if there are too few of them.

    A part lasts at least `LEAST_MEMORIES` correlation times (`memories`, frames), and is the same
    in every output. `numbers` is the number of parameters.
    """
    begins = np.flatnonzero(np.diff(groups, prepend=groups[0] - 1))
    lengths = np.diff(np.append(begins, len(groups)))
    wanted = DOUBLED * numbers / len(np.unique(groups))
    room = float(np.median(lengths)) / (LEAST_MEMORIES * memories)
    parts = int(min(np.ceil(wanted), room))
    if parts < 2:
        return groups
    since = np.arange(len(groups)) - np.repeat(begins, lengths)
    part = since * parts // np.repeat(lengths, lengths)
    return np.asarray(groups * parts + part)
