"""A pilot's force from a table: of a file, or of arrays."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np

from coupled.arguments import public
from coupled.errors import InputError, nearest
from coupled.flight.pilot.base import STRONGEST, Action, Floats, Pilot, Start, Values
from coupled.record.channels import TIME, ControlName, channel
from coupled.record.csvfile import read_columns
from coupled.rig.rig import Rig
from coupled.schema import quantity


@public
class ForceTable(Pilot):
    """A force over time, linear between rows, from arrays or from a file.

    Arrays: `time_s` and `force_N`, of one length. A file: a CSV with `time_s` and the control's
    force channel, such as `column_force_N`. `start_s` is added to the times; outside of them the
    force is zero. Raises InputError for times that do not rise, gaps, and more than 5000 N.

    >>> import coupled
    >>> push = coupled.ForceTable(time_s=[0.0, 1.0, 2.0], force_N=[0.0, -30.0, 0.0])
    >>> flight = coupled.fly("t37", column=push, duration_s=3)
    >>> float(flight.record["column_force_N"].min())
    -30.0
    """

    kind: Literal["table"] = "table"
    file: str = ""
    time_s: Values = quantity("", [])
    force_N: Values = quantity("", [])
    start_s: float = quantity("", 0.0, ge=0, le=7200)

    def beside(self, folder: Path) -> ForceTable:
        """Return this pilot with its file in a folder."""
        given: dict[str, Any] = {key: getattr(self, key) for key in self.model_fields_set}
        return ForceTable(**{**given, "file": str(folder / self.file)})

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Refuse a table that cannot be read, or with times that do not rise."""
        super().check(rig, control, file)
        place = f"pilot.{control}"
        given = self.model_fields_set & {"time_s", "force_N"}
        if self.file and given:
            raise InputError(file, f"{place}.file", "is given with time_s and force_N; give either")
        if self.file:
            read_force_table(Path(self.file), channel(control, "force"))
            return
        if not given:
            raise InputError(file, place, "needs a file, or time_s and force_N")
        if len(self.time_s) != len(self.force_N):
            problem = f"has {len(self.force_N)} values, time_s {len(self.time_s)}; give as many"
            raise InputError(file, f"{place}.force_N", problem)
        keys = (f"{place}.time_s", f"{place}.force_N")
        _check_rows(np.array(self.time_s), np.array(self.force_N), file, keys, 0)

    def begins(self, control: ControlName) -> tuple[str, float]:
        """Return the key that gives when the table begins, and that time in s."""
        first = float(self._rows(control)[0][0])
        key = "file" if self.file else "time_s"
        return key if first > self.start_s else "start_s", self.start_s + first

    def _rows(self, control: ControlName) -> tuple[Floats, Floats]:
        """Return the times in s and the forces in N."""
        if self.file:
            return read_force_table(Path(self.file), channel(control, "force"))
        return np.array(self.time_s), np.array(self.force_N)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the table's force."""
        times, forces = self._rows(control)

        def force(t: Floats) -> Floats:
            found = np.interp(t - self.start_s, times, forces, left=0.0, right=0.0)
            return np.asarray(found)

        return Action(force=force)


def read_force_table(path: Path, wanted: str) -> tuple[Floats, Floats]:
    """Return times in s and forces in N of a CSV; faults name the row."""
    columns = read_columns(path)
    for name in (TIME, wanted):
        if name not in columns:
            raise InputError(path, name, f"no such column; {nearest(name, columns)}")
    times, forces = columns[TIME], columns[wanted]
    _check_rows(times, forces, path, (TIME, wanted), 2)  # the second line of a file is row 2
    return times, forces


def _check_rows(
    times: Floats, forces: Floats, file: object, keys: tuple[str, str], first: int
) -> None:
    """Refuse times that do not rise, excessive forces, missing rows; `first` is a row number."""
    time_key, force_key = keys
    if np.max(np.abs(forces), initial=0.0) > STRONGEST:
        raise InputError(file, force_key, f"holds more than {STRONGEST:g} N, which no pilot can")
    if len(times) < 2:
        raise InputError(file, time_key, "needs at least two rows")
    disorder = np.flatnonzero(np.diff(times) <= 0.0)
    if disorder.size:
        raise InputError(file, time_key, f"must rise: row {disorder[0] + 1 + first} does not")
    _refuse_gaps(times, file, time_key, first)


def _refuse_gaps(times: Floats, file: object, key: str, first: int) -> None:
    """Refuse a sampled table with missing rows; a few typed breakpoints may have any spacing."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    if np.mean(np.abs(steps - usual) < 0.02 * usual) < 0.8:
        return
    wide = np.flatnonzero(steps > 1.5 * usual)
    if wide.size:
        row = wide[0]
        problem = f"gap of {steps[row]:g} s after row {row + first} in a table of {usual:g} s steps"
        raise InputError(file, key, f"{problem}; fill it")
