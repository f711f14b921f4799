"""Play beside friction: what noise does to it is known, and taken off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.gap.fit import fit
from coupled.gap.library import BY_NAME
from coupled.gap.stages import Reader
from coupled.gap.surfaces import surface_points
from coupled.record.record import Record
from tests.support.gaps import made, nominal_rig
from tests.support.records import NOISE

PLAY_m = 8e-4


def trembling(record: Record, seed: int) -> Record:
    """Return the record with twice its noise of δc."""
    data = record.data.copy()
    level = 3.0**0.5 * NOISE["column_computed_m"]
    noise = np.random.default_rng(seed).normal(0.0, level, len(record))
    data[:, record.channels.index("column_computed_m")] += noise
    return Record(record.channels, data)


@pytest.mark.parametrize("friction_N", [0.0, 3.0])
def test_a_play_is_found_as_large_beside_friction_as_without(
    tmp_path: Path, friction_N: float
) -> None:
    """Without the correction it is 2.2 % too large where friction holds the loader still."""
    rig = nominal_rig(False).changed({"controls.column.loader.friction_N": friction_N})
    found = []
    for seed in (1, 2):
        record = trembling(made(tmp_path, rig, {"backlash": {"play_{d}": PLAY_m}}, seed), seed)
        outputs = Reader(rig, record, "column", surface_points).outputs()
        ours = [output for output in outputs if output.stage == "linkage"]
        play = fit(rig, "column", ours, [BY_NAME["backlash"]])
        key = "backlash.play_{d}"
        assert play.low[key] < PLAY_m < play.high[key]
        found.append(play.values[key])
    assert np.mean(found) == pytest.approx(PLAY_m, rel=0.008)
