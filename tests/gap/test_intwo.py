"""Two effects that explain a gap together, where neither is worth having alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.choose import searched
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig
from tests.support.rigs import bench

Floats = NDArray[np.float64]
FRAMES = 3000
RNG = np.random.default_rng(3)
OFFSET, WEIGHT = BY_NAME["force_offset"], BY_NAME["bob_weight"]


def waves(count: int) -> Floats:
    """Return one of few slow waves, so that what is left of it speaks for little."""
    return np.asarray(np.sin(2.0 * np.pi * count * np.arange(FRAMES) / FRAMES))


@pytest.mark.parametrize(
    ("unknown", "found"), [(0.0, {"force_offset", "bob_weight"}), (12.0, set[str]())]
)
def test_two_slow_effects_are_found_together_or_not_at_all(unknown: float, found: set[str]) -> None:
    """Alone each leaves the other's slow wave, which is worth few samples, and gains under 8.

    Where two leave more than an effect may, neither is claimed.
    """
    first, second, other = waves(2), waves(3), waves(1)
    measured = 12.0 * first + 12.0 * second + unknown * other + RNG.normal(size=FRAMES)

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * first + loader.bob_weight * second)

    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])
    choice = searched(case, [OFFSET, WEIGHT])
    assert {step.effect.name for step in choice.steps} == found
    if found:
        values = [choice.fit.values[one.value_key(one.free[0])] for one in (OFFSET, WEIGHT)]
        assert values == pytest.approx([12.0, 12.0], rel=0.02)
