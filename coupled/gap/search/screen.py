"""Screening: the projection of the residual on each effect's own signature, in milliseconds.

A signature is taken at sizes over three decades, since friction, play and rate limits do nothing
at one size and everything at another; the projection itself is free of scale. The size that
leaves least is where a fit starts.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect, possible
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit, touched
from coupled.gap.search.limits import is_limit, limits
from coupled.gap.thresholds import (
    RACE_BEHIND,
    SCREEN_ALIKE,
    SCREEN_FACTORS,
    SCREEN_LESS,
    SCREEN_NEAR,
    SCREEN_SHOWN,
    SCREEN_SIZES,
    SCREENED,
    SCREENED_BESIDE,
    SCREENED_LEAST,
    SCREENED_MOST,
)
from coupled.parallel import go_on, in_threads
from coupled.rig.rig import Rig


class Screened(NamedTuple):
    """A candidate, where its fits start, and the power that its signature takes, floors²."""

    effect: Effect
    starts: list[dict[str, float]]
    taken: float


def screen(
    case: Case, current: Fit, candidates: Sequence[Effect], always: Collection[str] = ()
) -> list[Screened]:
    """Return the candidates whose signature takes most of the residual, and where to start.

    There is a start for each shape that an effect of several parameters begins from. One without
    a parameter is always among them, unless it leaves far more than there was, and so are those
    named in `always`. Beside an effect more are kept: its size is not right until the other's is
    known, and so neither is what is left. And those that take nearly as much as the best are all
    kept: which of them is the cause, a signature at one size does not say.
    """
    found = in_threads(lambda effect: screened(case, current, effect), candidates)
    scores = [(*one, effect) for effect, one in zip(candidates, found, strict=True) if one[1]]
    scores.sort(key=lambda item: -item[0])
    near = [k for k, item in enumerate(scores) if item[0] >= SCREEN_NEAR * scores[0][0]]
    many = SCREENED_BESIDE if current.effects else SCREENED
    alike = sum(item[0] >= SCREEN_ALIKE * scores[0][0] for item in scores[:SCREENED_MOST])
    most = max(alike, min(many, max(SCREENED_LEAST, len(near))))
    others = (item for item in scores[most:] if not item[2].free or item[2].name in always)
    kept = [*scores[:most], *others]
    return [Screened(effect, starts, taken) for taken, starts, effect in kept]


def screened(case: Case, current: Fit, effect: Effect) -> tuple[float, list[dict[str, float]]]:
    """Return the power that an effect's signature takes, floors², and the starts of its fits."""
    ours = touched(case.outputs, [effect])
    now = np.concatenate([output.residual(current.rig, wide=True) for output in ours])
    best, starts = 0.0, list[dict[str, float]]()
    for tries in _tries(case, current, effect):
        least, start = np.inf, {}
        for values in tries:
            go_on()
            rig = _with(case, current, effect, values)
            if rig is None:
                continue
            left = np.concatenate([output.residual(rig, wide=True) for output in ours])
            sign = now - left
            size = float(sign @ sign)
            best = max(best, float(now @ sign) ** 2 / size if size > 0.0 else 0.0)
            # A limit that is never met leaves the residual as it is, and a fit where it was.
            if size > SCREEN_SHOWN * len(now) and float(left @ left) < least:
                least, start = float(left @ left), values
        hopeless = not effect.free and least > RACE_BEHIND * float(now @ now)
        starts += [start] if start or not (effect.free or hopeless) else []
    return best, starts


def _shows(case: Case, current: Fit, effect: Effect, values: dict[str, float]) -> bool:
    """Tell whether an effect of these values changes the residual."""
    go_on()
    rig = _with(case, current, effect, values)
    if rig is None:
        return False
    ours = touched(case.outputs, [effect])
    turn = [o.residual(current.rig, wide=True) - o.residual(rig, wide=True) for o in ours]
    return sum(float(t @ t) for t in turn) > SCREEN_SHOWN * sum(len(t) for t in turn)


def _with(case: Case, current: Fit, effect: Effect, values: dict[str, float]) -> Rig | None:
    """Return the current rig with one more effect, None where the physics cannot give it."""
    chosen = (*current.effects, effect)
    every = (*chosen, *case.nuisances(chosen))
    known = {**case.neutral, **current.values, **values}
    return possible(case.nominal, case.control, every, known)


def _tries(case: Case, current: Fit, effect: Effect) -> list[list[dict[str, float]]]:
    """Return sets of an effect's parameters to try, by shapes of which each may give a start."""
    if is_limit(effect) and not STAGE_OF[effect.stage].flown:
        key = effect.value_key(effect.free[0])
        met = limits(effect, lambda value: _shows(case, current, effect, {key: value}))
        return [[{key: value} for value in each] for each in met]
    if effect.seen is None:
        shapes = max([len(p.starts) for p in effect.free], default=1)
        return [_sizes(case, current, effect, shape) for shape in range(shapes)]
    seen = effect.seen(case.outputs, current.rig, case.control)
    return [
        [
            {effect.value_key(p): float(np.clip(one[p.name], p.low, p.high)) for p in effect.free}
            for one in seen
        ]
    ]


def _sizes(case: Case, current: Fit, effect: Effect, shape: int) -> list[dict[str, float]]:
    """Return sets of an effect's parameters to try; one where each has to be flown."""
    flown = STAGE_OF[effect.stage].flown
    found = []
    for k in range(1 if flown or not effect.free else len(SCREEN_SIZES)):
        values = {}
        for p in effect.free:
            start = value = p.starts[min(shape, len(p.starts) - 1)]
            if not flown and p.mode == "factor":
                value = 1.0 + SCREEN_FACTORS[k] * (start - 1.0)
            elif not flown and p.scanned:
                value = SCREEN_SIZES[k] * start
            value += p.base(current.rig, case.control)
            values[effect.value_key(p)] = float(np.clip(value, p.low, p.high))
        found.append(values)
    return found + _less(case, effect, found[0])


def _less(case: Case, effect: Effect, first: dict[str, float]) -> list[dict[str, float]]:
    """Return sets with less of what is filed than the rig file says, where some of it is."""
    found = []
    for share in SCREEN_LESS:
        values = dict(first)
        for p in effect.free:
            least = p.bounds(case.nominal, case.control)[0]
            if p.scanned and least < p.low:
                values[effect.value_key(p)] = share * least
        found += [values] if values != first else []
    return found
