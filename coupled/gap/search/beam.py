"""The search for the set of effects that explains a record: a beam over sets, by their evidence.

A set of effects is fitted together with the nuisance parameters, always on the whole record, and
has a log evidence (`evidence`). From each of the best sets the search goes to its neighbours:

    add       one effect more, of those whose signature takes most of the residual (`screen`)
    replace   a law by one that contains it, or that it contains
    swap      an effect for another that shows in the same output
    drop      one effect less

and goes on with the best, until every stage is explained, or no set is new. Each neighbour is
fitted from the same starts: its parent's optimum with the new parameters at a few sizes, with the
contact of dry friction sought on a grid, and, for a law of friction, where a fit to short replays
ends (multiple shooting). A few steps come first; starts that are far behind are given up.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, contains, distinct, keys_of, value_of
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.search.problem import EXACT, Problem
from coupled.gap.search.screen import Screen, Screened, Worth
from coupled.gap.signals.output import explained_below, stage_gaps, stage_limits
from coupled.gap.thresholds import (
    BEAM_BESIDE,
    BEAM_CANDIDATES,
    BEAM_DEPTH,
    BEAM_FIRST,
    BEAM_WIDTH,
    BEGUN_BEHIND,
    GIVEN_UP,
    PRIOR_EFFECT,
    RIVAL_GAIN,
    SHOOTINGS,
)
from coupled.parallel import in_threads

Floats = NDArray[np.float64]
Names = frozenset[str]
Start = dict[str, float]
Try = tuple[tuple[Effect, ...], Start, Fit]  # effects, where their fit starts, its parent
Begun = tuple[float, Fit, Fit]  # log evidence of a begun fit, and its parent
WIDE, OWN = Descent("wide"), Descent("own")
FIRST, SHORT = Descent("wide", BEAM_FIRST), Descent("wide", SHOOTINGS)
ABOVE = (1.05, 1.5)  # times the running friction, where the fit of a breakaway starts


def search_sets(case: Case, library: Sequence[Effect]) -> tuple[Case, Choice]:
    """Return the effects that explain a record's gap, and the case with its noise as known then.

    Noise is estimated with the rig file's parameters, where a gap may pass for coloured noise. It
    is estimated once more with the best set, and the search repeated where it is lower.
    """
    problem = Problem(case)
    root = problem.fit(())
    problem = problem.surely_open(problem.within_tolerance(root).rig)
    beam, rounds = _searched(problem, library, [root])
    case, anew = problem.case, problem.case.heard_anew(beam.fits[beam.best].rig)
    if anew is not None and beam.best:
        leading = [frozenset[str](), *(names for names in beam.leading() if names)]
        problem = Problem(anew)
        ends = [beam.fits[names] for names in leading]
        known = [problem.fit(one.effects, one.values, None, OWN) for one in ends]
        case, (beam, more) = anew, _searched(problem, library, known)
        rounds = (*rounds, *more)
    return case, _with_contact_named(beam, _choice(beam, rounds), library)


@dataclass
class Beam:
    """The sets fitted so far, by their effects' names, and what their evidence consists of.

    `counts` are the effective samples of each output, `contact` how dry friction yields by the fit
    that sought it last.
    """

    problem: Problem
    settled: Fit
    variance: Floats
    counts: Floats = field(default_factory=lambda: np.zeros(0))
    fits: dict[Names, Fit] = field(default_factory=dict)
    known: dict[Names, Evidence] = field(default_factory=dict)
    finished: set[Names] = field(default_factory=set)
    best: Names = frozenset()
    contact: Start = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Screen candidates by signatures that are taken once."""
        self.screen = Screen(self.problem, self.variance)

    def add(self, fitted: Fit) -> None:
        """Add a fit; of two of one set the one stays that may be true, or else the more likely."""
        names = names_of(fitted.effects)
        new = evidence(self.problem, fitted, self.variance)

        def rank(fit: Fit, known: Evidence) -> tuple[bool, float]:
            return may_be_true(self.problem, fit), known.log(self.counts)

        if names not in self.fits or rank(fitted, new) > rank(self.fits[names], self.known[names]):
            self.fits[names], self.known[names] = fitted, new

    def log(self, names: Names) -> float:
        """Return the log evidence of a set."""
        return self.known[names].log(self.counts)

    def valid(self) -> list[Names]:
        """Return the sets that may be true."""
        return [n for n, fitted in self.fits.items() if not n or may_be_true(self.problem, fitted)]

    def ranked(self) -> list[Names]:
        """Return the sets that may be true, the most likely first."""
        return sorted(self.valid(), key=self.log, reverse=True)

    def leading(self) -> list[Names]:
        """Return the most likely sets that are not far behind the best."""
        ranked = self.ranked()[:BEAM_WIDTH]
        return [names for names in ranked if self.log(names) > self.log(ranked[0]) - GIVEN_UP]

    def recount(self) -> None:
        """Count effective samples by what the sets leave, and find the best set by them."""
        self.counts = fewest_unexplained([self.known[names] for names in self.valid()])
        self.best = self.ranked()[0]

    def worth(self, names: Names) -> Worth:
        """Return the predicted gain with which one effect more may beat the best set, or none.

        It then brings what the effect's own prior costs, if the nuisance parameters' priors, which
        it may relieve, do not.
        """
        relief = sum(group.penalty for group in self.fits[names].groups.values())
        behind = self.log(self.best) - self.log(names) if names else 0.0
        return Worth(PRIOR_EFFECT + behind - relief, self.counts)

    def open_outputs(self, names: Names) -> set[str]:
        """Return the outputs that a set leaves wider than noise and the physics' own error."""
        case = self.problem.case
        first, limits = case.gaps(self.settled.rig), stage_limits(case.outputs)
        rig = self.fits[names].rig if names else self.settled.rig
        left = case.gaps(rig) if names == self.best else stage_gaps(case.outputs, rig)
        explained = {
            at: limit if at in EXACT else explained_below(first[at], limit)
            for at, limit in limits.items()
        }
        return {at for at, gap in left.items() if gap > explained[at]}


def names_of(effects: Iterable[Effect]) -> Names:
    """Return the names of a set's effects."""
    return frozenset(effect.name for effect in effects)


def may_be_true(problem: Problem, fitted: Fit) -> bool:
    """Tell whether each effect has a size, none at a bound nor faster than frames show."""
    fastest = 0.5 * min(output.frame_rate_Hz for output in problem.outputs)
    for effect in fitted.effects:
        if not _has_size(problem.case, fitted, effect):
            return False
        for p in effect.free:
            key = effect.value_key(p)
            if key in fitted.at_bound:
                return False
            if p.name == "frequency_Hz" and not p.folds and fitted.values[key] >= fastest:
                return False
    return True


def _has_size(case: Case, fitted: Fit, effect: Effect) -> bool:
    """Tell whether the 95 % interval of a size excludes the neutral value; a limit has one."""
    sizes = [p for p in effect.free if p.scanned]
    for p in sizes:
        key, none = effect.value_key(p), p.neutral(case.nominal, case.control)
        if p.inverse or not fitted.low[key] <= none <= fitted.high[key]:
            return True
    return not sizes


def _searched(
    problem: Problem, library: Sequence[Effect], known: Sequence[Fit]
) -> tuple[Beam, tuple[dict[str, float], ...]]:
    """Return the sets of a library's effects about the best, begun with known fits.

    The first of these is without effects. Returned, too, is what each depth gained (`_grow`).
    """
    settled, case = problem.within_tolerance(known[0]), problem.case
    beam = Beam(problem, settled, problem.variances(settled.rig))
    for fitted in known:
        beam.add(fitted)
    beam.recount()
    return beam, _grow(beam, distinct(library, case.contact) if case.contact else list(library))


def _grow(beam: Beam, library: Sequence[Effect]) -> tuple[dict[str, float], ...]:
    """Fit the neighbours of the best sets, depth by depth, until one explains every stage.

    Return the log evidence that each depth's sets gain, by the effect added. Discrete effects are
    tried without screening, since they have no size that could be too small: in outputs that are
    open, and in those whose laws are exact, where a high noise floor may hide them.
    """
    front, best, known = beam.leading(), beam.best, set(beam.fits)
    depths = list[tuple[Names, set[Names]]]()
    if not best:
        root, shown = beam.fits[best], {*EXACT, *beam.open_outputs(best)}
        discrete = [e for e in _beside((), library, shown) if not e.free]
        _fit_sets(beam, [((e,), dict(root.values), root) for e in discrete])
        front = list(dict.fromkeys([best, beam.best]))
    for _ in range(BEAM_DEPTH):
        if not front or (best and not beam.open_outputs(best)):
            break
        for names in front:
            if wide := beam.open_outputs(names):
                _expand(beam, beam.fits[names], library, wide)
        new = set(beam.fits) - known
        if not new:
            break
        _finish(beam)
        _shoot(beam)
        depths.append((front[0], new))
        if beam.best == best:
            break
        best, known = beam.best, set(beam.fits)
        front = [names for names in beam.leading() if names and names not in front]
    _look_around(beam, library)
    return tuple(
        {beam.fits[one].effects[-1].name: beam.log(one) - beam.log(base) for one in new}
        for base, new in depths
    )


def _look_around(beam: Beam, library: Sequence[Effect]) -> None:
    """Fit what the best set is without each effect, and with each law next to one of its own.

    A law that the best one contains is fitted from this one's nuisance parameters as well. A law of
    several parameters may be equivalent to two effects of fewer: these are fitted, too.
    """
    while beam.best:
        best, fitted = beam.best, beam.fits[beam.best]
        fewer = [one for one in _without(fitted) if names_of(one[0]) not in beam.fits]
        _fit_sets(beam, [*fewer, *_laws(beam, fitted, library)])
        for law in fitted.effects:
            if (part := _part_of(beam, law)) is not None:
                beside = _beside(part.effects, library, {*law.shows_in})
                worth = Worth(PRIOR_EFFECT, beam.counts)
                screened = beam.screen.best(part, beside, worth, BEAM_BESIDE)
                _fit_sets(beam, [t for one in screened for t in _tries(part, one, beam.contact)])
        _finish(beam)
        _restart_as_simple(beam)
        if beam.best == best:
            return


def _restart_as_simple(beam: Beam) -> None:
    """Fit sets with dry friction that are as simple as the best from other nuisance parameters.

    With dry friction the cost has local minima. One of a set with no more parameters must not
    decide for the best set. Fits start from the nuisance parameters as filed, and from the best
    set's.
    """
    problem, best = beam.problem, beam.fits[beam.best]
    numbers = _numbers(best)
    leading = [beam.fits[names] for names in beam.leading() if names and names != beam.best]
    simpler = [f for f in leading if _numbers(f) <= numbers and any(e.dry for e in f.effects)]

    of_best = {key for effect in best.effects for key in map(effect.value_key, effect.free)}
    shared = {key: value for key, value in best.values.items() if key not in of_best}

    def again(fitted: Fit) -> list[Fit]:
        own = {k: v for k, v in fitted.values.items() if k not in problem.priors}
        starts = (problem.case.neutral | own, {**fitted.values, **shared})
        return [problem.fit(fitted.effects, start) for start in starts]

    for fitted in (one for fits in in_threads(again, simpler) for one in fits):
        beam.add(fitted)
    beam.recount()


def _numbers(fitted: Fit) -> int:
    """Return how many parameters a set's effects have."""
    return sum(len(effect.free) for effect in fitted.effects)


def _part_of(beam: Beam, law: Effect) -> Fit | None:
    """Return the best fit with an effect of fewer parameters in place of a law of the best set.

    Both show in the same output. None where there is none, or its neighbours were fitted.
    """
    rest = beam.best - {law.name}
    for names in beam.ranked():
        if len(names) == len(beam.best) and rest < names:
            (other,) = (one for one in beam.fits[names].effects if one.name not in rest)
            if len(other.free) < len(law.free) and {*other.shows_in} & {*law.shows_in}:
                grown = any(names < more for more in beam.fits)
                return None if grown else beam.fits[names]
    return None


def _expand(beam: Beam, fitted: Fit, library: Sequence[Effect], wide: set[str]) -> None:
    """Fit the sets next to a fitted one.

    A law that contains another is fitted after it, from where that one ended, and a law of dry
    friction with the contact of one that was fitted before. Effects are screened by what is left
    with nuisance parameters within their tolerance: beyond it, these may have taken an effect up.
    """
    is_best, fitted = names_of(fitted.effects) == beam.best, beam.problem.within_tolerance(fitted)
    many = BEAM_CANDIDATES if is_best else BEAM_BESIDE
    beside, worth = _beside(fitted.effects, library, wide), beam.worth(names_of(fitted.effects))
    screened = beam.screen.best(fitted, beside, worth, many, anew=is_best)
    if not screened and is_best and (pair := beam.screen.pair(fitted, beside, worth)):
        _fit_sets(beam, _both(fitted, *pair))
    effects = [one.effect for one in screened]
    plain = [one for one in screened if not any(contains(one.effect, e) for e in effects)]
    dry = next((one for one in plain if one.effect.dry), None)
    if dry is not None and not beam.contact:
        ends = _fit_sets(beam, _tries(fitted, dry, {}))
        beam.contact = _contact(beam, ends[0]) if ends else {}
    ends = _fit_sets(beam, [t for one in plain for t in _tries(fitted, one, beam.contact)])
    wider = [one for one in screened if one not in plain]
    others = [t for one in wider for t in _tries(fitted, one, beam.contact)]
    for end in ends:
        others += [t for one in wider for t in _in_place(beam, end, end.effects[-1], one.effect)]
    others += _laws(beam, fitted, library)
    if len(fitted.effects) > 1:
        others += [*_swaps(beam, fitted, library), *_without(fitted)]
    _fit_sets(beam, others)


def _shoot(beam: Beam) -> None:
    """Fit the sets with dry friction from where fits to short replays end, if the best is open."""
    short, best = beam.problem.by_shots, beam.fits[beam.best]
    if short is None or "loader" not in beam.problem.over_limit(best.rig):
        return
    most = beam.log(beam.best)
    dry = [
        fit
        for names, fit in beam.fits.items()
        if any(e.dry for e in fit.effects)
        and len(names) == len(beam.best)
        and beam.log(names) > most - GIVEN_UP
    ]

    def shot(fitted: Fit) -> Start:
        ours = {effect.value_key(p) for effect in fitted.effects for p in effect.free}
        begun = {key: value for key, value in fitted.values.items() if key in ours}
        return dict(short.fit(fitted.effects, begun, None, SHORT).values)

    starts = in_threads(shot, dry)
    _fit_sets(beam, [(f.effects, start, f) for f, start in zip(dry, starts, strict=True)])
    _finish(beam)


def _beside(
    effects: Sequence[Effect], library: Sequence[Effect], outputs: set[str]
) -> list[Effect]:
    """Return the effects that show in some outputs, and share no number with those of a set."""
    taken = keys_of(effects)
    return [
        one for one in library if outputs & {*one.shows_in} and taken.isdisjoint(keys_of([one]))
    ]


def _tries(fitted: Fit, one: Screened, contact: Mapping[str, float]) -> list[Try]:
    """Return the starts of a set with one effect more; `contact` is that of its dry friction."""
    effects = (*fitted.effects, one.effect)
    beside = contact if one.effect.dry else {}
    return [(effects, {**beside, **fitted.values, **start}, fitted) for start in one.starts]


def _both(fitted: Fit, one: Screened, other: Screened) -> list[Try]:
    """Return the starts of a set with two effects more; none where these share a number."""
    if keys_of([one.effect]) & keys_of([other.effect]):
        return []
    effects = (*fitted.effects, one.effect, other.effect)
    pairs = product(one.starts, other.starts)
    return [(effects, {**fitted.values, **first, **second}, fitted) for first, second in pairs]


def _contact(beam: Beam, fitted: Fit) -> Start:
    """Return the contact of dry friction in a fit, as far as it is a nuisance parameter."""
    keys = {one.value_key(p) for one in beam.problem.case.contact for p in one.free}
    return {key: value for key, value in fitted.values.items() if key in keys}


def _swaps(beam: Beam, fitted: Fit, library: Sequence[Effect]) -> list[Try]:
    """Return the sets with another effect, that shows in the same output, in place of one."""
    tries: list[Try] = []
    for old in fitted.effects:
        rest = tuple(effect for effect in fitted.effects if effect is not old)
        rig = beam.problem.rig_of(rest, fitted.values)
        same = [e for e in _beside(rest, library, {*old.shows_in}) if e is not old]
        if rig is not None:
            base = replace(fitted, effects=rest, rig=rig)
            found = beam.screen.best(base, same, beam.worth(beam.best), BEAM_BESIDE)
            tries += [t for one in found for t in _tries(base, one, beam.contact)[:1]]
    return tries


def _without(fitted: Fit) -> list[Try]:
    """Return the sets with one effect less."""
    return [
        (tuple(e for e in fitted.effects if e is not old), dict(fitted.values), fitted)
        for old in fitted.effects
    ]


def _laws(beam: Beam, fitted: Fit, library: Sequence[Effect]) -> list[Try]:
    """Return the sets with a law in place of one that it contains, or that contains it."""
    pairs = [(old, law) for old in fitted.effects for law in library]
    return [one for old, law in pairs for one in _in_place(beam, fitted, old, law)]


def _in_place(beam: Beam, fitted: Fit, old: Effect, law: Effect) -> list[Try]:
    """Return where fits of a law in place of a fitted one start.

    Their common numbers start as fitted. None where neither law contains the other.
    """
    rest = tuple(effect for effect in fitted.effects if effect is not old)
    wider = contains(law, old)
    if not (wider or contains(old, law)) or keys_of(rest) & keys_of([law]):
        return []
    case, known = beam.problem.case, beam.fits.get(names_of((*rest, law)))
    ours = {law.value_key(p) for p in law.free}
    found = {} if known is None else {k: v for k, v in known.values.items() if k in ours}
    start, higher = {**found, **fitted.values}, Start()
    for p in law.free if not found else ():
        same = next((q for q in old.free if q.key == p.key and q.mode == p.mode), None)
        level = next((q for q in old.free if q.key == p.above), None)
        if same is not None:
            start[law.value_key(p)] = fitted.values[old.value_key(same)]
        elif level is not None:
            filed = level.nominal(case.nominal, case.control)
            running = float(level.entered(filed, fitted.values[old.value_key(level)]))
            start[law.value_key(p)] = ABOVE[0] * running
            higher[law.value_key(p)] = ABOVE[1] * running
    effects = (*rest, law)
    return [(effects, start, fitted), *([(effects, start | higher, fitted)] if higher else [])]


def _fit_sets(beam: Beam, tries: Sequence[Try]) -> list[Fit]:
    """Fit sets from their starts, a few steps first, and on where that may matter; add them.

    Return the best fit of each set. The second best start of a set goes on only where the best one
    leaves an output over its limit.
    """
    problem = beam.problem
    unique: dict[tuple[Names, tuple[tuple[str, float], ...]], Try] = {}
    for effects, start, parent in tries:
        near = tuple(sorted((key, float(f"{value:.6g}")) for key, value in start.items()))
        unique.setdefault((names_of(effects), near), (effects, start, parent))
    if not unique:
        return []

    def begin(one: Try) -> Begun:
        effects, start, parent = one
        fit = problem.fit(effects, start, parent, FIRST)
        return evidence(problem, fit, beam.variance).log(beam.counts), fit, parent

    begun = sorted(in_threads(begin, list(unique.values())), key=lambda one: -one[0])
    most = max(begun[0][0], beam.log(beam.best))
    going = [one for one in begun if one[0] > most - BEGUN_BEHIND]
    first: dict[Names, Begun] = {}
    for one in going:
        first.setdefault(names_of(one[1].effects), one)
    _go_on(beam, list(first.values()))

    def may_be_better(one: Begun) -> bool:
        names = names_of(one[1].effects)
        if one is first[names]:
            return False
        if not may_be_true(problem, beam.fits[names]):
            return True
        if one[0] < first[names][0] - GIVEN_UP:
            return False
        shown = {stage for effect in one[1].effects[-1:] for stage in effect.shows_in}
        return bool(problem.over_limit(beam.fits[names].rig) & shown)

    _go_on(beam, [one for one in going if may_be_better(one)])
    return [beam.fits[names] for names in first]


def _go_on(beam: Beam, begun: Sequence[Begun]) -> None:
    """Fit begun sets to the end by wide steps of the loader, and add them."""
    problem = beam.problem
    if problem.case.tell is not None and begun:
        problem.case.tell(f"fitting {len(begun)} sets of effects", 0, 1)

    def go_on(one: Begun) -> Fit:
        _, fit, parent = one
        return problem.fit(fit.effects, fit.values, parent, WIDE, fit)

    for fit in in_threads(go_on, begun):
        beam.add(fit)
        names = names_of(fit.effects)
        if beam.fits[names] is fit:
            beam.finished.discard(names)
    beam.recount()


def _finish(beam: Beam) -> None:
    """Fit the leading sets by the loader's own steps."""
    problem = beam.problem
    ranked = [names for names in beam.leading() if names and names not in beam.finished]

    def finish(names: Names) -> list[Fit]:
        fitted = beam.fits[names]
        done = problem.fit(fitted.effects, fitted.values, None, OWN, fitted)
        anew = problem.case.but_for_contact(done.values)
        known = names != beam.best or anew == dict(done.values)
        if known or "loader" not in problem.over_limit(done.rig):
            return [done]
        return [done, problem.fit(fitted.effects, anew)]

    for names, fits in zip(ranked, in_threads(finish, ranked), strict=True):
        beam.finished.add(names)
        # A fit by wide steps is to another residual: it does not compete.
        del beam.fits[names], beam.known[names]
        for fit in fits:
            beam.add(fit)
    beam.recount()


def _choice(beam: Beam, rounds: tuple[dict[str, float], ...]) -> Choice:
    """Return the best set with each effect's posterior probability, and what may take its place.

    The probability of an effect is that of the sets that contain it, or a law that contains it.
    """
    ranked, best = beam.ranked(), beam.best
    fitted = beam.fits[best]
    logs = np.array([beam.log(names) for names in ranked])
    weights = np.exp(logs - logs[0])
    weights /= weights.sum()
    steps = []
    for effect in fitted.effects:
        held = [
            any(one is effect or contains(one, effect) for one in beam.fits[names].effects)
            for names in ranked
        ]
        rest = best - {effect.name}
        gain = float(logs[0]) - beam.log(rest if rest in beam.known else frozenset())
        rivals = tuple(
            Candidate(gain - (float(logs[0]) - beam.log(names)), other, beam.fits[names])
            for names in ranked
            if beam.log(names) > logs[0] - RIVAL_GAIN and _in_its_place(best, names, effect)
            for other in beam.fits[names].effects
            if other.name in names - best and not contains(other, effect)
        )
        steps.append(Found(effect, gain, float(weights[held].sum()), rivals))
    base = beam.log(frozenset())
    tried = {next(iter(names)): beam.log(names) - base for names in beam.fits if len(names) == 1}
    steps.sort(key=lambda step: -step.gain)
    return Choice(tuple(steps), fitted, beam.settled, tried, rounds, float(weights[0]))


def _in_its_place(best: Names, other: Names, effect: Effect) -> bool:
    """Tell whether another set has other effects in place of this one of the best set.

    One takes the place of one, two of one, or one of two.
    """
    gone, new = best - other, other - best
    return effect.name in gone and len(new) >= 1 and min(len(gone), len(new)) == 1


def _with_contact_named(beam: Beam, choice: Choice, library: Sequence[Effect]) -> Choice:
    """Return a choice with the law whose parameters include how the dry friction found yields.

    How friction yields is a nuisance parameter in the search (`distinct`). Where the rig file has
    no friction, and the 95 % interval of its length excludes that of a rigid contact, the law with
    these parameters is named.
    """
    problem, fitted = beam.problem, choice.fit
    case = problem.case
    if not case.contact or is_dry(case.nominal, case.control):
        return choice
    length = case.contact[0].value_key(case.contact[0].free[0])
    kept = distinct(library, case.contact)
    for step in choice.steps:
        law = next((e for e in library if e not in kept and contains(e, step.effect)), None)
        if law is None or fitted.low.get(length, 0.0) <= 0.0:
            continue
        numbers = {p: value_of(fitted.rig, case.control, p.key) for p in law.free}
        start = {law.value_key(p): float(value) for p, value in numbers.items()}
        effects = tuple(law if one is step.effect else one for one in fitted.effects)
        named = problem.fit(effects, {**fitted.values, **start}, None, OWN)
        if may_be_true(problem, named):
            steps = [replace(s, effect=law) if s is step else s for s in choice.steps]
            return replace(choice, steps=tuple(steps), fit=named)
    return choice
