"""Which other effects a record does not tell from the one that was found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.choose import searched
from coupled.gap.search.contest import overtaken
from coupled.gap.search.gain import Candidate
from coupled.gap.search.rivals import Found, found_by, separated
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import RIVAL_GAIN
from coupled.rig.rig import Rig
from tests.support.rigs import bench

FRAMES = 3000
FIRST, SECOND, NOISE = np.random.default_rng(8).normal(size=(3, FRAMES))
OFFSET, WEIGHT = BY_NAME["force_offset"], BY_NAME["bob_weight"]


@pytest.mark.parametrize(("apart", "friction_N"), [(0.08, 0.0), (0.08, 2.0), (0.02, 0.0)])
def test_the_whole_record_tells_two_effects_of_one_number_apart(
    apart: float, friction_N: float
) -> None:
    """Half of it, held out, says too little: there the two differ by 2 to 3 of log-likelihood.

    Beside dry friction, where a fit may stand in a hollow, each is begun from the other's end, too.
    """

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + SECOND * apart))

    measured = FIRST + NOISE
    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])
    if friction_N:
        case = replace(case, nominal=bench({"friction_N": friction_N}))
    [step] = searched(case, [OFFSET, WEIGHT]).steps
    told = apart == 0.08
    names = {step.effect.name, *(one.effect.name for one in step.rivals)}
    assert names == ({"force_offset"} if told else {"force_offset", "bob_weight"})
    assert all(one.gain > step.gain - RIVAL_GAIN for one in step.rivals)
    assert (step.probability > 0.98) == told


def test_a_rival_that_all_of_the_record_is_surely_for_takes_the_place() -> None:
    """A scale of the force of 0.97 stood as a rival of a gradient, which held 5 less likelihood."""

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + SECOND * 0.1))

    measured = FIRST + SECOND * 0.1 + NOISE
    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])
    half = case.fit((WEIGHT,), "fitted")
    wrong = Found(OFFSET, 50.0, 0.6, (Candidate(49.5, WEIGHT, half),))
    step, last = separated(case, case.fit((OFFSET,)), wrong)
    assert step.effect is WEIGHT
    assert last.effects == (WEIGHT,)
    assert not step.rivals
    assert step.probability > 0.9
    right = Found(WEIGHT, 50.0, 0.6, (Candidate(49.5, OFFSET, case.fit((OFFSET,), "fitted")),))
    kept, same = separated(case, last, right)
    assert kept.effect is WEIGHT
    assert same is last
    assert not kept.rivals


@pytest.mark.parametrize("close", ["force_offset", "bob_weight"])
def test_an_effect_that_came_close_is_asked_again_on_all_of_the_record(close: str) -> None:
    """A gradient of 1.069 stood 10 behind a spring that relaxes, by a fit that ended in a hollow.

    On all of the record it was likelier by 43.
    """

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + SECOND * 0.2))

    measured = FIRST + SECOND * 0.2 + NOISE
    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])
    other = BY_NAME[close]
    first = OFFSET if other is WEIGHT else WEIGHT
    found = found_by(
        best := Candidate(50.0, first, case.fit((first,), "fitted")),
        [best, Candidate(40.0, other, case.fit((other,), "fitted"))],
    )
    assert [one.effect for one in found.behind] == [other]
    assert found.rivals == ()
    step, last = overtaken(case, case.fit((first,)), found)
    assert (step.effect, last.effects) == (WEIGHT, (WEIGHT,))
    assert step.probability > 0.98


def test_what_is_far_behind_is_not_asked_again() -> None:
    case = Case(bench(), "column", [])
    best, far = (Candidate(gain, one, case.fit(())) for gain, one in ((50.0, OFFSET), (20, WEIGHT)))
    assert found_by(best, [best, far]).behind == ()


def test_what_shows_in_more_outputs_may_overtake() -> None:
    """The squares of its fit are of more outputs, and say nothing beside the other's."""

    def loader(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        ours = rig.controls["column"].loader
        scale = 20.0 * (rig.controls["column"].sensing.force_scale - 1.0)
        return np.asarray(ours.offset * FIRST + scale * (FIRST + SECOND * 0.2))

    def linkage(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.zeros(FRAMES)

    scale = BY_NAME["force_scale"]
    outputs = [
        Output("loader", "x", FIRST + SECOND * 0.2 + NOISE, loader, 1.0, 120.0),
        Output("linkage", "y", 0.9 * NOISE[::-1], linkage, 1.0, 120.0),
    ]
    case = Case(bench(), "column", outputs)
    far = Candidate(40.0, scale, case.fit((scale,), "fitted"))
    found = Found(OFFSET, 50.0, 0.97, (), (far,))
    current = case.fit((OFFSET,))
    step, last = overtaken(case, current, found)
    assert last.cost > current.cost
    assert step.effect is scale
