"""The rules of the diagnosis beyond its design, each with the place that disables it.

`tests.ablation` measures the effect of each rule.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupled.gap.findings.credibility import remainder
from coupled.gap.search.found import Fit
from coupled.gap.search.screen import Worth
from coupled.gap.signals.output import Output, stage_gaps
from coupled.gap.thresholds import CERTAIN, DRIFT, LENGTHS

Off = Callable[..., Any]
Original = Callable[..., Any]


def gives(value: Any) -> Off:
    """Return a substitute of a rule that returns a constant."""
    return lambda original, *args, **options: value


def same(original: Original, first: Any, *args: Any, **options: Any) -> Any:
    """Substitute a rule that changes its argument: return the argument."""
    return first


def second(original: Original, first: Any, argument: Any, *args: Any, **options: Any) -> Any:
    """Substitute a method that changes its argument: return the argument."""
    return argument


def third(original: Original, first: Any, other: Any, argument: Any, *args: Any) -> Any:
    """Substitute a method that selects from its second argument: return the argument."""
    return argument


def idle(original: Original, *args: Any, **options: Any) -> None:
    """Substitute a rule that only adds fits to a beam: do nothing."""


@dataclass(frozen=True)
class Rule:
    """A rule, and the place that disables it.

    `place` is "module:name" below `coupled.gap`, where the name is looked up; `off` replaces the
    function and receives the original and its arguments, or is another value of a constant. With a
    `caller`, only calls by this function are without the rule.
    """

    name: str
    place: str
    off: Any
    what: str
    caller: str = ""
    fresh: bool = False  # acts before the search, or within a fit: nothing is reused

    @property
    def after_search(self) -> bool:
        """Whether the rule acts on the results of the search only."""
        return self.place.startswith(("findings.", "diagnose:"))

    def owner(self) -> tuple[Any, str]:
        """Return the module or class that holds the name, and the name."""
        module, _, name = self.place.partition(":")
        *outer, last = name.split(".")
        owner: Any = importlib.import_module(f"coupled.gap.{module}")
        for one in outer:
            owner = getattr(owner, one)
        return owner, last


RULES = (
    Rule("needed", "search.beam:Beam._needed", gives(frozenset()),
         "an effect whose interval includes neutral is kept if all simpler sets lose by 5"),
    Rule("contact_once", "search.beam:_contact_values", gives({}),
         "laws of friction start from presliding parameters fitted before"),
    Rule("last_swaps", "search.beam:_sets_with_swap", gives([]),
         "swaps in the best set, at the end", "_fit_neighbours_of_best"),
    Rule("two_for_one", "search.beam:_fit_with_simpler_law", gives(None),
         "two effects of fewer parameters in place of a law of several"),
    Rule("strained", "search.beam:relief_of", gives(0.0),
         "a set is explained only within the nuisance parameters' tolerance", "open_outputs"),
    Rule("best_first", "search.screen:Screen.still_worth", third,
         "once the most promising candidate is fitted, others must still be worth a fit"),
    Rule("efficient_score", "search.screen:Screen._worth_a_fit",
         lambda original, *args, refitted=False: [] if refitted else original(*args),
         "a candidate is also screened by what the present effects cannot make of it"),
    Rule("doubtful", "search.screen:Screen.best",
         lambda original, screen, current, candidates, worth, *args, **options:
             original(screen, current, candidates, worth, *args, **options) if worth.least else [],
         "if no candidate is worth a fit beside the best set, a few are fitted all the same",
         "_fit_neighbours"),
    Rule("initial_contact", "search.problem:Problem.with_initial_contact", gives(None),
         "without effects, screening also takes presliding parameters at their initial values"),
    Rule("refined", "search.screen:Screen._signature", gives([]),
         "candidates are also screened at larger and at projected sizes", "_refine_one"),
    Rule("smooth_error", "search.problem:ModelError.smooth",
         lambda original, error, noise: np.ones_like(noise),
         "the model error is as smooth as the gap of which it is a share", fresh=True),
    Rule("tolerance", "search.problem:Problem.within_tolerance", second,
         "effects are screened with nuisance parameters within their tolerance",
         "_worth_a_fit"),
    Rule("determined", "search.beam:_determined", lambda original, beam, ranked: ranked[0],
         "of alternatives below half, the first whose sizes are determined is reported"),
    Rule("noise_explains", "search.beam:Beam.open_outputs", gives({""}),
         "where noise explains all, no effect is the answer unless it is excluded", "_choose"),
    Rule("own_trim", "search.fit:_with_trim", gives(None),
         "a fit also starts from parameters that have the record's trim", fresh=True),
    Rule("named_contact", "search.beam:_name_law_with_contact", second,
         "Coulomb friction with presliding is named presliding friction"),
    Rule("grid", "search.case:contact_start",
         lambda original, cost, most, elastic: (LENGTHS[1] * most, 0.0),
         "presliding parameters start from a grid search", fresh=True),
    Rule("shooting", "search.beam:_fit_by_multiple_shooting", idle,
         "friction is also started from multiple shooting"),
    Rule("colour", "search.problem:Problem.without_colour_allowance", same,
         "a stage with a gap loses the allowance for unknown noise colour"),
    Rule("sensor_stamps", "search.case:Case._driven_over_limit", gives(()),
         "a sensor's nuisance parameter is also fitted to an output that it can disturb",
         fresh=True),
    Rule("contact_error", "prepare:allowing_for_contact", same,
         "a filed friction raises the loader's limit by 3 % of its gap", fresh=True),
    Rule("exact_laws", "search.problem:EXACT", (),
         "schedule, compensation and linkage have no model error in the evidence"),
    Rule("onset", "search.histories:_search_with_onset", gives(None),
         "the search is repeated with an effect that begins within the record"),
    Rule("noise_passed", "search.case:Case.gaps",
         lambda original, case, rig: stage_gaps(case.outputs, rig),
         "a gap counts by the higher noise floor of the filed rig and this one"),
    Rule("stated_most", "findings.answer:STATED_MOST", 1.0,
         "no probability above 0.89"),
    Rule("sure", "findings.answer:SURE", 1.0, "a credible effect's posterior times 0.97"),
    Rule("neutral_cap", "findings.answer:has_size", gives(True),
         "below certain where the interval includes neutral"),
    Rule("host_drift", "findings.credibility:HOST_DRIFT", DRIFT,
         "a third of the drift doubts an effect of the schedule"),
    Rule("stationarity", "findings.credibility:Credibility.drift", gives(0.0),
         "the stationarity test (point 8)"),
    Rule("flexible", "findings.credibility:_beside_flexible", gives(0.0),
         "the comparison with a nonparametric model (point 8)"),
    Rule("own_error", "findings.result:remainder",
         lambda original, gap, left, below, own: remainder(gap, left, below),
         "what even a nonparametric model leaves is no evidence against an effect"),
    Rule("hidden", "findings.judge:Judge._hidden", gives(None),
         "a stage whose noise floor may hide a gap is not judged"),
    Rule("doubted_stage", "diagnose:incredible", gives(frozenset()),
         "an incredible effect does not make a stage without output faulty"),
    Rule("incredible_rivals", "findings.answer:incredible", gives(frozenset()),
         "mostly, not ambiguous, where only incredible effects have alternatives", "verdict_of"),
    Rule("alternatives_hold", "findings.answer:one_is_certain",
         lambda original, choice, effects: frozenset(
             e.name for e in effects if e.probability >= CERTAIN),
         "alternatives that are certain together hold their share of a gap"),
    Rule("together", "findings.answer:_held_together", gives(0.0),
         "mostly where the certain effects hold half of all gaps together"),
)  # fmt: skip


@contextmanager
def patched(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Replace an attribute in this context."""
    before = vars(owner)[name]
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, before)


def called_by(caller: str) -> bool:
    """Return whether the function that called a wrapper of this file has a name; "" is any."""
    frame = sys._getframe(1)
    while frame.f_code.co_filename == __file__ and frame.f_back is not None:
        frame = frame.f_back
    return caller in ("", frame.f_code.co_name)


def function_of(attribute: Any) -> Any:
    """Return the function of a property; other attributes are returned unchanged."""
    return attribute.fget if isinstance(attribute, property) else attribute


@contextmanager
def without(rule: Rule) -> Iterator[None]:
    """Disable a rule in this context."""
    owner, name = rule.owner()
    before = vars(owner)[name]
    if not callable(rule.off):
        with patched(owner, name, rule.off):
            yield
        return
    original = function_of(before)

    def call(*args: Any, **options: Any) -> Any:
        if called_by(rule.caller):
            return rule.off(original, *args, **options)
        return original(*args, **options)

    with patched(owner, name, property(call) if isinstance(before, property) else call):
        yield


@contextmanager
def watched(rules: Sequence[Rule], acted: set[str]) -> Iterator[None]:
    """Add to `acted` the rules that change a result in this context.

    A rule that is a constant always counts.
    """
    with ExitStack() as stack:
        for rule in rules:
            if callable(rule.off):
                owner, name = rule.owner()
                stack.enter_context(patched(owner, name, _watching(rule, vars(owner)[name], acted)))
            else:
                acted.add(rule.name)
        yield


def _watching(rule: Rule, before: Any, acted: set[str]) -> Any:
    """Return a function or property that records whether its rule acts."""
    original = function_of(before)

    def call(*args: Any, **options: Any) -> Any:
        fits = dict(args[0].fits) if rule.off is idle else {}
        result = original(*args, **options)
        if rule.name not in acted and called_by(rule.caller):
            if rule.off is idle:
                now = args[0].fits
                changes = now.keys() != fits.keys() or any(now[k] is not fits[k] for k in now)
            else:
                other = rule.off(lambda *_, **__: result, *args, **options)
                changes = differs(result, other)
            if changes:
                acted.add(rule.name)
        return result

    return property(call) if isinstance(before, property) else call


def differs(one: Any, other: Any) -> bool:
    """Return whether two results of a rule's function differ; true if they cannot be compared."""
    if one is other:
        return False
    if isinstance(one, Worth) and isinstance(other, Worth):
        return one.least != other.least
    if isinstance(one, Fit) and isinstance(other, Fit):
        return dict(one.values) != dict(other.values)
    if isinstance(one, Output) and isinstance(other, Output):
        return one.limit != other.limit
    try:
        return bool(one != other)
    except ValueError:
        return True
