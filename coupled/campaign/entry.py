"""A flight of a sweep as a line of JSON in its journal, written and read back typed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from coupled.errors import InputError

Cell = bool | int | float | str
AS_FILED = "as filed"  # configuration name of an unchanged rig
SURVIVED = "survived"


@dataclass(frozen=True)
class Columns:
    """The columns of a sweep's journal and table: varied keys and figures.

    `flights` is the number of flights, `survive` whether survival is judged.
    """

    keys: tuple[str, ...]
    figures: tuple[str, ...]
    survive: bool
    flights: int

    @property
    def names(self) -> tuple[str, ...]:
        """The table's columns, in their order."""
        judged = (SURVIVED,) if self.survive else ()
        start = ("flight", *self.keys, "configuration", "seed")
        return (*start, *self.figures, *judged, "ended_early")


@dataclass(frozen=True)
class JournalEntry:
    """One flight of a sweep: its number, its changes and its results.

    `changes` are the varied values by key; `figures` in the units of their names, None if a flight
    has none; `survived` is None if it was not judged; `ended_early` is the reason, or empty.
    """

    flight: int
    changes: Mapping[str, Cell]
    configuration: str
    figures: Mapping[str, float | None]
    survived: bool | None
    seed: int | None
    ended_early: str

    def as_dict(self, columns: Columns) -> dict[str, Any]:
        """Return a line of the journal, or a row of the table."""
        row: dict[str, Any] = {"flight": self.flight, **self.changes}
        row["configuration"] = self.configuration
        row |= {name: self.figures[name] for name in columns.figures}
        if columns.survive:
            row[SURVIVED] = self.survived
        return {**row, "seed": self.seed, "ended_early": self.ended_early}

    def line(self, columns: Columns) -> str:
        """Return a line of JSON."""
        return json.dumps(self.as_dict(columns), ensure_ascii=False)


def read_entry(line: str, columns: Columns, file: object, place: str) -> JournalEntry:
    """Return the flight of a line of JSON.

    Raises InputError with `file` and `place` if the line is not one of this sweep.
    """
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        raise InputError(file, place, f"is not JSON; {_REMEDY}") from None
    if not isinstance(row, dict):
        raise InputError(file, place, f"is no line of a flight; {_REMEDY}")
    for name in columns.names:
        if name not in row:
            raise InputError(file, place, f"lacks {name}; {_REMEDY}")
    flight = row["flight"]
    if not _is_whole(flight) or not 0 <= flight < columns.flights:
        problem = f"flight {flight!r} is none of the sweep's 0 to {columns.flights - 1}; {_REMEDY}"
        raise InputError(file, place, problem)
    seed, survived = row["seed"], row.get(SURVIVED) if columns.survive else None
    right = {
        "configuration": isinstance(row["configuration"], str),
        "ended_early": isinstance(row["ended_early"], str),
        "seed": seed is None or _is_whole(seed),
        SURVIVED: survived is None or isinstance(survived, bool),
        **{key: isinstance(row[key], (bool, int, float, str)) for key in columns.keys},
        **{name: row[name] is None or _is_number(row[name]) for name in columns.figures},
    }
    for name, good in right.items():
        if not good:
            raise InputError(file, place, f"{name} is {row[name]!r}; {_REMEDY}")
    return JournalEntry(
        flight,
        {key: row[key] for key in columns.keys},
        row["configuration"],
        {name: row[name] for name in columns.figures},
        survived,
        seed,
        row["ended_early"],
    )


_REMEDY = "take the line out, and the flight is flown again, or give a new folder"


def _is_whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)
