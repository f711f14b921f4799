"""An effect whose interval contains its neutral value is not certain."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.answer import has_size
from coupled.gap.findings.result import ParameterEstimate
from coupled.gap.search.case import Case
from tests.support.rigs import bench

NUMBER = ParameterEstimate("x", 1.0, 0.5, 1.5, "loader.x", "N", 0.0, 1.0, 0.5, 1.5, "", False)


@pytest.mark.parametrize(
    ("name", "intervals", "sized"),
    [
        ("coulomb_friction", [(0.2, 3.0)], True),
        ("coulomb_friction", [(-0.1, 3.0)], False),
        ("coulomb_friction", [(None, 3.0)], False),
        ("gradient_error", [(0.9, 1.1)], False),
        ("gradient_error", [(1.01, 1.1)], True),
        ("asymmetric_friction", [(-1.0, 1.0), (0.2, 3.0)], True),
        ("arc_geometry", [], True),
    ],
)
def test_an_effect_has_a_size_where_an_interval_excludes_the_neutral_value(
    name: str, intervals: list[tuple[float | None, float | None]], sized: bool
) -> None:
    case, effect = Case(bench(), "column", []), BY_NAME[name]
    numbers = [replace(NUMBER, low=low, high=high) for low, high in intervals]
    assert has_size(effect, case, numbers) == sized
