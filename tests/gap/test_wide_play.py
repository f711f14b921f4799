"""A play wider than the motion: the record says how wide it is at least, and no more."""

from __future__ import annotations

from pathlib import Path

from coupled.gap.diagnose import diagnose
from tests.support import gaps


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
    flown = found.in_flight
    assert flown is not None
    assert all(0.9 < share <= 1.1 for share in flown[0].of_motion.values())
