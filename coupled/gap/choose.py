"""Choosing effects: each has to earn its place on stretches of the record not used to fit it.

Guilty stages are those whose residual stands clear of its floor. Their candidates are
screened by the projection of the residual on each effect's own signature, the best fitted
as physics on every other stretch, and judged on the stretches between. The gain is a
log-likelihood ratio by effective samples, the frames divided by the residual's memory.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from coupled.gap.case import Case, Tell
from coupled.gap.effects import BY_NAME, EFFECTS, SETTINGS, TOLERANCE, Effect, apply
from coupled.gap.fit import Fit, shows_in
from coupled.gap.output import Output, memory, stage_gaps, stage_limits
from coupled.gap.screen import screen
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

LEAST_GAIN = 8.0  # log-likelihood by which an effect must beat the rig without it
RIVAL = 4.0  # and by which the best must beat another to be the only answer
LITTLE = 0.01  # floors squared: a tenth of the floor is no gap to close
MISMATCH = 0.03  # share of a gap that the physics of a right effect may leave
# By which, or by which share of the gain, more numbers must win where fewer close the gap.
SIMPLER, SIMPLER_SHARE = 6.0, 0.05
FAINT, LAW = 2.0, 12.0  # a gap under which the law of dry friction has to be told by such a gain
DRY = COULOMB, STRIBECK = BY_NAME["coulomb_friction"], BY_NAME["stribeck_friction"]
SLOW = 2e-3  # d/s over which a breakaway fades, where none is known
SPARE = 4.0  # an effect that others have made needless: it would be missed by less
MOST = 4  # effects in one answer


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
    """What the search found: its steps, and the final fit on all of the record.

    `settled` has the nominal rig's settings moved within their tolerance, and no effect.
    """

    steps: tuple[Step, ...]
    fit: Fit
    settled: Fit
    tried: dict[str, float] = field(default_factory=dict)  # first round's gains by effect
    rounds: tuple[dict[str, float], ...] = ()  # every round's, the last one's won by none


def search(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    library: Sequence[Effect] = EFFECTS,
    tell: Tell | None = None,
    refloored: Callable[[Rig], Sequence[Output]] | None = None,
) -> Choice:
    """Return the effects that explain a record's gap, each earning its place in turn."""
    case = Case(nominal, control, outputs, tell, refloored)
    settled = current = case.fit(())
    steps: list[Step] = []
    rounds: list[dict[str, float]] = []
    while len(steps) < MOST:
        ranked = _round(case, settled, current, library)
        rounds.append({candidate.effect.name: candidate.gain for candidate in ranked})
        if not ranked or ranked[0].gain < LEAST_GAIN:
            break
        best = _simplest(case, settled, ranked)
        steps.append(_step(case, settled, best, ranked))
        current = case.fit((*current.effects, best.effect), start=best.fit.values)
        needless = _needless(case, current)
        if needless is not None:
            steps = [step for step in steps if step.effect is not needless]
            rest = tuple(effect for effect in current.effects if effect is not needless)
            current = case.fit(rest, start=current.values)
            if needless is best.effect:
                break
    if len(steps) > 1:
        steps = [_again(case, settled, current, step) for step in steps]
    tried = next((gains for gains in rounds if gains), {})
    return Choice(tuple(steps), current, settled, tried, tuple(rounds))


def _again(case: Case, settled: Fit, current: Fit, step: Step) -> Step:
    """Return a step whose rivals are tried again, now that the other effects are known."""
    if not step.rivals:
        return step
    rest = tuple(effect for effect in current.effects if effect is not step.effect)
    without = case.fit(rest, "fitted", current.values)
    tries = [step.effect, *(rival.effect for rival in step.rivals)]
    found = [
        (effect, case.fit((*rest, effect), "fitted", current.values))
        for effect in tries
        if effect not in rest
    ]
    ranked = ranked_by_gain(case.outputs, without, found)
    own = next(candidate for candidate in ranked if candidate.effect is step.effect)
    return _step(case, settled, own, ranked)


def _needless(case: Case, current: Fit) -> Effect | None:
    """Return the effect found earlier that those found since have made needless, if any."""
    if len(current.effects) < 2:
        return None
    whole = case.fit(current.effects, "fitted", current.values)
    spare: tuple[float, Effect] | None = None
    for effect in current.effects[:-1]:
        rest = tuple(other for other in current.effects if other is not effect)
        without = case.fit(rest, "fitted", current.values)
        missed = ranked_by_gain(case.outputs, without, [(effect, whole)])[0].gain
        if missed < SPARE and (spare is None or missed < spare[0]):
            spare = (missed, effect)
    return None if spare is None else spare[1]


def _step(case: Case, settled: Fit, best: Candidate, ranked: Sequence[Candidate]) -> Step:
    """Return a found effect with its rivals; what holds it as a special case is none.

    Unless the gap is faint: there one law of dry friction passes for another.
    """
    others = [
        other
        for other in ranked
        if other is not best and len(other.effect.free) <= len(best.effect.free)
    ]
    rivals = [other for other in others if other.gain > best.gain - RIVAL]
    gaps = stage_gaps(case.outputs, settled.rig)
    if best.effect in DRY and all(gaps.get(at, 0.0) < FAINT for at in shows_in(best.effect)):
        rivals = [other for other in rivals if other.effect not in DRY]
        rivals += _other_laws(case, best, ranked)
    weights = sum(float(np.exp(min(other.gain - best.gain, 0.0))) for other in others)
    return Step(best.effect, best.gain, 1.0 / (1.0 + weights), tuple(rivals))


def _other_laws(case: Case, best: Candidate, ranked: Sequence[Candidate]) -> list[Candidate]:
    """Return the other law of dry friction, if a faint gap leaves it open.

    A breakaway of twice the running friction hardly shows there, and is never excluded.
    """
    if best.effect is STRIBECK:
        return [one for one in ranked if one.effect is COULOMB and one.gain > best.gain - LAW]
    friction = best.fit.values["coulomb_friction.friction_N"]
    breakaway = 2.0 * friction + case.nominal.controls[case.control].loader.friction
    told = {"friction_N": friction, "breakaway_N": breakaway, "stribeck_{d}_per_s": SLOW}
    values = {f"{STRIBECK.name}.{name}": value for name, value in told.items()}
    effects = (*(e for e in best.fit.effects if e is not COULOMB), STRIBECK)
    known = {**best.fit.values, **values}
    rig = apply(case.nominal, case.control, (*effects, *case.nuisances(effects)), known)
    return [
        Candidate(best.gain, STRIBECK, replace(best.fit, effects=effects, values=known, rig=rig))
    ]


def _simplest(case: Case, settled: Fit, ranked: Sequence[Candidate]) -> Candidate:
    """Return the best candidate, or one with fewer numbers that is as good.

    Where the one with fewer closes a gap of the loader, the other must beat it by more than the
    physics of a right effect may leave: no law of dry friction is exact.
    """
    best = ranked[0]
    first, limits = stage_gaps(case.outputs, settled.rig), stage_limits(case.outputs)
    for other in ranked[1:]:
        if len(other.effect.free) >= len(best.effect.free):
            continue
        left = stage_gaps(case.outputs, other.fit.rig)
        closes = all(
            left[stage] <= bar(first[stage], limits[stage])
            for stage in shows_in(other.effect)
            if stage in left
        )
        doubtful = closes and best.effect.stage == "loader"
        margin = max(SIMPLER, SIMPLER_SHARE * ranked[0].gain) if doubtful else RIVAL
        if other.gain > ranked[0].gain - margin:
            best = other
    return best


def bar(before: float, limit: float) -> float:
    """Return the gap up to which a stage is explained, by its gap without any effect.

    `limit` is the gap up to which noise may be all there is.
    """
    return max(limit, 1.0 + MISMATCH * (before - 1.0))


def _round(case: Case, settled: Fit, current: Fit, library: Sequence[Effect]) -> list[Candidate]:
    """Return the candidates by their held-out gain over the current effects, best first."""
    first = stage_gaps(case.outputs, settled.rig)
    now = case.gaps(current.rig) if current.effects else first
    limits = stage_limits(case.outputs)
    guilty = {stage for stage, gap in now.items() if gap > bar(first[stage], limits[stage])}
    among = guilty or _strained(current)
    candidates = [
        effect
        for effect in library
        if effect not in current.effects and among & set(shows_in(effect))
    ]
    found = []
    screened = screen(case, current, candidates)
    for i, (effect, starts) in enumerate(screened):
        if case.tell is not None:
            case.tell(f"fitting {effect.name}", i, len(screened))
        chosen = (*current.effects, effect)
        tries = [
            case.fit(chosen, "fitted", {**current.values, **start}, effect) for start in starts
        ]
        fitted = min(tries, key=lambda one: one.cost)
        bound = any(key.startswith(effect.name) for key in fitted.at_bound)
        if not bound and not _within_tolerance(effect, fitted):
            found.append((effect, fitted))
    ranked = ranked_by_gain(case.outputs, current, found)
    return ranked if guilty or _surely_beyond(ranked) else []


def _within_tolerance(effect: Effect, fitted: Fit) -> bool:
    """Tell whether a nominal number moved by no more than its setting can be trusted to."""
    slack = TOLERANCE.get(effect.name)
    return slack is not None and abs(fitted.values[f"{effect.name}.factor"] - 1.0) < slack


def _strained(current: Fit) -> set[str]:
    """Return the stages of which a setting stands at the end of its tolerance.

    It may then keep a stage within its limit that is off by more.
    """
    settings = SETTINGS.values()
    return {one.stage for one in settings if f"{one.name}.factor" in current.at_bound}


def _surely_beyond(ranked: Sequence[Candidate]) -> bool:
    """Tell whether the best candidate is a number off by more than its setting, and nothing else.

    In a stage within its limit no other effect is claimed.
    """
    if not ranked or ranked[0].effect.name not in SETTINGS:
        return False
    best, key = ranked[0], f"{ranked[0].effect.name}.factor"
    slack = TOLERANCE[best.effect.name]
    beyond = best.fit.low[key] > 1.0 + slack or best.fit.high[key] < 1.0 - slack
    return beyond and all(other.gain < best.gain - RIVAL for other in ranked[1:])


def ranked_by_gain(
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
