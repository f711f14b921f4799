"""Effects that nothing in the records tells apart share their probability."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.equivalents import with_equivalents
from coupled.gap.search.case import Case
from coupled.gap.search.found import Candidate, Choice, Found
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig
from tests.support.rigs import bench

ZERO, OFFSET, DAMPING = (BY_NAME[n] for n in ("force_zero", "force_offset", "viscous_damping"))
SPEED = np.random.default_rng(2).normal(0.0, 1.0, 4000)


def case_of(stages: tuple[str, ...] = ("loader",)) -> Case:
    """Return a case of a force with damping, an offset and a zero of the gauge; 3 N are off."""

    def force(rig: Rig) -> NDArray[np.float64]:
        data = rig.controls["column"]
        pushed = 0.01 * data.loader.damping * SPEED - data.loader.offset
        return np.asarray(pushed + data.sensing.force_zero)

    def gauged(rig: Rig) -> NDArray[np.float64]:
        return np.full(4000, rig.controls["column"].sensing.force_zero)

    rng = np.random.default_rng(1)
    rig = bench()
    outputs = []
    for stage in stages:
        predict = force if stage == "loader" else gauged
        measured = predict(rig) + 3.0 + rng.normal(0.0, 0.5, 4000)
        outputs.append(Output(stage, "column_force_N", measured, predict, 0.5, 100.0))
    return Case(rig, "column", outputs)


def chosen(case: Case, effect: Effect, rivals: tuple[Candidate, ...] = ()) -> Choice:
    """Return the choice of one effect, at 0.9."""
    problem = Problem(case)
    fit = problem.fit((effect,))
    return Choice((Found(effect, 500.0, 0.9, rivals),), fit, problem.fit(()), probability=0.9)


def test_a_zero_of_the_gauge_and_a_force_on_the_loader_are_one() -> None:
    case = case_of()
    [step] = with_equivalents(chosen(case, ZERO), case, [ZERO, OFFSET, DAMPING]).steps
    [other] = step.rivals
    assert other.effect is OFFSET
    assert other.fit.values["force_offset.offset_N"] == pytest.approx(-3.0, abs=0.05)
    # Two sets of 0.9 each beside 0.1 of others.
    assert step.probability == pytest.approx(0.9 / 1.9)


def test_an_effect_that_shows_in_another_output_has_a_reason_of_its_own() -> None:
    case = case_of(("loader", "linkage"))
    [step] = with_equivalents(chosen(case, ZERO), case, [ZERO, OFFSET, DAMPING]).steps
    assert (step.probability, step.rivals) == (0.9, ())


@pytest.mark.parametrize("behind", [0.0, 2.0])
def test_equivalents_that_the_search_fitted_share_as_well(behind: float) -> None:
    """Their evidence differs by the priors of their sizes alone."""
    case = case_of()
    rival = Candidate(500.0 - behind, OFFSET, Problem(case).fit((OFFSET,)))
    choice = chosen(case, ZERO, (rival,))
    [step] = with_equivalents(choice, case, [ZERO, OFFSET, DAMPING]).steps
    wanted = min(0.9, 0.5 * (0.9 + 0.9 * math.exp(-behind)))
    assert step.probability == pytest.approx(wanted)
    assert step.rivals == (rival,)


def test_an_effect_without_an_equivalent_keeps_its_probability() -> None:
    case = case_of()
    choice = chosen(case, DAMPING)
    [step] = with_equivalents(choice, case, [ZERO, OFFSET, DAMPING]).steps
    assert step == choice.steps[0]
