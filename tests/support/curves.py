"""Rigs of tests whose feel is a curve: a 737-like column, and a helicopter-like cyclic."""

from __future__ import annotations

from typing import Any

import numpy as np

from coupled.rig.rig import Rig
from tests.support.rigs import bench

SCHEDULE = "controls.column.schedule"
SEGMENT = 0.001 * np.array([0.0, 20.0, 50.0, 90.0, 130.0, 178.0])  # five, as on a 737's column
# Stiff near neutral, softer, and stiffer again towards the stop; a row at rest, and one at speed.
COLUMN_N = [[0.0, 20.0, 35.0, 50.0, 70.0, 110.0], [0.0, 42.0, 84.0, 120.0, 164.0, 260.0]]
# Of a helicopter's cyclic: flat about the middle, and a push unlike a pull.
CYCLIC = [-0.15, -0.06, -0.01, 0.0, 0.01, 0.05, 0.12]
CYCLIC_N = [-60.0, -12.0, 0.0, 0.0, 0.0, 20.0, 48.0]


def curved(nodes: Any, forces: Any, changes: dict[str, Any] | None = None) -> Rig:
    """Return the bench with a curve; one row is the same at any q̄."""
    pressures = [0.0, 3000.0][: len(forces)]
    table: dict[str, Any] = {
        f"{SCHEDULE}.dynamic_pressure_Pa": pressures,
        f"{SCHEDULE}.deflection_m": [float(node) for node in nodes],
        f"{SCHEDULE}.force_N": [[float(force) for force in row] for row in forces],
        f"{SCHEDULE}.total_gradient_N_per_m": [],
    }
    return bench(table | (changes or {}))


def column(changes: dict[str, Any] | None = None) -> Rig:
    """Return a 737-like column: five segments, a breakout and friction."""
    return curved(SEGMENT, COLUMN_N, {"breakout_N": 17.8, "friction_N": 9.0} | (changes or {}))
