"""Where a fit of a ripple starts: at the period that moves δc as the record has it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.seen import ripples
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import TRIES
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from tests.support.gaps import made, nominal_rig

RIPPLE = {"ripple_N": 0.3, "phase_rad": 0.7}
NOISE_m = 5e-5  # of δc, beside what a record of the tests has


def rig_of() -> Rig:
    """Return a heavy bench that holds its control at neutral up to 19 N."""
    known = {"mass_kg": 6.7, "damping_N_s_per_m": 66.0, "breakout_N": 19.0}
    return nominal_rig(False).changed(
        {f"controls.column.loader.{key}": value for key, value in known.items()}
    )


def loader_of(folder: Path, period_m: float, seed: int) -> list[Output]:
    """Return the loader of that bench with a motor that ripples with so long a period."""
    rig = rig_of()
    values = {"friction_ripple": {**RIPPLE, "period_{d}": period_m}}
    record = made(folder, rig, values, seed, 45.0)
    louder = record.data.copy()
    noise = np.random.default_rng(seed).normal(scale=NOISE_m, size=len(record))
    louder[:, record.channels.index("column_computed_m")] += noise
    reader = Reader(rig, replace(record, data=louder), "column", surface_points)
    return [one.halved(rig) for one in reader.outputs() if one.stage == "loader"]


@pytest.mark.parametrize("period_m", [0.012, 0.007, 0.004, 0.002])
@pytest.mark.parametrize("seed", [31, 33])
def test_a_ripple_is_seen_at_its_period(tmp_path: Path, period_m: float, seed: int) -> None:
    """Of 7 mm it was sought at 0.9 mm, where noise is most of the force that δc would need."""
    seen = ripples(loader_of(tmp_path, period_m, seed), rig_of(), "column")
    assert 1 <= len(seen) <= TRIES
    assert seen[0]["period_{d}"] == pytest.approx(period_m, rel=0.05)
    assert 0.3 < seen[0]["ripple_N"] / RIPPLE["ripple_N"] < 1.3


def test_without_a_motion_of_the_loader_there_is_none() -> None:
    assert ripples([], rig_of(), "column") == []


def moved_joint(period_rad: float) -> tuple[Rig, Record]:
    """Return a joint and its record under an imposed motion: F = m·a + c·v + ripple, and noise."""
    mass, damping, time = 0.9, 3.2, np.arange(2500) / 125.0
    turns = 2.0 * np.pi * np.array([0.07, 0.21, 0.55])
    angle, sizes = np.outer(time, turns) + np.array([0.4, 2.3, 5.1]), np.array([0.9, 0.5, 0.2])
    place, speed = np.sin(angle) @ sizes, np.cos(angle) @ (sizes * turns)
    force = damping * speed - mass * (np.sin(angle) @ (sizes * turns**2))
    force = force + RIPPLE["ripple_N"] * np.sin(2.0 * np.pi * place / period_rad + 0.7)
    force = force + np.random.default_rng(3).normal(scale=0.1, size=len(time))
    names = ("time_s", "wheel_force_N", "wheel_deflection_rad")
    loader = {"mass_kg": mass, "damping_N_s_per_rad": damping, "basic_gradient_N_per_rad": 0.0}
    wheel = {
        "surface": "aileron",
        "travel_rad": 3.0,
        "drive": "displacement",
        "loader": loader,
        "schedule": {"dynamic_pressure_Pa": [0.0], "total_gradient_N_per_rad": [0.0]},
        "compensation": {"deflection": False, "gradient": False},
    }
    table = {"name": "joint", "frame_rate_Hz": 125.0, "controls": {"wheel": wheel}}
    return rig_from_table(table, "test"), Record(names, np.column_stack((time, force, place)))


@pytest.mark.parametrize("period_rad", [0.7, 0.21, 0.06])
def test_a_ripple_is_seen_in_the_force_of_an_imposed_motion(period_rad: float) -> None:
    """It was not sought there: a servo was named for the torque ripple of a robot's joint."""
    rig, record = moved_joint(period_rad)
    first = ripples(Reader(rig, record, "wheel", surface_points).outputs(), rig, "wheel")[0]
    assert first["period_{d}"] == pytest.approx(period_rad, rel=0.02)
    assert first["ripple_N"] == pytest.approx(RIPPLE["ripple_N"], rel=0.2)
    turn = first["phase_rad"] - RIPPLE["phase_rad"]
    assert abs(np.remainder(turn + np.pi, 2.0 * np.pi) - np.pi) < 1.0  # by a period a bit off


@pytest.mark.slow
def test_a_ripple_is_named_and_measured_under_an_imposed_motion() -> None:
    rig, record = moved_joint(0.21)
    found = diagnose(rig, {"r": record})
    [effect] = found.effects
    assert (found.verdict, effect.name) == ("effect", "friction_ripple")
    assert effect.value == pytest.approx(RIPPLE["ripple_N"], rel=0.05)
