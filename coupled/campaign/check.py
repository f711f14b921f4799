"""The check of a run's expectations; only the configurations that they need are flown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from coupled.arguments import public
from coupled.authority.compare import Flight, compare
from coupled.campaign.latency import fly_undelayed
from coupled.campaign.verdict import Verdict, judge_expectation, verdict_text
from coupled.errors import InputError
from coupled.flight.expectation import LATENCIES, Expect, UnjudgedError
from coupled.flight.manoeuvre import Configuration, Manoeuvre
from coupled.flight.pilot.own import Law, given_laws
from coupled.flight.runfile import read_run
from coupled.results import TableResult, frame_of

if TYPE_CHECKING:
    import polars as pl

Progress = Callable[[str, int, int], None]
Flown = dict[tuple[str, str], Flight]  # by case and configuration


class Asked(NamedTuple):
    """One expectation of one flight."""

    expect: Expect
    scenario: Manoeuvre
    configuration: Configuration


@dataclass(frozen=True)
class CheckResult(TableResult):
    """The verdicts on runs, in the order of their expectations; true if all hold.

    Its text names what fails: measured, expected, margin, time and why. `assert coupled.check(run)`
    shows that text where an expectation fails.
    """

    verdicts: tuple[Verdict, ...]
    judged: int | None = None  # how many were judged, where the verdicts are only those that failed

    @property
    def total(self) -> int:
        """How many expectations were judged."""
        return len(self.verdicts) if self.judged is None else self.judged

    @property
    def passed(self) -> bool:
        """Whether all expectations are met."""
        return all(verdict.passed for verdict in self.verdicts)

    def __bool__(self) -> bool:
        return self.passed

    def __repr__(self) -> str:
        failed = [verdict for verdict in self.verdicts if not verdict.passed]
        head = f"{self.total - len(failed)} of {self.total} expectations hold"
        return "\n".join([head, *(verdict_text(verdict) for verdict in failed)])

    def require(self) -> CheckResult:
        """Return this result; raise AssertionError with its text where an expectation fails."""
        if not self.passed:
            raise AssertionError(repr(self))
        return self

    def to_polars(self) -> pl.DataFrame:
        """Return a row for each verdict; values and bounds are in the unit of their quantity."""
        return frame_of([verdict.as_dict() for verdict in self.verdicts])


@public
def check(
    runs: str | Path | Sequence[str | Path | Sequence[Manoeuvre]],
    progress: Progress | None = None,
    *,
    column: Law | None = None,
    wheel: Law | None = None,
    pedals: Law | None = None,
) -> CheckResult:
    """Fly runs and compare them with their expectations.

    `runs` is a run file, the name of a shipped one, or several; a run may also be given as its
    cases. Only the configurations with expectations are flown. `progress` is called with a text,
    frames done and frames in all. A function on `column`, `wheel` or `pedals` is the pilot in
    place of the run's, as in `fly`. Raises InputError for a run without expectations.

    >>> import coupled
    >>> coupled.check("appendix-c").passed
    True
    """
    several = [runs] if isinstance(runs, (str, Path)) else runs
    if not several:
        raise InputError("coupled.check", "runs", "needs at least one")
    read = [
        read_expecting(str(r)) if isinstance(r, (str, Path)) else _expecting(r) for r in several
    ]
    own = given_laws(column, wheel, pedals, "coupled.check")
    read = [[replace(each, pilots={**each.pilots, **own}) for each in run] for run in read]
    return CheckResult(tuple(v for scenarios in read for v in check_run(scenarios, progress)))


def read_expecting(name: str) -> list[Manoeuvre]:
    """Return the cases of a run with expectations; raises InputError for any other."""
    return _expecting(read_run(name))


def _expecting(scenarios: Sequence[Manoeuvre]) -> list[Manoeuvre]:
    if not scenarios:
        raise InputError("coupled.check", "runs", "holds a run without a case")
    if not scenarios[0].expect:
        raise InputError(
            scenarios[0].file, "expect", "is missing: without one there is nothing to check"
        )
    return list(scenarios)


def check_run(scenarios: Sequence[Manoeuvre], progress: Progress | None = None) -> list[Verdict]:
    """Fly the configurations with expectations, and return the verdicts, case by case."""
    flights = compare([_needed(scenario) for scenario in scenarios], progress)
    flown: Flown = {(f.outcome.case, f.configuration): f for f in flights}
    undelayed = {where: fly_undelayed(f.manoeuvre) for where, f in flown.items() if _timed(f)}
    return [_verdict(*asked, flown, undelayed) for asked in expectations_of(scenarios)]


def expectations_of(scenarios: Sequence[Manoeuvre]) -> list[Asked]:
    """Return the expectations of a run, one item per verdict, in the order of the verdicts."""
    return [
        Asked(expect, scenario, configuration)
        for scenario in scenarios
        for expect in scenario.expect
        for configuration in scenario.configurations
        if expect.concerns(scenario.label, configuration)
    ]


def _needed(scenario: Manoeuvre) -> Manoeuvre:
    """Return the scenario with only the configurations that have expectations."""
    wanted = set[str]()
    for expect in scenario.expect:
        flown: Sequence[str] = scenario.configurations
        looked_at = {c for c in flown if expect.concerns(scenario.label, c)}
        if looked_at and expect.reference is not None:
            looked_at.add(expect.reference)
        wanted |= looked_at
    kept = tuple(c for c in scenario.configurations if c in wanted)
    return replace(scenario, configurations=kept)


def _timed(flight: Flight) -> bool:
    """Return whether a flight is compared with the same flight without delays."""
    asked = [e for e in flight.manoeuvre.expect if e.standard in LATENCIES]
    ended = bool(flight.ended_early)
    return not ended and any(e.concerns(flight.outcome.case, flight.configuration) for e in asked)


def _verdict(
    expect: Expect,
    scenario: Manoeuvre,
    configuration: Configuration,
    flown: Flown,
    undelayed: Flown,
) -> Verdict:
    flight = flown.get((scenario.label, configuration))
    other = flown.get((scenario.label, expect.reference or ""))
    if expect.standard in LATENCIES:
        other = undelayed.get((scenario.label, configuration))
    try:
        return judge_expectation(expect, flight, other)
    except UnjudgedError as why:
        where = (scenario.name, scenario.label, configuration)
        unjudged = Verdict(*where, expect.words, None, *expect.bounds, str(why), expect.quantity)
        return replace(unjudged, why=expect.why or "")
