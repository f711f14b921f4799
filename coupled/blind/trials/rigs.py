"""The nominal rigs of a set: those of its version, and others with realistic numbers.

All have the features that diagnoses are judged by: one gradient at a time and F_mod = ΔG·δc, so
neither a second segment of the schedule nor the preload's term in F_mod.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from coupled.blind.twin.setting import log_uniform
from coupled.errors import InputError
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

DRAWN = "rig-"  # prefix of the name of a random rig
MOST_BENT = 0.6  # largest K·G_T
COLUMN = "controls.column"


def rig_pool(own: Mapping[str, Rig], seed: int, rigs: int) -> dict[str, Rig]:
    """Return the rigs of a version, and `rigs` random others."""
    pool = dict(own)
    rng = np.random.default_rng([seed, 0])
    for i in range(rigs):
        name = f"{DRAWN}{i + 1:02d}"
        pool[name] = random_rig(rng, name, own)
    return pool


def random_rig(rng: np.random.Generator, name: str, own: Mapping[str, Rig]) -> Rig:
    """Return a random variation of a rig of a version, within the range of real rigs."""
    while True:
        rig = own[str(rng.choice(sorted(own)))]
        changes = _moved_column(rng, rig.controls["column"])
        if rig.flight is not None:
            speed = rig.flight.calibrated_airspeed * rng.uniform(0.92, 1.15)
            height = rig.flight.altitude * rng.uniform(0.7, 1.5)
            changes["flight.calibrated_airspeed_m_per_s"] = _short(speed)
            changes["flight.altitude_m"] = _short(height)
        try:
            return rig.changed({"name": name, **changes})
        except InputError:  # for example a gradient stiffer than the structure: draw again
            continue


def _moved_column(rng: np.random.Generator, column: Control) -> dict[str, Any]:
    """Return changes to a column, by the keys of a rig file."""
    loader, table = column.loader, column.schedule
    stiffer = log_uniform(rng, 0.7, 1.5)
    gradients = [_short(g * stiffer * rng.uniform(0.9, 1.1)) for g in table.total_gradient]
    bend = 0.0
    if loader.bend > 0.0:
        bend = _short(min(log_uniform(rng, 2e-5, 2.5e-4), MOST_BENT / max(gradients)))
    numbers = {
        "mass_kg": _short(loader.mass * log_uniform(rng, 0.6, 1.7)),
        "damping_N_s_per_m": _short(loader.damping * log_uniform(rng, 0.6, 1.7)),
        "basic_gradient_N_per_m": _short(loader.basic_gradient * log_uniform(rng, 0.7, 1.4)),
        "breakout_N": _short(loader.breakout * rng.choice([0.0, 0.5, 1.0])),
        "friction_N": _short(loader.friction * rng.choice([0.0, 0.5, 1.0])),
        "servo_frequency_Hz": _short(log_uniform(rng, 8.0, 30.0)),
        "servo_damping_ratio": _short(rng.uniform(0.5, 1.0)),
        "bend_m_per_N": bend,
    }
    travel = _short(column.travel * log_uniform(rng, 0.8, 1.3))
    length = _short(max(column.length, 2.0 * column.travel) * rng.uniform(0.8, 1.3))
    return {
        f"{COLUMN}.travel_m": travel,
        f"{COLUMN}.length_m": length,
        **{f"{COLUMN}.loader.{key}": value for key, value in numbers.items()},
        f"{COLUMN}.schedule.total_gradient_N_per_m": gradients,
        f"{COLUMN}.compensation.bend_m_per_N": bend,
    }


def _short(value: float) -> float:
    """Return a number in four digits, as in a rig file."""
    return float(f"{value:.4g}")
