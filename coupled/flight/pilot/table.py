"""A pilot's force from a table."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np

from coupled.errors import InputError, nearest
from coupled.flight.pilot.base import STRONGEST, Action, Floats, Pilot
from coupled.record.channels import TIME, channel
from coupled.record.csvfile import read_columns
from coupled.rig.parameters import Control
from coupled.schema import quantity


class Table(Pilot):
    """A force from a CSV with `time_s` and the control's force channel, straight between rows.

    `start_s` is added to the table's times; outside of them the force is zero.
    """

    kind: Literal["table"]
    file: str
    start: float = quantity("s", 0.0, ge=0, le=7200)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the table's force."""
        times, forces = read_force_table(folder / self.file, channel(name, "force"))
        return Action(force=lambda t: np.interp(t - self.start, times, forces, left=0.0, right=0.0))


def read_force_table(path: Path, wanted: str) -> tuple[Floats, Floats]:
    """Return times in s and forces in N of a CSV; gaps and disorder are refused by row."""
    columns = read_columns(path)
    for name in (TIME, wanted):
        if name not in columns:
            raise InputError(path, name, f"no such column; {nearest(name, columns)}")
    times, forces = columns[TIME], columns[wanted]
    if np.max(np.abs(forces), initial=0.0) > STRONGEST:
        raise InputError(path, wanted, f"holds more than {STRONGEST:g} N, which no pilot can")
    if len(times) < 2:
        raise InputError(path, TIME, "needs at least two rows")
    disorder = np.flatnonzero(np.diff(times) <= 0.0)
    if disorder.size:
        raise InputError(path, TIME, f"must rise: row {disorder[0] + 3} does not")
    _refuse_gaps(times, path)
    return times, forces


def _refuse_gaps(times: Floats, path: Path) -> None:
    """Refuse a sampled table with missing rows; a few typed breakpoints may lie as they like."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    if np.mean(np.abs(steps - usual) < 0.02 * usual) < 0.8:
        return
    wide = np.flatnonzero(steps > 1.5 * usual)
    if wide.size:
        row = wide[0]
        raise InputError(
            path,
            TIME,
            f"gap of {steps[row]:g} s after row {row + 2} in a table of {usual:g} s steps; fill it",
        )
