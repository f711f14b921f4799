"""Rigs for tests: a bench of round numbers, changed by dotted keys."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy
from numpy.typing import NDArray

from coupled.rig.hosted import Feel
from coupled.rig.replay import drive_loader
from coupled.rig.rig import Rig
from coupled.rig.rigfile import change, rig_from_table

# The report's case: 12.5 lb/in in SI, K = 0.016 in/lb in SI.
G_STIFF = 2189.0
K_REPORT = 9.136e-5

COLUMN: dict[str, Any] = {
    "surface": "elevator",
    "travel_m": 0.1778,
    "length_m": 0.9,
    "loader": {
        "mass_kg": 4.0,
        "damping_N_s_per_m": 75.0,
        "basic_gradient_N_per_m": 560.0,
        "servo_frequency_Hz": 18.0,
        "servo_damping_ratio": 0.7,
        "bend_m_per_N": K_REPORT,
    },
    "schedule": {
        "dynamic_pressure_Pa": [0.0, 3000.0],
        "total_gradient_N_per_m": [560.0, G_STIFF],
    },
    "compensation": {"deflection": True, "gradient": True, "bend_m_per_N": K_REPORT},
}
BENCH: dict[str, Any] = {
    "name": "test-bench",
    "frame_rate_Hz": 100.0,
    "controls": {"column": COLUMN},
}


def bench(changes: dict[str, Any] | None = None, table: dict[str, Any] = BENCH) -> Rig:
    """Return the bench rig; keys without a dot are the column's loader's."""
    table = copy.deepcopy(table)
    for key, value in (changes or {}).items():
        dotted = key if "." in key else f"controls.column.loader.{key}"
        change(table, dotted, value)
    return rig_from_table(table, "test")


def amounts(most: float) -> SearchStrategy[float]:
    """Return a strategy for 0 or a positive number up to `most`."""
    return st.just(0.0) | st.floats(1e-9 * most, most)


def push(rig: Rig, force: Any, seconds: float, gradient: float = 560.0) -> NDArray[np.float64]:
    """Return δc at 2 kHz, from rest, under `force`: a constant, or a time history."""
    fine = rig.changed({"frame_rate_Hz": 2000.0})
    frames = round(seconds * fine.frame_rate)
    times = np.arange(frames * fine.substeps + 1) / (fine.frame_rate * fine.substeps)
    wanted = force(times) if callable(force) else force
    nodes = np.asarray(wanted, dtype=float) * np.ones_like(times)
    zeros = np.zeros(frames + 1)
    return drive_loader(fine, "column", nodes, Feel(zeros + gradient), zeros)[0]
