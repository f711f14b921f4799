"""Authority maps as tables, for CSV."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import polars as pl

from coupled.authority.maps import FELT, Feel, LossMap
from coupled.record.channels import unit_of
from coupled.record.csvfile import write_table


def write_losses(maps: Iterable[LossMap], path: Path) -> None:
    """Write the loss maps, a row a point; a deflection is in the unit beside it."""
    rows = [
        {
            "control": loss_map.control,
            "configuration": loss_map.configuration,
            "dynamic_pressure_Pa": float(q),
            "deflection": float(d),
            "deflection_unit": unit_of(loss_map.control),
            "loss": float(loss_map.loss[i, j]),
        }
        for loss_map in maps
        for i, q in enumerate(loss_map.pressure_Pa)
        for j, d in enumerate(loss_map.deflection)
    ]
    write_table(pl.DataFrame(rows).fill_nan(None), path)


def write_feel(feel: Feel, path: Path) -> None:
    """Write the stick forces, a row a speed."""
    columns = {
        "calibrated_airspeed_m_per_s": feel.calibrated_airspeed_m_per_s,
        "dynamic_pressure_Pa": feel.pressure_Pa,
    }
    for name in FELT:
        word = "specified" if name == "rigid" else name
        columns[f"{word}_force_per_g_N"] = feel.per_g_N[name]
        columns[f"{word}_pull_per_knot_N"] = feel.per_knot_N[name]
    write_table(pl.DataFrame(columns).fill_nan(None), path)
