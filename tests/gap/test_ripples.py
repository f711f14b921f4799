"""Where a fit of a ripple starts: at the period that moves δc as the record has it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.effects.seen import ripples
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import TRIES
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig

RIPPLE = {"ripple_N": 0.3, "phase_rad": 0.7}
NOISE_m = 5e-5  # of δc, beside what a record of the tests has


def rig_of() -> Rig:
    """Return a heavy bench that holds its control at neutral up to 19 N."""
    known = {"mass_kg": 6.7, "damping_N_s_per_m": 66.0, "breakout_N": 19.0}
    return nominal_rig(False).changed(
        {f"controls.column.loader.{key}": value for key, value in known.items()}
    )


def loader_of(folder: Path, period_m: float, seed: int) -> list[Output]:
    """Return the loader of that bench with a motor that ripples with so long a period."""
    rig = rig_of()
    values = {"friction_ripple": {**RIPPLE, "period_{d}": period_m}}
    record = made(folder, rig, values, seed, 45.0)
    louder = record.data.copy()
    noise = np.random.default_rng(seed).normal(scale=NOISE_m, size=len(record))
    louder[:, record.channels.index("column_computed_m")] += noise
    reader = Reader(rig, replace(record, data=louder), "column", surface_points)
    return [one.halved(rig) for one in reader.outputs() if one.stage == "loader"]


@pytest.mark.parametrize("period_m", [0.012, 0.007, 0.004, 0.002])
@pytest.mark.parametrize("seed", [31, 33])
def test_a_ripple_is_seen_at_its_period(tmp_path: Path, period_m: float, seed: int) -> None:
    """Of 7 mm it was sought at 0.9 mm, where noise is most of the force that δc would need."""
    seen = ripples(loader_of(tmp_path, period_m, seed), rig_of(), "column")
    assert 1 <= len(seen) <= TRIES
    assert seen[0]["period_{d}"] == pytest.approx(period_m, rel=0.05)
    assert 0.3 < seen[0]["ripple_N"] / RIPPLE["ripple_N"] < 1.3


def test_without_a_motion_of_the_loader_there_is_none() -> None:
    assert ripples([], rig_of(), "column") == []
