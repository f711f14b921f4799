"""Stick forces as a CSV table."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from coupled.authority.maps import FELT, Feel
from coupled.record.csvfile import write_table


def write_feel(feel: Feel, path: Path) -> None:
    """Write the stick forces, a row for each speed."""
    columns = {
        "calibrated_airspeed_m_per_s": feel.calibrated_airspeed_m_per_s,
        "dynamic_pressure_Pa": feel.pressure_Pa,
    }
    for name in FELT:
        word = "specified" if name == "rigid" else name
        columns[f"{word}_force_per_g_N"] = feel.per_g_N[name]
        columns[f"{word}_pull_per_knot_N"] = feel.per_knot_N[name]
    write_table(pl.DataFrame(columns).fill_nan(None), path)
