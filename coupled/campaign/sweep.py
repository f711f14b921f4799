"""A sweep: a run flown over values of its parameters, with one table of results."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from coupled.arguments import public
from coupled.authority.figures import sweep_remarks
from coupled.campaign.flights import fly_sweep
from coupled.campaign.journal import opened
from coupled.campaign.plan import SweepPlan, plan_from_table, planned_flights, read_plan
from coupled.campaign.sensitivity import SobolIndex, sensitivity
from coupled.campaign.survival import SurvivalLimit, limits
from coupled.errors import InputError
from coupled.flight.pilot.own import Law, given_laws
from coupled.parallel import cores, executor
from coupled.record import csvfile
from coupled.resources import find, shipped_sweeps
from coupled.results import TableResult
from coupled.rig.guesses import guess_note

Progress = Callable[[str, int, int], None]
TABLE = "table.parquet"


@dataclass(frozen=True)
class SweepResult(TableResult):
    """The flights of a sweep, a row each, with their analysis.

    `table` has the varied keys, the configuration, the figures, and why a flight ended early;
    units are in the names. `indices` are those of a sensitivity sweep, `limits` the boundaries of
    survival, if requested. `found` flights were in the folder before.
    """

    plan: SweepPlan
    table: pl.DataFrame
    indices: tuple[SobolIndex, ...]
    limits: tuple[SurvivalLimit, ...]
    found: int

    def __repr__(self) -> str:
        ended = int((self.table["ended_early"] != "").sum())
        over = ", ".join(self.plan.keys)
        flights = f"{len(self.table)} flights over {over}, {ended} ended early"
        return f"SweepResult({self.plan.sweep.name}: {flights})"

    def to_polars(self) -> pl.DataFrame:
        """Return the table, a row for each flight."""
        return self.table

    @property
    def remarks(self) -> list[str]:
        """Explanations of the losses, and guesses of the rig, by the first flight's rig."""
        asked = self.plan.sweep
        first = planned_flights(self.plan)[0]
        try:
            flown = self.plan.scenario(first.changes)
        except InputError:  # a flight that cannot be flown, as the table says
            return []
        keys = [key for one in asked.vary for key in (one.key, *one.also)]
        note = guess_note(flown.rig.controls, (), [key.removeprefix("rig.") for key in keys])
        losses = {"loss", "loss_closed_form"} & set(asked.keep)
        said = sweep_remarks(flown, asked.configurations) if losses else []
        return [*said, *([note] if note else [])]

    @property
    def numeric_keys(self) -> list[str]:
        """The varied keys whose values are numbers."""
        return [key for key in self.plan.keys if self.table[key].dtype.is_numeric()]


@public
def sweep(
    plan: SweepPlan | Mapping[str, Any] | Path | str,
    folder: Path | str | None = None,
    workers: int | None = None,
    cluster: str = "",
    progress: Progress | None = None,
    begun: Callable[[int, int], None] | None = None,
    *,
    column: Law | None = None,
    wheel: Law | None = None,
    pedals: Law | None = None,
) -> SweepResult:
    """Fly a run over values of its parameters, and return a row for each flight.

    `plan` is a sweep file, the name of a shipped one, or the tables of one. Each flight is stored
    in `folder` when it is done, and a later call resumes there; by default nothing is stored.
    `workers` are processes (default: all cores; 1 flies in this process), `cluster` the address of
    a dask scheduler. `progress` is called with a text, flights done and to do; `begun` once, with
    the flights in the folder and those of the sweep. A function on `column`, `wheel` or `pedals` is
    the pilot in place of the run's, as in `fly`; it must be one that can be pickled. Raises
    InputError for an invalid sweep, or a folder with another.

    >>> import coupled
    >>> bends = {"key": "rig.controls.column.loader.bend_m_per_N", "values": [1e-5, 9e-5]}
    >>> found = coupled.sweep(
    ...     {
    ...         "name": "bends",
    ...         "run": "appendix-c",
    ...         "configurations": ["uncompensated"],
    ...         "vary": [bends],
    ...     },
    ...     workers=1,
    ... )
    >>> found.to_polars()["loss"].round(3).to_list()
    [0.018, 0.142]
    """
    if isinstance(plan, Mapping):
        plan = plan_from_table(plan, Path("sweep"))
    elif not isinstance(plan, SweepPlan):
        plan = read_plan(find(str(plan), shipped_sweeps(), "sweep"))
    plan = plan.flown_by(given_laws(column, wheel, pedals, "coupled.sweep"))
    with ExitStack() as stack:
        kept = Path(folder) if folder is not None else None
        place = kept or Path(stack.enter_context(tempfile.TemporaryDirectory())) / "sweep"
        pool = stack.enter_context(executor(cores(workers or 0), cluster))
        journal = stack.enter_context(opened(place, plan))
        found = len(journal.done)
        if begun is not None:
            begun(found, plan.columns.flights)
        table = fly_sweep(plan, journal, pool, progress)
        if kept is not None:
            write_table(table, kept / TABLE)
    return judged(plan, table, found)


def judged(plan: SweepPlan, table: pl.DataFrame, found: int = 0) -> SweepResult:
    """Return a sweep's result from its table, with the indices or limits that it requests."""
    asked = plan.sweep
    indices: list[SobolIndex] = []
    if asked.method == "sensitivity" and asked.samples is not None:
        indices = sensitivity(table, plan.keys, asked.keep, asked.samples)
    result = SweepResult(plan, table, tuple(indices), (), found)
    numeric = result.numeric_keys
    alive = limits(table, numeric[0]) if asked.survive and numeric else []
    return SweepResult(plan, table, tuple(indices), tuple(alive), found)


def write_table(found: pl.DataFrame, path: Path) -> None:
    """Write a table as Parquet, atomically."""
    csvfile.write_table(found, path)
