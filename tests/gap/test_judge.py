"""Which stages are guilty: one without an output of its own, by an effect beyond doubt alone."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.judge import Judge
from coupled.gap.search.found import Choice, Fit, Found
from coupled.gap.signals.output import Output
from tests.support.gaps import nominal_rig


def judge(name: str, gaps: dict[str, float], left: dict[str, float], *doubted: str) -> set[str]:
    """Return the stages blamed by one effect, with the gaps without it and with it."""
    rig, none = nominal_rig(False), np.zeros(100)
    outputs = [Output(at, at, np.full(100, x), lambda _: none, 1.0, 60.0) for at, x in gaps.items()]
    fit = Fit((), {}, {}, {}, (), rig)
    choice = Choice((Found(BY_NAME[name], 50.0, 0.9, ()),), fit, fit)
    return Judge([], outputs, choice, left, frozenset(doubted)).blamed


@pytest.mark.parametrize(
    ("gaps", "widest"),
    [({"loader": 1.1, "linkage": 3.4}, "linkage"), ({"loader": 4.1, "linkage": 1.2}, "loader")],
)
def test_a_doubted_effect_of_sensing_blames_the_neighbour_with_the_widest_gap(
    gaps: dict[str, float], widest: str
) -> None:
    left = dict.fromkeys(gaps, 1.0)
    assert judge("deflection_scale", gaps, left) == {"sensing"}
    assert judge("deflection_scale", gaps, left, "deflection_scale") == {widest}
    assert judge("deflection_scale", gaps, gaps) == set()


def test_an_effect_of_a_stage_with_an_output_blames_it_in_doubt_too() -> None:
    gaps = {"loader": 3.0, "linkage": 3.4}
    assert judge("coulomb_friction", gaps, gaps, "coulomb_friction") == {"loader"}
