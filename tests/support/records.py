"""Reference records, and the noise of their sensors.

Records of the independent twin are in the repository (tests/support/make_records.py). Three more,
made by a separate program from the description of the rig, are used if found in `../shared/rig`.
"""

from __future__ import annotations

from pathlib import Path

from coupled.record.record import Record, read_record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig

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


TWINS = Path(__file__).parents[1] / "reference"
BY_TWIN = ("twin-bench", "twin-c172p")


def available() -> list[str]:
    """Return the names of the available records."""
    return [OWN, *BY_TWIN, *(RECORDS if FOUNDERS.is_dir() else [])]


def reference(name: str) -> tuple[Rig, Record]:
    """Return a reference record and its rig."""
    if name in BY_TWIN:
        return read_rig(TWINS / f"{name}.toml"), read_record(TWINS / f"{name}.parquet")
    rig = read_rig(FOUNDERS / "rigs" / f"{RECORDS[name]}.toml")
    return rig, read_record(FOUNDERS / "examples" / f"{name}.csv")
