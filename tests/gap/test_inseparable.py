"""Numbers of the effects found that records determine only together."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.found import inseparable
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Floats, Output
from coupled.rig.rig import Rig
from tests.support.rigs import bench

FIRST, SECOND, NOISE = np.random.default_rng(8).normal(size=(3, 3000))
OFFSET, WEIGHT = BY_NAME["force_offset"], BY_NAME["bob_weight"]


@pytest.mark.parametrize(("apart", "together"), [(0.02, True), (1.0, False)])
def test_two_numbers_with_nearly_one_signature_are_one(apart: float, together: bool) -> None:
    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + apart * SECOND))

    output = Output("loader", "x", 5.0 * FIRST + NOISE, predict, 1.0, 120.0)
    problem = Problem(Case(bench(), "column", [output]))
    found = inseparable(problem.fit((OFFSET, WEIGHT)), "column")
    keys = ("force_offset.offset_N", "bob_weight.force_N_per_g")
    assert [one.keys for one in found] == ([keys] if together else [])
    assert inseparable(problem.fit((OFFSET,)), "column") == ()


def test_a_number_has_the_unit_of_its_control() -> None:
    """A length is in m on a column."""

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        return np.asarray((loader.offset + 1e-3 * loader.cubic) * FIRST)

    output = Output("loader", "x", 5.0 * FIRST + NOISE, predict, 1.0, 120.0)
    effects = (OFFSET, BY_NAME["cubic_stiffness"])
    (one,) = inseparable(Problem(Case(bench(), "column", [output])).fit(effects), "column")
    assert one.keys == ("force_offset.offset_N", "cubic_stiffness.cubic_N_per_m3")
