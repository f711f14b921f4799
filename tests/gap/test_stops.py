"""Where a fit of the stops starts: at those of the record, or at the travel of their side."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.effects.seen import stops
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig

PULL_m, PUSH_m, AFT_m = 0.09, 0.06, 0.01


def uneven() -> Rig:
    sides = {"travel_m": PULL_m, "travel_push_m": PUSH_m}
    return nominal_rig(False).changed({f"controls.column.{k}": v for k, v in sides.items()})


def loader_of(folder: Path, values: dict[str, dict[str, float]]) -> list[Output]:
    record = made(folder, uneven(), values, 3, 45.0)
    reader = Reader(uneven(), record, "column", surface_points)
    return [one for one in reader.outputs() if one.stage == "loader"]


def test_a_side_that_is_not_met_has_its_own_travel(tmp_path: Path) -> None:
    stop = {"travel": {"aft_{d}": AFT_m, "forward_{d}": PUSH_m}}
    (found,) = stops(loader_of(tmp_path, stop), uneven(), "column")
    assert found["aft_{d}"] == pytest.approx(AFT_m, abs=1e-4)
    assert found["forward_{d}"] == PUSH_m


def test_an_uneven_travel_alone_is_no_stop(tmp_path: Path) -> None:
    assert stops(loader_of(tmp_path, {}), uneven(), "column") == []
