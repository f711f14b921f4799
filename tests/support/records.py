"""Records made by another program from the report's description, and the noise of their sensors.

They lie beside the project, where it was founded; elsewhere the tests use records flown here.
"""

from __future__ import annotations

from pathlib import Path

FOUNDERS = Path(__file__).parents[3] / "shared" / "rig"
OWN = "flown here"
RECORDS = {
    "clean-c172p": "c172p",
    "clean-737-compensated": "737-compensated",
    "clean-bench": "bench",
}
NOISE = {
    "column_force_N": 0.15,
    "column_computed_m": 2e-5,
    "column_deflection_m": 4e-5,
    "column_modifying_force_N": 0.05,
    "dynamic_pressure_Pa": 1.0,
    "elevator_rad": 1.5e-4,
    "pitch_rate_rad_per_s": 2e-4,
    "alpha_rad": 4e-4,
    "pitch_rad": 2e-4,
    "load_factor": 4e-3,
    "true_airspeed_m_per_s": 0.05,
    "altitude_m": 0.2,
}


def available() -> list[str]:
    """Return the names of the records that this machine has."""
    return [OWN, *(RECORDS if FOUNDERS.is_dir() else [])]
