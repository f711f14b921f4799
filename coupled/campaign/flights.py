"""The flights of a sweep: a row each, written to disk within a quarter second, and one table.

The rows depend on the sweep's file only, not on the workers or the order.
"""

from __future__ import annotations

import json
import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.authority.compare import judge
from coupled.campaign.entry import AS_FILED, SURVIVED, Cell, JournalEntry
from coupled.campaign.journal import Journal
from coupled.campaign.plan import PlannedFlight, SweepPlan, extreme_names, planned_flights
from coupled.campaign.sweepfile import Survive
from coupled.errors import InputError
from coupled.flight.aircraftcache import AircraftCache
from coupled.flight.loop import fly
from coupled.parallel import as_done
from coupled.record.record import Record

Progress = Callable[[str, int, int], None]
_AHEAD = 64  # blocks in the queue of the workers
_BLOCK_s = 0.25  # flying time of a block: the most that a killed worker loses
_SHARE = 16  # a block has at most 1/16 of the remaining flights, so that all workers end together


def fly_planned(
    plan: SweepPlan, flight: PlannedFlight, cache: AircraftCache | None = None
) -> JournalEntry:
    """Return the results of one flight, with the reason if it ended early or could not be flown.

    A `cache` keeps its aircraft for the next flight.
    """
    sweep, columns = plan.sweep, plan.columns
    entry = JournalEntry(
        flight.number,
        {key: _cell(flight.changes[key]) for key in plan.keys},
        flight.configuration or AS_FILED,
        dict.fromkeys(columns.figures),
        None,
        None,
        "",
    )
    try:
        scenario = plan.scenario(flight.changes)
        if flight.seed is not None:
            scenario = replace(scenario, seed=flight.seed)
        entry = replace(entry, seed=scenario.seed)
        if flight.configuration:
            scenario = scenario.configured(flight.configuration)
        record = fly(scenario, cache=cache, stops=True)
    except InputError as error:
        return replace(entry, ended_early=f"not flown: {error.problem}")
    ended = record.manifest["ended_early"]
    if ended and ended["reason"] == "interrupted":
        raise KeyboardInterrupt
    closed_forms = any("closed_form" in name for name in sweep.keep)
    outcome = judge(scenario, entry.configuration, record, closed_forms).as_dict()
    figures = {name: outcome[name] for name in sweep.keep} | _extremes(record, sweep.extremes)
    survived = None
    if sweep.survive:
        survived = not ended and all(_kept(record[s.channel], s) for s in sweep.survive)
    why = outcome["ended_early"]
    return replace(entry, figures=figures, survived=survived, ended_early=why)


def fly_sweep(
    plan: SweepPlan, journal: Journal, pool: Executor, progress: Progress | None = None
) -> pl.DataFrame:
    """Fly the flights that the journal lacks, and return the table, a row for each flight.

    `progress` is called with flights done and to do since this call, for the remaining time.
    """
    todo = [flight for flight in planned_flights(plan) if flight.number not in journal.done]
    every = len(journal.done) + len(todo)
    packed, done, flying_s = pickle.dumps(plan), 0, 0.0

    def blocks() -> Iterator[tuple[bytes, list[PlannedFlight]]]:
        begun = 0
        while begun < len(todo):
            # The overhead of a flight is a tenth of a short one, so several are sent together.
            size = int(_BLOCK_s * done / flying_s) if flying_s else 1
            end = begun + max(1, min(size, (len(todo) - begun) // _SHARE))
            yield packed, todo[begun:end]
            begun = end

    for entries, seconds in as_done(pool, _fly_block, blocks(), _AHEAD):
        journal.add(*entries)
        done, flying_s = done + len(entries), flying_s + seconds
        if progress is not None:
            progress(f"{len(journal.done)} of {every} flights", done, len(todo))
    return table(plan, journal.entries())


def _fly_block(packed: bytes, flights: Sequence[PlannedFlight]) -> tuple[list[JournalEntry], float]:
    """Fly some flights of a plan that is sent as bytes, pickled only once.

    Return the entries, and the time they took, s.
    """
    start = time.perf_counter()
    plan, cache = _unpacked(packed)
    entries = [fly_planned(plan, flight, cache) for flight in flights]
    return entries, time.perf_counter() - start


@lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> tuple[SweepPlan, AircraftCache]:
    """Return a plan, and this worker's cache of aircraft."""
    try:
        return pickle.loads(packed), AircraftCache()
    except (AttributeError, ImportError) as error:
        problem = f"a function of the sweep is not found by its workers ({error}); define it in a"
        raise InputError("coupled.sweep", "", f"{problem} module that they can import") from None


def table(plan: SweepPlan, entries: Sequence[JournalEntry]) -> pl.DataFrame:
    """Return the table of flights in their order; numbers as doubles."""
    columns = plan.columns
    rows = [entry.as_dict(columns) for entry in entries]
    kinds = dict.fromkeys(columns.figures, pl.Float64)
    made: dict[str, pl.Series] = {}
    for name in columns.names:
        values = [row[name] for row in rows]
        kind: Any = kinds.get(name, pl.Int64)
        if name in columns.keys:
            real = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
            kind = pl.Float64 if real else pl.String
            values = [v if v is None or real else str(v) for v in values]
        elif name in ("configuration", "ended_early"):
            kind = pl.String
        elif name == SURVIVED:
            kind = pl.Boolean
        made[name] = pl.Series(name, values, dtype=kind, strict=False)
    return pl.DataFrame(made)


def _cell(value: Any) -> Cell:
    """Return a varied value as a cell: a number or word unchanged, anything else as JSON."""
    return value if isinstance(value, (int, float, str)) else json.dumps(value, default=str)


def _kept(values: NDArray[np.float64], survive: Survive) -> bool:
    low = -np.inf if survive.least is None else survive.least
    high = np.inf if survive.most is None else survive.most
    return bool(np.all((values >= low) & (values <= high)))


def _extremes(record: Record, channels: Sequence[str]) -> dict[str, float | None]:
    if not len(record):
        return dict.fromkeys(extreme_names(channels))
    found = [f(record[name]) for name in channels for f in (np.min, np.max)]
    return dict(zip(extreme_names(channels), map(float, found), strict=True))
