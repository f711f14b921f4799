"""How well the number of a law is known at best."""

from __future__ import annotations

import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.rig.rig import Rig
from tests.support.rigs import bench

BEND, LOOP = BY_NAME["bend"], BY_NAME["bend_hysteresis"]
FILED = 9e-5


def rigged() -> Rig:
    return bench({"bend_m_per_N": FILED, "controls.column.compensation.bend_m_per_N": FILED})


def test_a_bend_is_known_by_how_far_it_is_from_the_one_filed() -> None:
    """So is a factor, and what the rig has none of; a limit by its own size.

    A bend 0.7 % above the filed one had an interval of 1.5 % of all of it, and said nothing.
    """
    [bend], [factor] = BEND.free, BY_NAME["servo_lag"].free
    [limit], [_, _, width] = BY_NAME["force_limit"].free, LOOP.free
    assert bend.error(9.2e-5, rigged(), "column") == pytest.approx(0.015 * 2e-6)
    assert factor.error(0.8, rigged(), "column") == pytest.approx(0.015 * 0.2)
    assert limit.error(49.5, rigged(), "column") == pytest.approx(0.015 * 49.5)
    assert width.error(12.0, rigged(), "column") == pytest.approx(0.015 * 12.0)
