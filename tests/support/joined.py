"""A bench of column and wheel on one structure."""

from __future__ import annotations

import copy
from typing import Any

from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from tests.support.rigs import BENCH, COLUMN

RADIUS = 0.25
BETWEEN = 3.0e-5  # m of column per N on the wheel's rim
STRUCTURE: dict[str, Any] = {
    "column_by_wheel_m_per_N": BETWEEN,
    "wheel_by_column_rad_per_N": BETWEEN / RADIUS,
    "reciprocal": True,
}
WHEEL: dict[str, Any] = {
    "surface": "aileron",
    "travel_rad": 1.5,
    "length_m": RADIUS,
    "loader": {
        "mass_kg": 1.0,
        "damping_N_s_per_rad": 18.0,
        "basic_gradient_N_per_rad": 30.0,
        "servo_frequency_Hz": 18.0,
        "servo_damping_ratio": 0.7,
        "bend_rad_per_N": 8e-4,
    },
    "schedule": {
        "dynamic_pressure_Pa": [0.0, 3000.0],
        "total_gradient_N_per_rad": [30.0, 90.0],
    },
    "compensation": {"deflection": True, "gradient": True, "bend_rad_per_N": 8e-4},
}


def joined(
    changes: dict[str, Any] | None = None,
    structure: dict[str, Any] | None = None,
    assumed: dict[str, Any] | None = None,
) -> Rig:
    """Return a bench of column and wheel on one structure."""
    table = copy.deepcopy(BENCH)
    table["controls"] = {"column": copy.deepcopy(COLUMN), "wheel": copy.deepcopy(WHEEL)}
    table["structure"] = dict(STRUCTURE if structure is None else structure)
    if assumed:
        table["structure"]["assumed"] = assumed
    rig = rig_from_table(table, "test")
    return rig.changed(changes) if changes else rig


FULL = {key: STRUCTURE[key] for key in ("column_by_wheel_m_per_N", "wheel_by_column_rad_per_N")}
