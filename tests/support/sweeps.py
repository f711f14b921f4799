"""A sweep of nine pushes in two configurations."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from coupled.campaign.flights import fly_sweep
from coupled.campaign.journal import opened
from coupled.campaign.plan import SweepPlan, read_plan
from coupled.parallel import executor
from tests.support.runs import PUSH, SHORT

BEND = "rig.controls.column.loader.bend_m_per_N"
ASSUMED = "rig.controls.column.compensation.bend_m_per_N"
GRID = f"""
name = "s"
run = "push.toml"
configurations = ["uncompensated", "compensated"]
keep = ["loss"]
extremes = ["column_force_N"]
[[vary]]
key = "{BEND}"
also = ["{ASSUMED}"]
values = [2e-5, 4e-5, 8e-5]
[[vary]]
key = "pilot.column.force_N"
low = 20.0
high = 60.0
steps = 3
"""


def write_sweep(folder: Path) -> Path:
    """Write the runs and their sweep to a folder."""
    (folder / "push.toml").write_text(PUSH)
    (folder / "short.toml").write_text(SHORT)
    (folder / "s.toml").write_text(GRID)
    return folder


def plan_of(folder: Path, text: str = GRID) -> SweepPlan:
    (folder / "s.toml").write_text(text)
    return read_plan(folder / "s.toml")


def flown(plan: SweepPlan, folder: Path, workers: int = 1) -> pl.DataFrame:
    with executor(workers) as pool, opened(folder, plan) as journal:
        return fly_sweep(plan, journal, pool)


def rows_in(path: Path) -> int:
    return max(0, path.read_bytes().count(b"\n") - 1) if path.exists() else 0
