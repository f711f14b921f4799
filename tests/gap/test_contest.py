"""Effects found are asked once more, on all of the record, beside what else may be the cause."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search import contest
from coupled.gap.search.case import Case
from coupled.gap.search.choose import _is_explained_without
from coupled.gap.search.contest import switched
from coupled.gap.search.rivals import Found
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig
from tests.support.rigs import bench

FRAMES = 3000
SHAPE, OTHER, NOISE = np.random.default_rng(5).normal(size=(3, FRAMES))
LAG, DIGITAL = BY_NAME["modifying_lag"], BY_NAME["digital_multiplier"]
OFFSET, DAMPING = BY_NAME["force_offset"], BY_NAME["viscous_damping"]
LAG_s = 4e-3


def acting(rig: Rig) -> NDArray[np.float64]:
    """Return what a lag does, and a digital product that is much like a lag of 4 ms."""
    loader = rig.controls["column"].loader
    whole = SHAPE + 0.1 * OTHER if loader.multiplier == "digital" else 0.0
    return np.asarray(20.0 * (loader.modifying_lag / LAG_s * SHAPE + whole))


@pytest.mark.parametrize(("digital", "named"), [(True, DIGITAL), (False, LAG)])
def test_an_effect_without_a_number_takes_the_place_of_one_that_it_does_as_much_as(
    digital: bool, named: object
) -> None:
    """Beside a damping of 0.90 a digital product left more than there was, and was passed over.

    The lag of 3.8 ms found then let the damping come to 0.925, beside which the product does more.
    """
    measured = 20.0 * (SHAPE + (0.1 * OTHER if digital else 0.0)) + NOISE
    case = Case(bench(), "column", [Output("loader", "x", measured, acting, 1.0, 120.0)])
    step = Found(LAG, 200.0, 0.97, ())
    found, last = switched(case, [DIGITAL, LAG], case.fit((LAG,)), step)
    assert (found.effect, last.effects) == (named, (named,))


def test_an_effect_without_a_number_is_not_fitted_where_it_leaves_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    measured = 20.0 * OTHER + NOISE

    def predict(rig: Rig) -> NDArray[np.float64]:
        return np.asarray(acting(rig) + 20.0 * rig.controls["column"].loader.offset * OTHER)

    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])
    current = case.fit((OFFSET,))
    monkeypatch.setattr(contest, "contested", lambda *_: pytest.fail("fitted"))
    step, last = switched(case, [DIGITAL], current, Found(OFFSET, 200.0, 0.97, ()))
    assert (step.effect, last) == (OFFSET, current)


@pytest.mark.parametrize(("size", "needless"), [(0.3, True), (3.0, False)])
def test_an_effect_without_which_its_stage_is_within_its_limit_is_needless(
    size: float, needless: bool
) -> None:
    def predict(rig: Rig) -> NDArray[np.float64]:
        return np.asarray(rig.controls["column"].loader.offset * SHAPE)

    measured = size * SHAPE + NOISE
    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])
    assert _is_explained_without(case, OFFSET, case.fit(())) == needless
