"""Least squares of a fit between bounds, for residuals with small jumps.

The Jacobian is of finite differences. They cost a replay for each parameter. For a residual with
jumps the last Jacobian is reused while the residual has changed by less than a difference step. For
a smooth residual it is corrected by the error of its prediction of the last step (Broyden, Math.
Comp. 19, 1965).

Each step minimises the linearised residual within the bounds, with damping (Levenberg 1944,
Marquardt 1963; damping updated after Nielsen, IMM-REP-1999-05). Friction, breakout and play make
the residual jump by small amounts. Near the minimum the predicted decrease is smaller than the
jumps. The descent therefore ends at a small predicted decrease, or after several rejected steps.

The first of two phases takes coarse steps of the loader. They are enough far from the optimum, and
for all derivatives. The second phase minimises the residual at the loader's own steps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from scipy.optimize import lsq_linear

from coupled.gap.noise.noise import rms_of
from coupled.gap.signals.output import Floats, memory
from coupled.gap.thresholds import (
    DAMPING_FACTOR,
    DAMPING_FIRST,
    DIFFERENCE,
    DIFFERENCE_STEPS,
    DOUBLED,
    FEW,
    FEWER,
    FIT_ITERATIONS,
    LESSER,
    MINOR,
    MOST,
    NEGLIGIBLE,
    PARTLY,
    ROUGH,
    ROUNDS,
    SLOPES_KEPT,
    SMALL,
    TINY,
)
from coupled.parallel import in_threads

Ends = tuple[Floats, Floats]


@dataclass(frozen=True)
class Slope:
    """The residual of all frames, in noise floors, and its Jacobian, at scaled parameters `at`.

    The Jacobian has shape (frames, parameters).
    """

    at: Floats
    residual: Floats
    jacobian: Floats

    def kept(self) -> Slope | None:
        """Return the Jacobian, to start another fit with; None if it is too large to keep."""
        return self if self.jacobian.size <= 4 * SLOPES_KEPT else None


class Slopes:
    """Finite differences over steps that change the residual by about a third of a noise floor.

    Friction, breakout and play make the residual jump by small amounts: a difference over less is
    no derivative of the fit's cost. Far from the optimum the jumps are larger, and a step changes
    the residual by at least a `share` of it. A `smooth` residual has no jumps, and its steps do not
    grow. `last` is the last Jacobian, possibly of another fit of the same parameters and frames.
    Columns of `held` without NaN are reused, shape (frames, parameters).
    """

    def __init__(
        self,
        residual: Callable[[Floats], Floats],
        ends: Ends,
        share: float = 0.0,
        last: Slope | None = None,
        smooth: bool = False,
        held: Floats | None = None,
    ) -> None:
        self._residual, self._share = residual, share
        self._smooth, self._held = smooth, held
        self._low, self._high = ends
        self._step = np.full(len(self._low), 0.01)
        self.last = last
        self.corrections = 0  # since the last differences
        self.sure = True  # the prediction errors were small

    def __call__(self, x: Floats) -> Floats:
        """Return the Jacobian, shape (frames, parameters)."""
        here = self._residual(x)
        jacobian = self._still_good(x, here)
        if jacobian is None:
            jacobian = self._differences(x, here)
            self.last, self.corrections = Slope(x.copy(), here, jacobian), 0
            self.sure = True
        return jacobian

    def _still_good(self, x: Floats, here: Floats) -> Floats | None:
        """Return the last Jacobian, corrected if need be; None if it no longer holds."""
        last = self.last
        if last is None or len(last.residual) != len(here):
            return None
        moved, step = here - last.residual, x - last.at
        size = rms_of(moved)
        if not self._smooth or size <= TINY:
            return last.jacobian if size <= FEW else None
        missed = rms_of(moved - last.jacobian @ step)
        if self.corrections >= (2 * ROUNDS) or missed > ROUGH * size:
            return None
        change = np.outer(moved - last.jacobian @ step, step / float(step @ step))
        self.last = Slope(x.copy(), here, last.jacobian + change)
        self.corrections += 1
        self.sure = self.sure and missed <= MINOR * size
        return self.last.jacobian

    def _differences(self, x: Floats, here: Floats) -> Floats:
        wanted = max(DIFFERENCE, self._share * rms_of(here))

        def column(i: int) -> Floats:
            if self._held is not None and not np.isnan(self._held[0, i]):
                return self._held[:, i]
            value = x[i]
            room = max(self._high[i] - value, value - self._low[i])
            step = min(self._step[i], 0.5 * room)
            there = x.copy()
            there[i] = value + (step if self._high[i] - value > step else -step)
            change = self._residual(there) - here
            most = 1.0 if self._smooth else 10.0
            growth = np.clip(wanted / max(rms_of(change), 1e-9), 0.1, most)
            self._step[i] = float(np.clip(step * growth, *DIFFERENCE_STEPS))
            return np.asarray(change / (there[i] - value))

        return np.column_stack(in_threads(column, range(len(x))))


@dataclass(frozen=True)
class End:
    """The result of least squares: scaled parameters, residual and Jacobian.

    `cost` is half the residual's sum of squares. `rejected`: the last steps did not decrease it.
    `slope` is the Jacobian, if kept for another fit.
    """

    x: Floats
    cost: float
    fun: Floats
    jac: Floats
    evaluations: int = 0
    rejected: bool = False
    slope: Slope | None = None


def descend(
    residual: Callable[[Floats], Floats],
    slopes: Callable[[Floats], Floats],
    first: Floats,
    ends: tuple[Floats, Floats],
    most: int,
    enough: Callable[[Floats], float],
) -> End:
    """Minimise half a residual's sum of squares from the first parameters, between bounds `ends`.

    `residual` returns shape (frames,), `slopes` its Jacobian. At most `most` residuals are
    evaluated. The descent ends where the predicted relative decrease is less than `enough` of the
    residual.
    """
    x = np.clip(first, *ends)
    current, jacobian = residual(x), slopes(x)
    cost, evaluations = 0.5 * float(current @ current), 1
    damping, rejected = DAMPING_FIRST, 0
    share = enough(current)
    # Beyond a saturation (a limit, a play) the Jacobian vanishes: the step is limited.
    reach = max(float(np.linalg.norm(x)), 1.0)
    scale = np.linalg.norm(jacobian, axis=0)
    while evaluations < most:
        near = np.maximum(ends[0], x - reach), np.minimum(ends[1], x + reach)
        step, predicted = _step(jacobian, current, x, near, damping, scale)
        if predicted <= share * cost:
            break
        trial = np.clip(x + step, *ends)
        trial_residuals = residual(trial)
        evaluations += 1
        reached = 0.5 * float(trial_residuals @ trial_residuals)
        gain = (cost - reached) / predicted
        if gain <= 0.0:
            rejected += 1
            if rejected >= (ROUNDS if predicted < NEGLIGIBLE * cost else (2 * ROUNDS)):
                break
            damping = max(DAMPING_FACTOR * damping, (3 * DAMPING_FIRST))
            continue
        little = cost - reached <= share * cost
        x, current, cost, jacobian = trial, trial_residuals, reached, slopes(trial)
        share = enough(current)
        scale = np.maximum(scale, np.linalg.norm(jacobian, axis=0))
        damping *= max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
        reach, rejected = 2.0 * reach if gain > (1.0 - PARTLY) else reach, 0
        if little:
            break
    return End(x, cost, current, jacobian, evaluations, rejected > 0)


def _step(
    jacobian: Floats,
    current: Floats,
    x: Floats,
    ends: tuple[Floats, Floats],
    damping: float,
    scale: Floats,
) -> tuple[Floats, float]:
    """Return a damped step between the bounds, and the predicted decrease of the cost.

    A QR factorisation makes the bounded problem small.
    """
    base, triangle = np.linalg.qr(jacobian)
    against = base.T @ current
    sizes = np.where(scale > 0.0, scale, 1.0)
    rows = np.vstack((triangle / sizes, np.sqrt(damping) * np.eye(len(x))))
    wanted = np.concatenate((-against, np.zeros(len(x))))
    room = ((ends[0] - x) * sizes - 1e-12, (ends[1] - x) * sizes + 1e-12)
    step = lsq_linear(rows, wanted, room, method="bvls").x / sizes
    after = triangle @ step + against
    return step, 0.5 * float(against @ against - after @ after)


@dataclass(frozen=True)
class Descent:
    """The options of a fit: its `steps` of the loader, and `most` evaluations in each phase.

    Steps are `own` if the start is near the optimum, `coarse` if only a comparison is needed, or
    `both`. `known` caches fits to the same outputs. `slopes` are Jacobians of a fit that ended at
    the start, by its keys. For `dry` friction the fit stops at a larger gain per step: the last
    steps gain less than the data can show. Columns of the Jacobian in `held` are reused (`Slopes`).
    """

    steps: Literal["coarse", "own", "both"] = "both"
    most: int = FIT_ITERATIONS
    known: dict[Any, Any] | None = field(default=None, repr=False, compare=False)
    slopes: Mapping[tuple[str, ...], Slope | None] = field(
        default_factory=dict, repr=False, compare=False
    )
    dry: bool = False
    held: Floats | None = field(default=None, repr=False, compare=False)

    def end(
        self,
        residual: Callable[..., Floats],
        firsts: Sequence[Floats],
        ends: Ends,
        stepped: bool,
        slope: Slope | None = None,
    ) -> End:
        """Return the best minimum from several starts, between the bounds `ends`.

        `residual` returns the residual in noise floors, shape (frames,), by scaled parameters; with
        `coarse` by coarse steps of the loader, with `rough` approximately, for derivatives. If
        nothing is `stepped` finer than the frames, the second phase is skipped. With a single
        start, `slope` may be the Jacobian of another fit that ended there.
        """
        near, sloping = partial(residual, coarse=True), partial(residual, coarse=True, rough=True)
        best: End | None = None
        if self.steps != "own" or not stepped:
            share = MOST if stepped else 0.0
            search = _Search(near, sloping, ends, share, not stepped, self.dry, self.held)
            best = self._raced(search, firsts, slope)
        if self.steps != "coarse" and stepped:
            first, known = (firsts[0], slope) if best is None else (best.x, best.slope)
            best = _Search(residual, sloping, ends, dry=self.dry).down(first, self.most, known)
        assert best is not None
        return best

    def _raced(self, search: _Search, firsts: Sequence[Floats], slope: Slope | None) -> End:
        """Return the best minimum; starts far behind after a few evaluations are dropped."""
        if len(firsts) == 1:
            return search.down(firsts[0], self.most, slope)
        started = [search.down(first, (2 * ROUNDS)) for first in firsts]
        started.sort(key=lambda one: one.cost)
        if self.most <= (2 * ROUNDS):
            return started[0]
        best = search.down(started[0].x, self.most, started[0].slope)
        for other in started[1:]:
            behind = other.cost > DOUBLED**2 * started[0].cost
            if behind or leaves_noise(best.cost, len(best.fun)):
                break
            best = min(best, search.down(other.x, self.most, other.slope), key=lambda one: one.cost)
        return best


WHOLE = Descent()


def leaves_noise(cost: float, frames: int) -> bool:
    """Tell whether half a sum of squares, noise floors², is that of noise alone."""
    return 2.0 * cost <= (1.0 + SMALL) ** 2 * frames


@dataclass(frozen=True)
class _Search:
    """Least squares, with derivatives of a residual that may be approximate."""

    residual: Callable[[Floats], Floats]
    sloping: Callable[[Floats], Floats]
    ends: Ends
    share: float = 0.0
    smooth: bool = False
    dry: bool = False
    held: Floats | None = None

    def down(self, first: Floats, most: int, slope: Slope | None = None) -> End:
        """Return the minimum from a start, with at most `most` evaluations.

        If the Jacobian was corrected by much, or corrected and its steps were rejected, differences
        are taken again at the end and the descent continues.
        """
        given = (self.share, slope, self.smooth, self.held)
        slopes = Slopes(self.sloping, self.ends, *given)
        x0 = np.clip(first, self.ends[0] + 1e-9, self.ends[1] - 1e-9)

        def enough(left: Floats) -> float:
            """Return the least relative decrease of the cost that a step must make."""
            times = min(memory(left), FEWER) if self.dry else 1.0
            return LESSER * times / 1000

        while True:
            found = descend(self.residual, slopes, x0, self.ends, most, enough)
            most -= found.evaluations
            misled = found.rejected and slopes.corrections > 0
            if (slopes.sure and not misled) or most < 1:
                break
            slopes.last = None  # so that differences are taken next
            x0 = found.x
        known = None if slopes.last is None or misled else slopes.last.kept()
        return replace(found, slope=known)
