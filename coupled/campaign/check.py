"""A run's expectations, judged: only what they look at is flown."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from coupled.authority.compare import Flight, compare
from coupled.campaign.verdict import UnjudgedError, Verdict, judge_expectation
from coupled.errors import InputError
from coupled.flight.expectation import Expect
from coupled.flight.scenario import Configuration, Scenario, read_run

Progress = Callable[[str, int, int], None]


def read_expecting(name: str) -> list[Scenario]:
    """Return the cases of a run that expects something; to check any other says nothing."""
    scenarios = read_run(name)
    if not scenarios[0].run.expect:
        raise InputError(scenarios[0].file, "expect", "there is none: nothing could fail")
    return scenarios


def check_run(scenarios: Sequence[Scenario], progress: Progress | None = None) -> list[Verdict]:
    """Fly what a run's expectations look at, and return the verdicts, case by case."""
    flights = compare([_needed(scenario) for scenario in scenarios], progress)
    flown: dict[tuple[str, str], Flight]
    flown = {(f.outcome.case, f.configuration): f for f in flights}
    return [
        _verdict(expect, scenario, configuration, flown)
        for scenario in scenarios
        for expect in scenario.run.expect
        for configuration in scenario.run.configurations
        if expect.concerns(scenario.label, configuration)
    ]


def _needed(scenario: Scenario) -> Scenario:
    """Return the scenario with only those configurations that something is expected of."""
    run, wanted = scenario.run, set[str]()
    for expect in run.expect:
        looked_at: set[str] = {c for c in run.configurations if expect.concerns(scenario.label, c)}
        if looked_at and expect.reference is not None:
            looked_at.add(expect.reference)
        wanted |= looked_at
    kept = [c for c in run.configurations if c in wanted]
    return replace(scenario, run=run.model_copy(update={"configurations": kept}))


def _verdict(
    expect: Expect,
    scenario: Scenario,
    configuration: Configuration,
    flown: dict[tuple[str, str], Flight],
) -> Verdict:
    flight = flown.get((scenario.label, configuration))
    other = flown.get((scenario.label, expect.reference or ""))
    try:
        return judge_expectation(expect, flight, other)
    except UnjudgedError as why:
        where = (scenario.run.name, scenario.label, configuration)
        return Verdict(*where, expect.words, None, *expect.bounds, str(why))
