"""The search for the set of effects that explains a record: a beam search by log evidence.

A set of effects is fitted together with the nuisance parameters, always on the whole record, and
has a log evidence (`evidence`). At each depth the neighbours of the best sets are fitted:

    add       one effect more, chosen by the predicted gain of its signature (`screen`)
    replace   a law by a law that contains it, or that it contains
    swap      an effect for another effect of the same output
    drop      one effect less

The search ends when every stage is within its noise or no set is new. A fit of a neighbour starts
from its parent's optimum, with the new parameters at a few sizes. The presliding parameters of dry
friction start from a grid search; laws of friction are also started from a fit by multiple
shooting. All starts are fitted for a few evaluations, and those far behind the best are dropped.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, contains, distinct, keys_of, value_of
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained, misfit
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.search.problem import ModelError, Problem
from coupled.gap.search.screen import Screen, Screened, Worth
from coupled.gap.signals.output import stage_limits
from coupled.gap.thresholds import (
    BEAM_CANDIDATES,
    BEAM_DEPTH,
    BEAM_WIDTH,
    GIVEN_UP,
    MINOR,
    MOST,
    PRIOR_EFFECT,
    RIVAL_GAIN,
    SHOOTINGS,
    TRIES,
    VERY_STRONG,
)
from coupled.parallel import in_threads

Floats = NDArray[np.float64]
Names = frozenset[str]
Start = dict[str, float]
Try = tuple[tuple[Effect, ...], Start, Fit]  # effects, start values, parent
Started = tuple[float, Fit, Fit]  # log evidence, unfinished fit, parent
COARSE, OWN = Descent("coarse"), Descent("own")
FIRST, SHORT = Descent("coarse", TRIES), Descent("coarse", SHOOTINGS)


def search_sets(case: Case, library: Sequence[Effect]) -> tuple[Case, Choice]:
    """Return the effects that explain a record's gap, and the case with its final noise floors.

    Noise is first estimated with the rig file's parameters, so that part of the gap may count as
    coloured noise. It is estimated again with the best set. If it is lower, the search is repeated.
    """
    problem = Problem(case)
    root = problem.fit(())
    problem = problem.without_colour_allowance(problem.within_tolerance(root).rig)
    beam, rounds = _search_from(problem, library, [root])
    case, anew = problem.case, problem.case.with_lower_noise(beam.fits[beam.best].rig)
    if anew is not None and beam.best:
        leading = [frozenset[str](), *(names for names in beam.leading() if names)]
        problem = Problem(anew)
        ends = [beam.fits[names] for names in leading]
        known = [problem.fit(one.effects, one.values, None, OWN) for one in ends]
        case, (beam, more) = anew, _search_from(problem, library, known)
        rounds = (*rounds, *more)
    return case, _name_law_with_contact(beam, _choose(beam, rounds), library)


@dataclass
class Beam:
    """The sets fitted so far, by their effects' names, and the terms of their evidence.

    `without_effects` is the fit of the nuisance parameters alone, within their tolerance.
    `error` is the model error of each output, `counts` its residual's effective samples.
    `finished` are the sets fitted at the loader's own steps. `contact` holds the presliding
    parameters of dry friction from the last fit that estimated them.
    """

    problem: Problem
    without_effects: Fit
    error: ModelError
    counts: Floats = field(default_factory=lambda: np.zeros(0))
    fits: dict[Names, Fit] = field(default_factory=dict)
    known: dict[Names, Evidence] = field(default_factory=dict)
    finished: set[Names] = field(default_factory=set)
    best: Names = frozenset()
    contact: Start = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Make the screen of candidates, which caches their signatures."""
        self.screen = Screen(self.problem, self.error)

    def add(self, fitted: Fit) -> bool:
        """Add a fit, unless its set has an admissible or likelier one; return if it is added."""
        names = names_of(fitted.effects)
        new = evidence(self.problem, fitted, self.error)

        def rank(fit: Fit, known: Evidence) -> tuple[bool, float]:
            return is_admissible(self.problem, fit), known.log(self.counts)

        kept = names not in self.fits or rank(fitted, new) > rank(
            self.fits[names], self.known[names]
        )
        if kept:
            self.fits[names], self.known[names] = fitted, new
        return kept

    def log(self, names: Names) -> float:
        """Return the log evidence of a set."""
        return self.known[names].log(self.counts)

    def valid(self) -> list[Names]:
        """Return the admissible sets (`is_admissible`), those of fewest parameters first.

        If no admissible set has more evidence than no effect, sets are admissible although the
        interval of a size contains the neutral value, if they have.
        """
        valid = list[Names]()
        for names in sorted(self.fits, key=lambda one: _numbers(self.fits[one])):
            fitted = self.fits[names]
            if self._has_an_effect_within_noise(fitted):
                continue
            if not names or is_admissible(self.problem, fitted, self._needed(fitted, valid)):
                valid.append(names)
        if not len(self.counts):
            return valid
        gained = [n for n in self.fits if n and self.log(n) > self.log(frozenset())]
        if not any(names in gained for names in valid):
            valid += [n for n in gained if is_admissible(self.problem, self.fits[n], n)]
        return valid

    def _needed(self, fitted: Fit, valid: Sequence[Names]) -> Names:
        """Return the effects of a set that no simpler admissible set can do without.

        With dry friction the residual is discontinuous, and an interval by slopes may contain the
        neutral value of such an effect. The evidence must then be very much higher than that of
        each set of fewer parameters without the effect, and without a law that contains it.
        """
        if not len(self.counts):
            return frozenset()
        numbers, here = _numbers(fitted), self.log(names_of(fitted.effects))
        simpler = [n for n in valid if _numbers(self.fits[n]) < numbers]

        def is_needed(effect: Effect) -> bool:
            without = (
                self.log(names)
                for names in simpler
                if not any(e is effect or contains(e, effect) for e in self.fits[names].effects)
            )
            return here - max(without, default=here) > VERY_STRONG

        return frozenset(effect.name for effect in fitted.effects if is_needed(effect))

    def _has_an_effect_within_noise(self, fitted: Fit) -> bool:
        """Tell whether a library effect improves only outputs within their noise.

        Noise that is not quite as modelled is explained by some effect (`_choose`). In the outputs
        that are over their limits without the effect, it gains less than its prior penalty. Of one
        effect alone, some output must be over its limit: else the answer is none (`_choose`).
        """
        names = names_of(fitted.effects)
        if not names or not len(self.counts):
            return False
        problem, variance = self.problem, self.error.variance
        smooth = self.error.smooth(self.counts)
        here = misfit(self.known[names].squares, smooth)

        def is_within_noise(effect: Effect) -> bool:
            rest = names - {effect.name}
            if effect.of or rest not in self.known:
                return False
            gaps = np.sqrt(self.known[rest].squares * variance)
            if relief_of(self.fits[rest]) > PRIOR_EFFECT:  # it may have absorbed the effect
                rig = problem.within_tolerance(self.fits[rest]).rig
                gaps = np.array([output.gap(rig) for output in problem.outputs])
            over = gaps > np.array([output.limit for output in problem.outputs])
            if not rest and not over.any():
                return False
            gains = 0.5 * self.counts * (misfit(gaps**2 / variance, smooth) - here)
            return float(gains[over].sum()) < PRIOR_EFFECT

        return any(map(is_within_noise, fitted.effects))

    def ranked(self) -> list[Names]:
        """Return the admissible sets, the one of highest evidence first."""
        return sorted(self.valid(), key=self.log, reverse=True)

    def leading(self) -> list[Names]:
        """Return the best admissible sets, without those far behind the first."""
        ranked = self.ranked()[:BEAM_WIDTH]
        return [names for names in ranked if self.log(names) > self.log(ranked[0]) - GIVEN_UP]

    def recount(self) -> None:
        """Update the effective samples from the sets' residuals, and the best set."""
        self.counts = fewest_unexplained([self.known[names] for names in self.valid()])
        self.best = self.ranked()[0]

    def worth(self, fitted: Fit, share: float = 1.0) -> Worth:
        """Return the predicted gain that one effect more needs to make a set the best one.

        It must exceed the log prior of an effect and a `share` of the evidence by which the set is
        behind the best one: a prediction may show half of a gain.
        """
        return Worth(PRIOR_EFFECT + share * self.behind(fitted), self.counts)

    def log_of(self, fitted: Fit) -> float:
        """Return the log evidence of a fit, possibly not of this beam."""
        return evidence(self.problem, fitted, self.error).log(self.counts)

    def behind(self, fitted: Fit) -> float:
        """Return the log evidence by which a fit, possibly not of this beam, is behind the best."""
        return max(self.log(self.best) - self.log_of(fitted), 0.0)

    def open_outputs(self, names: Names) -> set[str]:
        """Return the outputs whose residual exceeds the noise with a set.

        If the prior penalty of its nuisance parameters would pay for an effect, these may have
        absorbed one: the residual is then that within their tolerance.
        """
        problem, fitted = self.problem, self.fits[names]
        if relief_of(fitted) > PRIOR_EFFECT:
            return problem.over_limit(problem.within_tolerance(fitted).rig)
        if names != self.best:
            return problem.over_limit(fitted.rig)
        limits = stage_limits(problem.outputs)
        return {at for at, gap in problem.case.gaps(fitted.rig).items() if gap > limits[at]}


def relief_of(fitted: Fit) -> float:
    """Return the prior penalty of a fit's nuisance parameters, which another effect may remove."""
    return sum(group.penalty for group in fitted.groups.values())


def names_of(effects: Iterable[Effect]) -> Names:
    """Return the names of a set's effects."""
    return frozenset(effect.name for effect in effects)


def is_admissible(problem: Problem, fitted: Fit, needed: Names = frozenset()) -> bool:
    """Tell whether a fit is admissible.

    The interval of each effect's size, unless the effect is `needed`, excludes the neutral value;
    no parameter is at a bound, and no frequency may be above the Nyquist frequency.
    """
    fastest = 0.5 * min(output.frame_rate_Hz for output in problem.outputs)
    for effect in fitted.effects:
        if effect.name not in needed and not _excludes_neutral(problem.case, fitted, effect):
            return False
        for p in effect.free:
            key = effect.value_key(p)
            if key in fitted.at_bound:
                return False
            if p.name == "frequency_Hz" and p.kind != "aliased" and fitted.high[key] >= fastest:
                return False
    return True


def _excludes_neutral(case: Case, fitted: Fit, effect: Effect) -> bool:
    """Tell whether the 95 % interval of a value excludes the neutral value; true for a limit."""
    sizes = effect.deviating(case.nominal, case.control)
    for p in sizes:
        key, none = effect.value_key(p), p.neutral(case.nominal, case.control)
        if p.is_limit or not fitted.low[key] <= none <= fitted.high[key]:
            return True
    return not sizes


def _search_from(
    problem: Problem, library: Sequence[Effect], known: Sequence[Fit]
) -> tuple[Beam, tuple[dict[str, float], ...]]:
    """Search the sets of a library's effects from known fits, the first without effects.

    If an output is over its limit with the nuisance parameters within their tolerance, they stay
    there without effects. Return the beam, and the gains of each depth (`_search_by_depth`).
    """
    without_effects, case = problem.within_tolerance(known[0]), problem.case
    beam = Beam(problem, without_effects, problem.model_error(without_effects.rig))
    over = problem.over_limit(without_effects.rig)
    for fitted in (without_effects if over else known[0], *known[1:]):
        beam.add(fitted)
    beam.recount()
    kept = distinct(library, case.contact) if case.contact else list(library)
    return beam, _search_by_depth(beam, [one for one in kept if case.is_comparable(one)])


def _search_by_depth(beam: Beam, library: Sequence[Effect]) -> tuple[dict[str, float], ...]:
    """Fit the neighbours of the best sets, in rounds, until the best set explains every stage.

    The rounds also end if the best set does not change, or has as many effects as a set may have. A
    round may be lost to an effect that is then replaced. The functions of an aircraft model are in
    a library if the user requests them. Such a function is tried even if the motion is within its
    noise (`_choose`). Return the gain in log evidence of each round's sets, by the effect added.
    """
    front, best, known = beam.leading(), beam.best, set(beam.fits)
    asked = {output for effect in library if effect.of for output in effect.shows_in}
    depths = list[tuple[Names, set[Names]]]()
    while len(beam.best) < BEAM_DEPTH:
        if not front or (best and not beam.open_outputs(best)):
            break
        for names in front:
            if wanted := beam.open_outputs(names) or (set() if names else asked):
                _fit_neighbours(beam, beam.fits[names], library, wanted)
        new = set(beam.fits) - known
        if not new:
            break
        _finish(beam)
        _fit_by_multiple_shooting(beam)
        depths.append((front[0], new))
        if beam.best == best:
            break
        best, known = beam.best, set(beam.fits)
        front = [names for names in beam.leading() if names and names not in front]
    _fit_neighbours_of_best(beam, library)
    return tuple(
        {beam.fits[one].effects[-1].name: beam.log(one) - beam.log(base) for one in new}
        for base, new in depths
    )


def _fit_neighbours_of_best(beam: Beam, library: Sequence[Effect]) -> None:
    """Fit the sets with one effect less than the best set, and with a nested law in its place.

    A set with one effect less starts at the best set's optimum, also if it is known: its first fit
    may have ended at a local minimum. A law of several parameters may be equivalent to two effects
    of fewer. Repeat with each new best set, which may be an earlier one: the samples change.
    """
    done = set[Names]()
    while beam.best and beam.best not in done:
        done.add(beam.best)
        fitted = beam.fits[beam.best]
        fewer = [one for one in _sets_without_one(fitted) if one[0]]
        swapped = _sets_with_swap(beam, fitted, library)
        _fit_sets(beam, [*fewer, *swapped, *_sets_with_other_law(beam, fitted, library)])
        for law in fitted.effects:
            if (part := _fit_with_simpler_law(beam, law)) is not None:
                beside = _candidates(part.effects, library, {*law.shows_in})
                worth = Worth(PRIOR_EFFECT, beam.counts)
                screened = beam.screen.best(part, beside, worth, TRIES)
                _fit_sets(beam, _starts_with_one_more(beam, part, screened))
        _finish(beam)


def _numbers(fitted: Fit) -> int:
    """Return how many parameters a set's effects have."""
    return sum(len(effect.free) for effect in fitted.effects)


def _fit_with_simpler_law(beam: Beam, law: Effect) -> Fit | None:
    """Return the best fit with an effect of fewer parameters in place of a law of the best set.

    Both show in the same output. Return None if there is none, or if its neighbours are fitted.
    """
    rest = beam.best - {law.name}
    for names in beam.ranked() if len(law.free) > 1 else ():
        if len(names) == len(beam.best) and rest < names:
            (other,) = (one for one in beam.fits[names].effects if one.name not in rest)
            if len(other.free) < len(law.free) and {*other.shows_in} & {*law.shows_in}:
                grown = any(names < more for more in beam.fits)
                return None if grown else beam.fits[names]
    return None


def _fit_neighbours(beam: Beam, fitted: Fit, library: Sequence[Effect], wanted: set[str]) -> None:
    """Fit the neighbours of a fitted set, with effects that show in the `wanted` outputs.

    The candidate of the largest predicted gain is fitted first. If it explains the outputs, others
    are fitted only if they may do better; otherwise all are, since a prediction may show a small
    part of a large gain. If none is worth a fit beside the best set, a few are fitted all the same:
    the gain of a law whose shape is far from that of its start cannot be predicted. A law that
    contains another is fitted after it, from its optimum, if an output is still unexplained.
    """
    found, is_best = fitted, names_of(fitted.effects) == beam.best
    beside = _candidates(found.effects, library, wanted)
    fitted, screened = _worth_a_fit(beam, found, beside)
    doubtful = is_best and not screened
    if doubtful:
        screened = beam.screen.best(fitted, beside, Worth(0.0, beam.counts), TRIES)
    effects = [one.effect for one in screened]
    plain = [one for one in screened if not any(contains(one.effect, e) for e in effects)]
    ends = list[Fit]()
    for some in (plain[:1], plain[1:]):
        still = some
        if not (doubtful or (beam.best and beam.open_outputs(beam.best) & wanted)):
            still = beam.screen.still_worth(fitted, some, beam.worth(found, MOST))
        dry = next((one for one in still if one.effect.dry), None)
        if dry is not None and not beam.contact:
            first = _fit_sets(beam, _starts_with_one_more(beam, fitted, [dry])[:1])
            beam.contact = _contact_values(beam, first[0]) if first else {}
        ends += _fit_sets(beam, _starts_with_one_more(beam, fitted, still))
    if beam.best and not beam.open_outputs(beam.best):
        return
    wider = [one for one in screened if one not in plain]
    others = _starts_with_one_more(beam, fitted, wider)
    for end, one in product(ends, wider):
        others += _starts_with_other_law(beam, end, end.effects[-1], one.effect)
    others += _sets_with_other_law(beam, fitted, library)
    if len(fitted.effects) > 1:
        others += [*_sets_with_swap(beam, fitted, library), *_sets_without_one(fitted)]
    _fit_sets(beam, others)


def _worth_a_fit(
    beam: Beam, found: Fit, candidates: Sequence[Effect]
) -> tuple[Fit, list[Screened]]:
    """Return the candidates worth a fit beside a set, and the set as it is beside them.

    Its nuisance parameters are within their tolerance: beyond it they may have absorbed an effect.
    The presliding parameters of a filed friction have no tolerance. Without effects the candidates
    are also screened with their initial values, and the screen that predicts more is used.
    """
    problem, is_best = beam.problem, names_of(found.effects) == beam.best
    many = BEAM_CANDIDATES if is_best else TRIES
    fitted = problem.within_tolerance(found)
    screened = beam.screen.best(fitted, candidates, beam.worth(found), many, anew=is_best)
    initial = None if found.effects else problem.with_initial_contact(fitted)
    if initial is None:
        return fitted, screened
    # What does not show in the loader does not depend on its contact.
    apart = {e.name for e in candidates if "loader" not in e.shows_in}
    same = {name: known for name, known in beam.screen.known.items() if name in apart}
    screen = Screen(problem, beam.error, same)
    others = screen.best(initial, candidates, beam.worth(initial), many)
    most, more = (max((one.gain for one in some), default=0.0) for some in (screened, others))
    if more - beam.behind(initial) <= most:
        return fitted, screened
    beam.screen = screen
    return initial, others


def _fit_by_multiple_shooting(beam: Beam) -> None:
    """Restart sets with dry friction from multiple shooting, if the loader is unexplained."""
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
        started = {key: value for key, value in fitted.values.items() if key in ours}
        return dict(short.fit(fitted.effects, started, None, SHORT).values)

    starts = in_threads(shot, dry)
    _fit_sets(beam, [(f.effects, start, f) for f, start in zip(dry, starts, strict=True)])
    _finish(beam)


def _candidates(
    effects: Sequence[Effect], library: Sequence[Effect], outputs: set[str]
) -> list[Effect]:
    """Return the effects that show in some outputs, and share no parameter with a set."""
    taken = keys_of(effects)
    return [
        one for one in library if outputs & {*one.shows_in} and taken.isdisjoint(keys_of([one]))
    ]


def _starts_with_one_more(beam: Beam, fitted: Fit, added: Sequence[Screened]) -> list[Try]:
    """Return the starts of sets with one effect more, new dry friction at `Beam.contact`."""
    tries = list[Try]()
    for one in added:
        values = {**(beam.contact if one.effect.dry else {}), **fitted.values}
        effects = (*fitted.effects, one.effect)
        tries += [(effects, values | start, fitted) for start in one.starts]
    return tries


def _contact_values(beam: Beam, fitted: Fit) -> Start:
    """Return the presliding parameters of a fit that are nuisance parameters."""
    keys = {one.value_key(p) for one in beam.problem.case.contact for p in one.free}
    return {key: value for key, value in fitted.values.items() if key in keys}


def _sets_with_swap(beam: Beam, fitted: Fit, library: Sequence[Effect]) -> list[Try]:
    """Return the new sets with one effect swapped for another effect of the same output."""
    tries: list[Try] = []
    for old in fitted.effects:
        rest = tuple(effect for effect in fitted.effects if effect is not old)
        rig = beam.problem.rig_of(rest, fitted.values)
        same = [
            effect
            for effect in _candidates(rest, library, {*old.shows_in})
            if effect is not old and names_of((*rest, effect)) not in beam.fits
        ]
        if rig is not None and same:
            base = replace(fitted, effects=rest, rig=rig)
            found = beam.screen.best(base, same, beam.worth(base, MOST), TRIES)
            tries += [t for one in found for t in _starts_with_one_more(beam, base, [one])[:1]]
    return tries


def _sets_without_one(fitted: Fit) -> list[Try]:
    """Return the sets with one effect less."""
    return [
        (tuple(e for e in fitted.effects if e is not old), dict(fitted.values), fitted)
        for old in fitted.effects
    ]


def _sets_with_other_law(beam: Beam, fitted: Fit, library: Sequence[Effect]) -> list[Try]:
    """Return the sets with a law replaced by a law that it contains, or that contains it."""
    pairs = [(old, law) for old in fitted.effects for law in library]
    return [one for old, law in pairs for one in _starts_with_other_law(beam, fitted, old, law)]


def _starts_with_other_law(beam: Beam, fitted: Fit, old: Effect, law: Effect) -> list[Try]:
    """Return the start of a law in place of one that it contains or that contains it; else none."""
    rest = tuple(effect for effect in fitted.effects if effect is not old)
    wider = contains(law, old)
    if not (wider or contains(old, law)) or keys_of(rest) & keys_of([law]):
        return []
    case, known = beam.problem.case, beam.fits.get(names_of((*rest, law)))
    ours = {law.value_key(p) for p in law.free}
    found = {} if known is None else {k: v for k, v in known.values.items() if k in ours}
    start = {**found, **fitted.values}
    for p in law.free if not found else ():
        same = next((q for q in old.free if q.key == p.key and q.mode == p.mode), None)
        level = next((q for q in old.free if q.key == p.above), None)
        if same is not None:
            start[law.value_key(p)] = fitted.values[old.value_key(same)]
        elif level is not None:
            filed = level.nominal(case.nominal, case.control)
            running = float(level.entered(filed, fitted.values[old.value_key(level)]))
            start[law.value_key(p)] = (1.0 + MINOR) * running
    return [((*rest, law), start, fitted)]


def _fit_sets(beam: Beam, tries: Sequence[Try]) -> list[Fit]:
    """Fit sets from their starts, add them, and return the best fit of each set.

    All starts are fitted for a few evaluations. A start goes on if it is near the best one, if it
    made at least half of its gain over the parent, or if its law is less likely than a contained
    one: the optimum of the wider law is at least as good. The best start of each set is then fitted
    to convergence; a further start only if the best one leaves an output over its limit.
    """
    problem = beam.problem
    unique: dict[tuple[Names, tuple[tuple[str, float], ...]], Try] = {}
    for effects, start, parent in tries:
        near = tuple(sorted((key, float(f"{value:.6g}")) for key, value in start.items()))
        unique.setdefault((names_of(effects), near), (effects, start, parent))
    if not unique:
        return []

    def start_fit(one: Try) -> Started:
        effects, start, parent = one
        fit = problem.fit(effects, start, parent, FIRST)
        return beam.log_of(fit), fit, parent

    started = sorted(in_threads(start_fit, list(unique.values())), key=lambda one: -one[0])
    most = max(started[0][0], beam.log(beam.best))

    def goes_on(one: Started) -> bool:
        reached, fit, parent = one
        behind = beam.log_of(parent)
        replaced = {*parent.effects} - {*fit.effects}
        wider = any(contains(law, old) for law in fit.effects for old in replaced)
        return reached > most - max(GIVEN_UP, MOST * (most - behind)) or (
            wider and reached < behind
        )

    going = [one for one in started if goes_on(one)]
    first: dict[Names, Started] = {}
    for one in going:
        first.setdefault(names_of(one[1].effects), one)
    _continue_fits(beam, list(first.values()))

    def may_be_better(one: Started) -> bool:
        names = names_of(one[1].effects)
        if one is first[names] or beam.log(names) < beam.log(beam.best) - (4.0 * GIVEN_UP):
            return False
        if not is_admissible(problem, beam.fits[names]):
            return True
        if one[0] < first[names][0] - GIVEN_UP:
            return False
        shown = {stage for effect in one[1].effects[-1:] for stage in effect.shows_in}
        return bool(problem.over_limit(beam.fits[names].rig) & shown)

    _continue_fits(beam, [one for one in going if may_be_better(one)])
    return [beam.fits[names] for names in first]


def _continue_fits(beam: Beam, started: Sequence[Started]) -> None:
    """Fit started sets to convergence with coarse steps of the loader, and add them."""
    problem = beam.problem
    if problem.case.tell is not None and started:
        problem.case.tell(f"fitting {len(started)} sets of effects", 0, 1)

    def continue_fit(one: Started) -> Fit:
        _, fit, parent = one
        return problem.fit(fit.effects, fit.values, parent, COARSE, fit)

    for fit in in_threads(continue_fit, started):
        if beam.add(fit):
            beam.finished.discard(names_of(fit.effects))
    beam.recount()


def _finish(beam: Beam) -> None:
    """Fit the leading sets to convergence with the loader's own steps."""
    problem = beam.problem
    ranked = [names for names in beam.leading() if names and names not in beam.finished]

    def finish(names: Names) -> Fit:
        fitted = beam.fits[names]
        return problem.fit(fitted.effects, fitted.values, None, OWN, fitted)

    for names, fit in zip(ranked, in_threads(finish, ranked), strict=True):
        beam.finished.add(names)
        # A fit with coarse steps has another residual: its evidence is not comparable.
        del beam.fits[names], beam.known[names]
        beam.add(fit)
    beam.recount()


def _choose(beam: Beam, rounds: tuple[dict[str, float], ...]) -> Choice:
    """Return the best set with each effect's posterior probability and its alternatives.

    The probability of an effect is the sum over the sets with it, or with a law that contains it.
    If all outputs are within their noise, the answer is no effect: noise that is not quite as
    modelled is explained by some effect. Functions of the model, which the user requests, are the
    answer if their evidence is far ahead and all outputs are within their noise with them.
    """
    ranked = beam.ranked()
    logs = np.array([beam.log(names) for names in ranked])
    weights = np.exp(logs - logs[0])
    weights /= weights.sum()
    best = beam.best if weights[0] > MOST else _determined(beam, ranked)
    if not beam.open_outputs(frozenset()) and (
        beam.log(frozenset()) > logs[0] - GIVEN_UP
        or not all(effect.of for effect in beam.fits[best].effects)
        or beam.open_outputs(best)
    ):
        best = frozenset()
    fitted = beam.fits[best]
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
            if beam.log(names) > logs[0] - RIVAL_GAIN and _replaces(best, names, effect)
            for other in beam.fits[names].effects
            if other.name in names - best and not contains(other, effect)
        )
        steps.append(Found(effect, gain, float(weights[held].sum()), rivals))
    base = beam.log(frozenset())
    tried = {next(iter(names)): beam.log(names) - base for names in beam.fits if len(names) == 1}
    steps.sort(key=lambda step: -step.gain)
    return Choice(
        tuple(steps),
        fitted,
        beam.without_effects,
        tried,
        rounds,
        float(weights[ranked.index(best)]),
    )


def _determined(beam: Beam, ranked: Sequence[Names]) -> Names:
    """Return the best admissible set within `RIVAL_GAIN` of the best; else the best set."""
    near = [names for names in ranked if beam.log(names) > beam.log(ranked[0]) - RIVAL_GAIN]
    sure = (names for names in near if names and is_admissible(beam.problem, beam.fits[names]))
    return next(sure, ranked[0])


def _replaces(best: Names, other: Names, effect: Effect) -> bool:
    """Tell whether another set replaces an effect of the best set, one by several or vice versa."""
    gone, new = best - other, other - best
    return effect.name in gone and len(new) >= 1 and min(len(gone), len(new)) == 1


def _name_law_with_contact(beam: Beam, choice: Choice, library: Sequence[Effect]) -> Choice:
    """Return a choice with presliding friction named, if its presliding length is not zero.

    In the search its parameters are nuisance parameters (`distinct`). The law with them is named if
    the rig file has no friction, and the length's 95 % interval excludes the shortest, which is
    that of a rigid contact.
    """
    problem, fitted = beam.problem, choice.fit
    case = problem.case
    if not case.contact or is_dry(case.nominal, case.control):
        return choice
    (number,) = case.contact[0].free
    length, shortest = case.contact[0].value_key(number), number.low
    kept = distinct(library, case.contact)
    for step in choice.steps:
        law = next((e for e in library if e not in kept and contains(e, step.effect)), None)
        if law is None or fitted.low.get(length, shortest) <= shortest:
            continue
        numbers = {p: value_of(fitted.rig, case.control, p.key) for p in law.free}
        start = {law.value_key(p): float(value) for p, value in numbers.items()}
        effects = tuple(law if one is step.effect else one for one in fitted.effects)
        named = problem.fit(effects, {**fitted.values, **start}, None, OWN)
        if is_admissible(problem, named):
            steps = [replace(s, effect=law) if s is step else s for s in choice.steps]
            return replace(choice, steps=tuple(steps), fit=named)
    return choice
