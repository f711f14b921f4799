"""A specified curve, flown by JSBSim alone from its export."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tests.support.exported import bench, both, forces, on_bench

SCHEDULE = "controls.column.schedule"
# Pull and push differ, so that the breakout's bend does too.
CURVE: dict[str, Any] = {
    f"{SCHEDULE}.dynamic_pressure_Pa": [0.0, 4000.0],
    f"{SCHEDULE}.total_gradient_N_per_m": [],
    f"{SCHEDULE}.deflection_m": [-0.15, -0.05, 0.0, 0.02, 0.06, 0.15],
    f"{SCHEDULE}.force_N": [
        [-60.0, -30.0, 0.0, 18.0, 30.0, 90.0],
        [-150.0, -40.0, 0.0, 36.0, 60.0, 200.0],
    ],
    "controls.column.loader.breakout_N": 8.0,
}


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_jsbsim_alone_feels_the_curve(multiplier: str) -> None:
    """A pull through four segments and a push through three, each held: δ as in our own flight."""
    rig = bench(CURVE | {"controls.column.loader.multiplier": multiplier})
    pilot = forces([0.0, 0.4, 1.2, 2.0, 2.8], [0.0, 120.0, 120.0, -60.0, -60.0])
    ours, alone, _ = both(on_bench(rig, pilot, 2.8))
    for channel, within in (("column_deflection_m", 2e-4), ("column_modifying_force_N", 0.5)):
        assert np.max(np.abs(ours[channel])) > 50.0 * within
        assert alone[channel] == pytest.approx(ours[channel], abs=within)
    for k in (115, 275):
        gradient = "column_gradient_N_per_m"
        assert alone[gradient][k] == pytest.approx(ours[gradient][k], rel=1e-6)
