"""The nominal rigs of a trial: the shipped ones, column only, and others of believable numbers.

All keep to the description of the rig that diagnoses are judged by: one gradient at a time and
F_mod = ΔG·δc, so neither the second segment of the schedule nor the preload's term in F_mod.
"""

from __future__ import annotations

import tomllib
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig, rig_from_table
from coupled.rig.rigwrite import rig_text

# The two corrections, and whether the structure bends: as both rig and host believe.
VARIANTS = {
    "rigid": (True, True, False),
    "compensated": (True, True, True),
    "uncompensated": (False, False, True),
}
DRAWN = "rig-"  # how the name of a rig that was drawn begins
MOST_BENT = 0.6  # K·G_T at the most


def shipped_pool() -> dict[str, Rig]:
    """Return the shipped rigs, column only, in each variant, by name."""
    pool = {}
    for name, path in shipped_rigs().items():
        rig = read_rig(path)
        if "column" in rig.controls:
            for variant, settings in VARIANTS.items():
                pool[f"{name}-{variant}"] = _varied(rig, f"{name}-{variant}", *settings)
    return pool


def random_rig(rng: np.random.Generator, name: str) -> Rig:
    """Return a shipped rig with its numbers moved as far as another real rig's might be."""
    pool = shipped_pool()
    while True:
        rig = pool[str(rng.choice(sorted(pool)))]
        column = _moved_column(rng, rig.controls["column"])
        changes: dict[str, Any] = {"name": name, "controls": {"column": column}}
        if rig.flight is not None:
            speed = rig.flight.calibrated_airspeed * rng.uniform(0.92, 1.15)
            height = rig.flight.altitude * rng.uniform(0.7, 1.5)
            where = {"calibrated_airspeed": _short(speed), "altitude": _short(height)}
            changes["flight"] = rig.flight.model_copy(update=where)
        moved = rig.model_copy(update=changes)
        try:
            return rig_from_table(tomllib.loads(rig_text(moved)), name)
        except InputError:  # a gradient stiffer than the structure, say: draw again
            continue


def _varied(rig: Rig, name: str, deflection: bool, gradient: bool, bends: bool) -> Rig:
    column = rig.controls["column"]
    bend = column.loader.bend if bends else 0.0
    host: dict[str, Any] = {"deflection": deflection, "gradient": gradient, "bend": bend}
    host["breakout_term"] = "printed"
    parts = {
        "loader": column.loader.model_copy(update={"bend": bend}),
        "compensation": column.compensation.model_copy(update=host),
        "schedule": column.schedule.model_copy(
            update={"second_gradient": None, "break_deflection": 0.0}
        ),
    }
    controls = {"column": column.model_copy(update=parts)}
    return rig.model_copy(update={"name": name, "controls": controls})


def _moved_column(rng: np.random.Generator, column: Control) -> Control:
    loader, table = column.loader, column.schedule
    stiffer = _log(rng, 0.7, 1.5)
    gradients = [_short(g * stiffer * rng.uniform(0.9, 1.1)) for g in table.total_gradient]
    bend = 0.0
    if loader.bend > 0.0:
        bend = _short(min(_log(rng, 2e-5, 2.5e-4), MOST_BENT / max(gradients)))
    numbers: dict[str, float] = {
        "mass": _short(loader.mass * _log(rng, 0.6, 1.7)),
        "damping": _short(loader.damping * _log(rng, 0.6, 1.7)),
        "basic_gradient": _short(loader.basic_gradient * _log(rng, 0.7, 1.4)),
        "breakout": _short(loader.breakout * rng.choice([0.0, 0.5, 1.0])),
        "friction": _short(loader.friction * rng.choice([0.0, 0.5, 1.0])),
        "servo_frequency": _short(_log(rng, 8.0, 30.0)),
        "servo_damping_ratio": _short(rng.uniform(0.5, 1.0)),
        "bend": bend,
    }
    parts = {
        "travel": _short(column.travel * _log(rng, 0.8, 1.3)),
        "length": _short(max(column.length, 2.0 * column.travel) * rng.uniform(0.8, 1.3)),
        "loader": loader.model_copy(update=numbers),
        "schedule": table.model_copy(update={"total_gradient": gradients}),
        "compensation": column.compensation.model_copy(update={"bend": bend}),
    }
    return column.model_copy(update=parts)


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _short(value: float) -> float:
    """Return a number as a rig file would give it: four digits."""
    return float(f"{value:.4g}")
