"""Choosing effects: each has to earn its place on stretches of the record not used to fit it.

Guilty stages are those whose residual stands clear of its floor. Their candidates are
screened by the projection of the residual on each effect's own signature, the best fitted
as physics on every other stretch, and judged on the stretches between. The gain is a
log-likelihood ratio by effective samples, the frames divided by the residual's memory.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from coupled.channels import ControlName
from coupled.gap.effects import EFFECTS, Effect, apply
from coupled.gap.fit import Fit, fit, memory, shows_in, touched
from coupled.gap.stages import Output
from coupled.rig.parameters import Rig

Floats = NDArray[np.float64]

CLEAR = 1.2  # residual over floor from which a stage is guilty: nominal tolerances stay below
STRETCH_s = 2.5  # a stretch of the record, fitted or held out
LEAST_GAIN = 8.0  # log-likelihood by which an effect must beat the rig without it
RIVAL = 4.0  # and by which the best must beat another to be the only answer
SCREENED = 6
# A pot is set, and a servo tuned, to a few per cent: less than this is no effect.
TOLERANCE = {"inertia": 0.03, "viscous_damping": 0.03, "servo_lag": 0.03}
MOST = 4  # effects in one answer


@dataclass(frozen=True)
class Step:
    """One effect found: its gain, and the others that the record cannot tell from it."""

    effect: Effect
    gain: float
    probability: float
    rivals: tuple[str, ...]


@dataclass(frozen=True)
class Choice:
    """What the search found: its steps, the final fit on all of the record, and what is left."""

    steps: tuple[Step, ...]
    fit: Fit
    before: dict[str, float]
    after: dict[str, float]
    tried: dict[str, float] = field(default_factory=dict)  # first round's gains by effect


def gaps(outputs: Sequence[Output], rig: Rig) -> dict[str, float]:
    """Return each output's rms residual over its floor."""
    return {o.channel: float(np.sqrt(np.mean(o.residual(rig) ** 2))) for o in outputs}


def stretches(frames: int, frame_rate_Hz: float) -> NDArray[np.intp]:
    """Return the number of the stretch that each frame lies in."""
    return np.arange(frames) // max(1, round(STRETCH_s * frame_rate_Hz))


def search(nominal: Rig, control: ControlName, outputs: Sequence[Output]) -> Choice:
    """Return the effects that explain a record's gap, each earning its place in turn."""
    frames = len(outputs[0].measured)
    fitted_on = stretches(frames, nominal.frame_rate) % 2 == 0
    everything = np.ones(frames, dtype=bool)
    current = fit(nominal, control, outputs, (), everything)
    before = gaps(outputs, nominal)
    steps: list[Step] = []
    tried: dict[str, float] = {}
    while len(steps) < MOST:
        ranked = _round(nominal, control, outputs, current, fitted_on)
        tried = tried or {effect.name: gain for gain, effect, _ in ranked}
        if not ranked or ranked[0][0] < LEAST_GAIN:
            break
        gain, effect, found = _simplest(ranked)
        close = [
            e.name
            for g, e, _ in ranked
            if e is not effect and g > gain - RIVAL and len(e.free) <= len(effect.free)
        ]
        weights = np.exp(np.array([min(g - gain, 0.0) for g, _, _ in ranked]))
        wider = [len(e.free) > len(effect.free) for _, e, _ in ranked]
        weights[wider] = 0.0  # what holds the effect as a special case is no rival of it
        steps.append(Step(effect, gain, float(1.0 / weights.sum()), tuple(close)))
        chosen = (*current.effects, effect)
        current = fit(nominal, control, outputs, chosen, everything, found.values)
    return Choice(tuple(steps), current, before, gaps(outputs, current.rig), tried)


def _simplest(ranked: Sequence[tuple[float, Effect, Fit]]) -> tuple[float, Effect, Fit]:
    """Return the best candidate, or one with fewer numbers that is as good."""
    best = ranked[0]
    for item in ranked[1:]:
        if len(item[1].free) < len(best[1].free) and item[0] > ranked[0][0] - RIVAL:
            best = item
    return best


def _round(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    current: Fit,
    fitted_on: NDArray[np.bool_],
) -> list[tuple[float, Effect, Fit]]:
    """Return the candidates by their held-out gain over the current effects, best first."""
    guilty = {o.stage for o in outputs if gaps([o], current.rig)[o.channel] > CLEAR}
    candidates = [
        effect
        for effect in EFFECTS
        if effect not in current.effects and guilty & set(shows_in(effect))
    ]
    found = []
    for effect in _screened(nominal, control, outputs, current, candidates):
        chosen = (*current.effects, effect)
        fitted = fit(nominal, control, outputs, chosen, fitted_on, current.values)
        bound = any(key.startswith(effect.name) for key in fitted.at_bound)
        if not bound and not _within_tolerance(effect, fitted):
            found.append((effect, fitted))
    return _ranked(outputs, current, found, ~fitted_on)


def _within_tolerance(effect: Effect, fitted: Fit) -> bool:
    """Tell whether a nominal number moved by no more than its setting can be trusted to."""
    slack = TOLERANCE.get(effect.name)
    return slack is not None and abs(fitted.values[f"{effect.name}.factor"] - 1.0) < slack


def _ranked(
    outputs: Sequence[Output],
    current: Fit,
    found: Sequence[tuple[Effect, Fit]],
    rows: NDArray[np.bool_],
) -> list[tuple[float, Effect, Fit]]:
    """Return fitted candidates by the held-out log-likelihood that they gain, best first.

    A sample counts as the best candidate's residual lets it, the same for all: a worse one's
    longer memory is its own fault, and no reason to weigh its misfit less.
    """
    before = [float(np.mean(o.residual(current.rig)[rows] ** 2)) for o in outputs]
    lefts = [[o.residual(fitted.rig)[rows] for o in outputs] for _, fitted in found]
    squares = [[float(np.mean(left**2)) for left in each] for each in lefts]
    if not found:
        return []
    best = min(range(len(found)), key=lambda i: float(np.sum(np.log(squares[i]))))
    counts = [0.5 * len(left) / memory(left) for left in lefts[best]]
    gains = [
        float(sum(n * np.log(b / a) for n, b, a in zip(counts, before, after, strict=True)))
        for after in squares
    ]
    ranked = [(gain, *pair) for gain, pair in zip(gains, found, strict=True)]
    return sorted(ranked, key=lambda item: -item[0])


def _screened(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    current: Fit,
    candidates: Sequence[Effect],
) -> list[Effect]:
    """Return the candidates whose signature takes most of the residual, by projection."""
    scores = []
    for effect in candidates:
        ours = touched(outputs, [effect])
        now = np.concatenate([o.residual(current.rig) for o in ours])
        best = 0.0
        for i in range(max(len(p.starts) for p in effect.parameters)):
            values = dict(current.values)
            for p in effect.free:
                values[f"{effect.name}.{p.name}"] = p.starts[min(i, len(p.starts) - 1)]
            rig = apply(nominal, control, (*current.effects, effect), values)
            sign = now - np.concatenate([o.residual(rig) for o in ours])
            size = float(sign @ sign)
            best = max(best, float(now @ sign) ** 2 / size if size > 0.0 else 0.0)
        scores.append((best, effect))
    scores.sort(key=lambda item: -item[0])
    return [effect for _, effect in scores[:SCREENED]]
