"""Choosing effects: each has to earn its place on stretches of the record not used to fit it.

Guilty stages are those whose residual stands clear of its floor. Their candidates are
screened by the projection of the residual on each effect's own signature, the best fitted
as physics on every other stretch, and judged on the stretches between. The gain is a
log-likelihood ratio by effective samples, the frames divided by the residual's memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from coupled.channels import ControlName
from coupled.gap.effects import EFFECTS, Effect, apply
from coupled.gap.fit import Fit, fit, shows_in, touched
from coupled.gap.output import Output, memory, stage_gaps
from coupled.rig.parameters import Rig

CLEAR = 1.2  # residual over floor from which a stage is guilty: nominal tolerances stay below
LEAST_GAIN = 8.0  # log-likelihood by which an effect must beat the rig without it
RIVAL = 4.0  # and by which the best must beat another to be the only answer
SCREENED = 6
LITTLE = 0.01  # floors squared: a tenth of the floor is no gap to close
# A pot is set, and a servo tuned, to a few per cent: less than this is no effect.
TOLERANCE = {"inertia": 0.03, "viscous_damping": 0.03, "servo_lag": 0.03}
MOST = 4  # effects in one answer
Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Candidate:
    """An effect fitted beside those found so far, and its gain on held-out stretches."""

    gain: float
    effect: Effect
    fit: Fit


@dataclass(frozen=True)
class Step:
    """One effect found: its gain, and the others that the record cannot tell from it."""

    effect: Effect
    gain: float
    probability: float
    rivals: tuple[Candidate, ...]


@dataclass(frozen=True)
class Choice:
    """What the search found: its steps, the final fit on all of the record, and what is left."""

    steps: tuple[Step, ...]
    fit: Fit
    tried: dict[str, float] = field(default_factory=dict)  # first round's gains by effect


def search(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    library: Sequence[Effect] = EFFECTS,
    tell: Tell | None = None,
) -> Choice:
    """Return the effects that explain a record's gap, each earning its place in turn."""
    current = fit(nominal, control, outputs, ())
    steps: list[Step] = []
    tried: dict[str, float] = {}
    while len(steps) < MOST:
        ranked = _round(nominal, control, outputs, current, library, tell)
        tried = tried or {candidate.effect.name: candidate.gain for candidate in ranked}
        if not ranked or ranked[0].gain < LEAST_GAIN:
            break
        best = _simplest(ranked)
        steps.append(_step(best, ranked))
        chosen = (*current.effects, best.effect)
        current = fit(nominal, control, outputs, chosen, start=best.fit.values)
    return Choice(tuple(steps), current, tried)


def _step(best: Candidate, ranked: Sequence[Candidate]) -> Step:
    """Return a found effect with its rivals; what holds it as a special case is none."""
    others = [
        other
        for other in ranked
        if other is not best and len(other.effect.free) <= len(best.effect.free)
    ]
    rivals = tuple(other for other in others if other.gain > best.gain - RIVAL)
    weights = sum(float(np.exp(min(other.gain - best.gain, 0.0))) for other in others)
    return Step(best.effect, best.gain, 1.0 / (1.0 + weights), rivals)


def _simplest(ranked: Sequence[Candidate]) -> Candidate:
    """Return the best candidate, or one with fewer numbers that is as good."""
    best = ranked[0]
    for other in ranked[1:]:
        fewer = len(other.effect.free) < len(best.effect.free)
        if fewer and other.gain > ranked[0].gain - RIVAL:
            best = other
    return best


def _round(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    current: Fit,
    library: Sequence[Effect],
    tell: Tell | None,
) -> list[Candidate]:
    """Return the candidates by their held-out gain over the current effects, best first."""
    guilty = {stage for stage, gap in stage_gaps(outputs, current.rig).items() if gap > CLEAR}
    candidates = [
        effect
        for effect in library
        if effect not in current.effects and guilty & set(shows_in(effect))
    ]
    found = []
    screened = _screened(nominal, control, outputs, current, candidates)
    for i, effect in enumerate(screened):
        if tell is not None:
            tell(f"fitting {effect.name}", i, len(screened))
        chosen = (*current.effects, effect)
        fitted = fit(nominal, control, outputs, chosen, "fitted", current.values)
        bound = any(key.startswith(effect.name) for key in fitted.at_bound)
        if not bound and not _within_tolerance(effect, fitted):
            found.append((effect, fitted))
    return _ranked(outputs, current, found)


def _within_tolerance(effect: Effect, fitted: Fit) -> bool:
    """Tell whether a nominal number moved by no more than its setting can be trusted to."""
    slack = TOLERANCE.get(effect.name)
    return slack is not None and abs(fitted.values[f"{effect.name}.factor"] - 1.0) < slack


def _ranked(
    outputs: Sequence[Output], current: Fit, found: Sequence[tuple[Effect, Fit]]
) -> list[Candidate]:
    """Return fitted candidates by the held-out log-likelihood that they gain, best first.

    A sample counts as the best candidate's residual lets it, the same for all: a worse one's
    longer memory is its own fault, and no reason to weigh its misfit less.
    """
    if not found:
        return []
    before = [float(np.mean(o.residual(current.rig, "held") ** 2)) + LITTLE for o in outputs]
    lefts = [[o.residual(fitted.rig, "held") for o in outputs] for _, fitted in found]
    squares = [[float(np.mean(left**2)) + LITTLE for left in each] for each in lefts]
    best = min(range(len(found)), key=lambda i: float(np.sum(np.log(squares[i]))))
    counts = [0.5 * len(left) / memory(left) for left in lefts[best]]
    ranked = []
    for (effect, fitted), after in zip(found, squares, strict=True):
        terms = zip(counts, before, after, strict=True)
        gain = float(sum(n * np.log(b / a) for n, b, a in terms))
        ranked.append(Candidate(gain, effect, fitted))
    return sorted(ranked, key=lambda candidate: -candidate.gain)


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
