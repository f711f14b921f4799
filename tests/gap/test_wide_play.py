"""A play wider than the motion: the record says how wide it is at least, and no more."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from tests.support import gaps

PLAY = BY_NAME["surface_freeplay"]


@pytest.mark.slow
def test_a_play_that_swallows_the_motion_is_named_as_that_wide_or_wider(tmp_path: Path) -> None:
    """No larger one does otherwise: it was left out for an interval without ends."""
    nominal = gaps.nominal_rig(True)
    record = gaps.made(tmp_path, nominal, {"surface_freeplay": {"play_norm": 0.12}}, 4, 6.0)
    found = diagnose(nominal, {"worn.csv": record})
    (only,) = found.effects
    (play,) = only.parameters
    assert (found.verdict, only.name) == ("effect", "surface_freeplay")
    assert play.low is not None
    assert 0.5 * play.value < play.low < play.value < 0.12
    assert play.high is None
    assert "norm or more" in found.summary
    assert play.interval("{:.3f}".format) == f"{play.low:.3f} or more"
    flown = found.in_flight
    assert flown is not None
    assert all(0.9 < share <= 1.1 for share in flown[0].of_motion.values())


@pytest.mark.parametrize("start", [0.0005, 0.01, 0.3])
def test_a_fit_of_a_play_does_not_end_short_of_one_that_swallows_all(
    tmp_path: Path, start: float
) -> None:
    """From under a third of it the fit ended in a hollow, at 60 times the cost."""
    nominal = gaps.nominal_rig(True)
    record = gaps.made(tmp_path, nominal, {"surface_freeplay": {"play_norm": 0.12}}, 4, 6.0)
    outputs = Reader(nominal, record, "column", surface_points).outputs()
    case = Case(nominal, "column", [one for one in outputs if one.stage == "surface"])
    fitted = Problem(case).fit([PLAY], {PLAY.value_key(PLAY.free[0]): start})
    assert fitted.values[PLAY.value_key(PLAY.free[0])] == pytest.approx(0.03695, rel=0.01)
    assert case.gaps(fitted.rig)["surface"] < 1.1
