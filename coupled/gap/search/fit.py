"""Fitting a set of effects to a record's stages, as physics, by least squares.

The residuals are in floors, so a channel weighs by what noise leaves it. Each fit returns
its outcome: values, intervals (from the Jacobian, widened by the residual's memory), which
of them stand at a bound, and the residuals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, Parameter, possible
from coupled.gap.effects.settings import CONTACT
from coupled.gap.search.descent import WHOLE, Descent
from coupled.gap.search.intervals import beyond, half_width, least_of, open_above, worth_of
from coupled.gap.search.slopes import Slope
from coupled.gap.signals.output import Output, Part
from coupled.gap.thresholds import LEAST_GAIN
from coupled.parallel import go_on
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
_FAR = 1e6  # floors: the residual of a rig that the physics cannot give


@dataclass(frozen=True)
class Fit:
    """A fitted set of effects: `values`, `low`, `high` (95 %) by "effect.parameter"."""

    effects: tuple[Effect, ...]
    values: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    at_bound: tuple[str, ...]
    rig: Rig
    cost: float  # half the sum of squares, in floors
    # {keys of parameters fitted together: JᵀJ in their own units}, J in floors
    information: Mapping[tuple[str, ...], Floats] = field(default_factory=dict, compare=False)
    # {the same: the slopes of all frames where it ended}, to begin another fit by
    slopes: Mapping[tuple[str, ...], Slope | None] = field(
        default_factory=dict, repr=False, compare=False
    )


def touched(outputs: Sequence[Output], effects: Sequence[Effect]) -> list[Output]:
    """Return the outputs that these effects act on."""
    stages = {stage for effect in effects for stage in effect.shows_in}
    return [output for output in outputs if output.stage in stages]


def fit(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    effects: Sequence[Effect],
    nuisances: Sequence[Effect] = (),
    part: Part = "all",
    start: Mapping[str, float] | None = None,
    only: Effect | None = None,
    descent: Descent = WHOLE,
) -> Fit:
    """Return the effects fitted to a part of the outputs that they touch.

    Starts from each parameter's own starts, or from `start` where it has a value, and keeps
    the best. `nuisances` are settings, free within their tolerance: fitted, but nothing found.
    Effects that share no output are fitted each on its own, so that neither's misfit misleads
    the other; of effects that free the same number the first fits it, and the others have it
    from there. With `only`, just those that share one with it, and the others stay at `start`. A
    set that the physics cannot give stands at its bounds.
    """
    every = [*effects, *nuisances]
    values: dict[str, float] = {}
    low: dict[str, float] = {}
    high: dict[str, float] = {}
    bound: tuple[str, ...] = ()
    cost, information = 0.0, dict[tuple[str, ...], Floats]()
    slopes = dict[tuple[str, ...], Slope | None]()
    for group in _groups(every):
        if only is None or only in group:
            ours = touched(outputs, group)
            given = (nominal, control, ours, group, part, start or {}, nuisances, descent)
            found = _remembered(*given)
            low, high, bound = low | found.low, high | found.high, bound + found.at_bound
            values, cost = values | found.values, cost + found.cost
            information[tuple(found.values)] = found.information
            slopes[tuple(found.values)] = found.slope
            continue
        keys, frees = _free(group)
        values |= dict(zip(keys, _starts(keys, frees, start or {})[0], strict=True))
    for key, owner in shared(every).items():
        values[key] = values[owner]
        if owner in low:
            low[key], high[key] = low[owner], high[owner]
    rig = possible(nominal, control, every, values)
    if rig is None:
        rig, bound = nominal, tuple(values)
    return Fit(tuple(effects), values, low, high, bound, rig, cost, information, slopes)


def _groups(effects: Sequence[Effect]) -> list[list[Effect]]:
    """Return the effects in groups that share no output."""
    groups: list[tuple[set[str], list[Effect]]] = []
    for effect in effects:
        stages, members = set(effect.shows_in), [effect]
        separate = []
        for others, theirs in groups:
            if others & stages:
                stages, members = stages | others, theirs + members
            else:
                separate.append((others, theirs))
        groups = [*separate, (stages, members)]
    return [members for _, members in groups]


@dataclass(frozen=True)
class _Group:
    """The fit of effects that share outputs."""

    values: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]
    at_bound: tuple[str, ...]
    cost: float
    information: Floats
    slope: Slope | None = None


# {effects, which are nuisances, part, whether by wide steps, evaluations, values at the starts:
# the fit}, of one rig and its outputs
Asked = tuple[tuple[Effect, ...], frozenset[str], Part, bool, int, tuple[tuple[float, ...], ...]]


def _remembered(
    nominal: Rig,
    control: ControlName,
    ours: Sequence[Output],
    effects: Sequence[Effect],
    part: Part,
    start: Mapping[str, float],
    nuisances: Sequence[Effect],
    descent: Descent,
) -> _Group:
    """Return a fit, as it is known; one that starts where another ended is that one."""
    known = descent.known
    if known is None:
        return _fit(nominal, control, ours, effects, part, start, nuisances, descent)
    stepped = any(output.stepped for output in ours)
    wide = stepped and descent.steps == "wide"
    among = frozenset(one.name for one in nuisances if one in effects)
    what = (tuple(effects), among, part, wide, descent.most)
    key: Asked = (*what, tuple(map(tuple, _starts(*_free(effects), start))))
    if key not in known:
        given = (nominal, control, ours, effects, part, start, nuisances, descent)
        known[key] = found = _fit(*given)
        known[*what, (tuple(found.values.values()),)] = found
    held: _Group = known[key]
    return held


def _fit(
    nominal: Rig,
    control: ControlName,
    ours: Sequence[Output],
    effects: Sequence[Effect],
    part: Part,
    start: Mapping[str, float],
    nuisances: Sequence[Effect] = (),
    descent: Descent = WHOLE,
) -> _Group:
    keys, frees = _free(effects)
    scale = np.array([_scale(p) for p in frees])
    frames = sum(len(output.measured) for output in ours)

    def residual(scaled: Floats, wide: bool = False, rough: bool = False) -> Floats:
        go_on()
        values = dict(zip(keys, (scaled * scale).tolist(), strict=True))
        rig = possible(nominal, control, effects, values)
        if rig is None:
            return np.full(frames, _FAR)
        return np.concatenate([output.residual(rig, "all", wide, rough) for output in ours])

    if not ours:
        known = dict(zip(keys, _starts(keys, frees, start)[0], strict=True))
        return _Group(known, {}, {}, (), 0.0, np.zeros((len(keys), len(keys))))
    rows = np.concatenate([output.rows(part) for output in ours])
    if not keys:
        left = residual(np.array([]))[rows]
        return _Group({}, {}, {}, (), 0.5 * float(left @ left), np.zeros((0, 0)))
    ends = np.array([p.bounds(nominal, control) for p in frees]).T
    low, high = ends / scale
    stepped = any(output.stepped for output in ours)
    firsts = [np.array(first) / scale for first in _starts(keys, frees, start)]
    # A contact is free beside any dry friction that is filed.
    rubs = any(one.dry for one in effects) or any(p.key in CONTACT for p in frees)
    search = replace(descent, rubs=rubs)
    best = search.end(residual, firsts, (low, high), stepped, rows, descent.slopes.get(tuple(keys)))

    def cost(at: float, k: int) -> float:
        left = residual(_with(best.x, k, at))[rows]
        return 0.5 * float(left @ left)

    swallows = [k for k, p in enumerate(frees) if p.saturates]
    for k in swallows:
        most = cost(float(high[k]), k)
        if most < best.cost:
            span = (float(best.x[k]), float(high[k]))
            edge = _with(best.x, k, least_of(partial(cost, k=k), span, most))
            again = search.end(residual, [edge], (low, high), stepped, rows)
            best = min(best, again, key=lambda one: one.cost)
    number = [1000 * output.record + output.stretches[output.rows(part)] for output in ours]
    within = {one.value_key(p) for one in nuisances for p in one.free}
    known = np.array([12.0 if key in within else 0.0 for key in keys]) / (high - low) ** 2
    half = half_width(best, len(ours), np.concatenate(number), known) * scale
    # Where all that is filed is taken off, nothing is left of it: that is an answer.
    gone = np.isclose(best.x, low, atol=1e-4) & (ends[0] < [p.low for p in frees])
    values = np.where(gone, ends[0], best.x * scale)
    sizes = [p.error(v, nominal, control) for p, v in zip(frees, values, strict=True)]
    half = np.hypot(half, sizes)
    # A small cubic is near its bound on the scale of a large one, but known not to be there.
    small = np.isclose(best.x, low, atol=1e-4) & ((best.x - low) * scale <= half)
    stuck = small | np.isclose(best.x, high, rtol=1e-4)
    stuck &= ~np.array([p.may_end for p in frees]) & ~gone
    # A setting may well stand at its end where little would be gained beyond.
    stuck &= (known == 0.0) | (beyond(best, len(ours)) >= LEAST_GAIN)
    # Of a limit that the records do not meet, nothing is known, and the others stand without it.
    stuck |= ~np.isfinite(half) & ~np.array([p.may_end and p.inverse for p in frees])
    lower, upper = values - half, values + half
    for k in swallows:
        span = (float(low[k]), float(high[k]))
        open_one = open_above(partial(cost, k=k), float(best.x[k]), span, worth_of(best, len(ours)))
        if open_one is not None:
            values[k], lower[k], upper[k] = open_one[0] * scale[k], open_one[1] * scale[k], np.inf
            stuck[k] = False
    return _Group(
        dict(zip(keys, values.tolist(), strict=True)),
        dict(zip(keys, lower.tolist(), strict=True)),
        dict(zip(keys, upper.tolist(), strict=True)),
        tuple(key for key, at in zip(keys, stuck, strict=True) if at),
        best.cost,
        np.asarray(best.jac.T @ best.jac) / np.outer(scale, scale),
        best.slope,
    )


def _with(x: Floats, k: int, at: float) -> Floats:
    """Return scaled numbers with another in place of one."""
    other = x.copy()
    other[k] = at
    return other


def _scale(p: Parameter) -> float:
    """Return a size of a parameter for which a step of a hundredth is small."""
    return max(abs(start) for start in p.starts) or 0.5 * (p.high - p.low)


def _free(effects: Sequence[Effect]) -> tuple[list[str], list[Parameter]]:
    others = shared(effects)
    pairs = [(e.value_key(p), p) for e in effects for p in e.free if e.value_key(p) not in others]
    return [key for key, _ in pairs], [p for _, p in pairs]


def shared(effects: Sequence[Effect]) -> dict[str, str]:
    """Return {a value's key: that of the same number of the rig, which an effect before it has}."""
    owner: dict[str, str] = {}
    found = {}
    for effect in effects:
        for p in effect.free:
            key = effect.value_key(p)
            if owner.setdefault(p.key, key) != key:
                found[key] = owner[p.key]
    return found


def _starts(
    keys: list[str], frees: list[Parameter], start: Mapping[str, float]
) -> list[list[float]]:
    pairs = list(zip(keys, frees, strict=True))
    tries = max((len(p.starts) for key, p in pairs if key not in start), default=1)
    return [
        [start.get(key, p.starts[min(i, len(p.starts) - 1)]) for key, p in pairs]
        for i in range(tries)
    ]
