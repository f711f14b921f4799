"""A sweep flown: a row a flight, kept as soon as it is done, and one table at the end.

The rows depend on the sweep's file alone, not on who flew them or in which order.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, as_completed, wait
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.authority.compare import judge
from coupled.campaign.journal import Journal, Row
from coupled.campaign.plan import Job, Plan, Survive, jobs
from coupled.errors import InputError
from coupled.files import write_whole
from coupled.flight.loop import fly
from coupled.record.record import Record

Progress = Callable[[str, int, int], None]
AS_FILED = "as filed"
TABLE = "table.parquet"
SURVIVED = "survived"
_AHEAD = 64  # flights that wait for a worker


def fly_job(plan: Plan, job: Job) -> Row:
    """Return the row of one flight; why it ended early, or could not be flown, is in it."""
    sweep = plan.sweep
    row: Row = {"flight": job.number}
    row |= {key: _cell(job.changes[key]) for key in plan.keys}
    row["configuration"] = job.configuration or AS_FILED
    row |= dict.fromkeys((*sweep.keep, *_extreme_names(sweep.extremes)))
    row |= {SURVIVED: None} if sweep.survive else {}
    try:
        scenario = plan.scenario(job.changes)
        if job.seed is not None:
            scenario = replace(scenario, seed=job.seed)
        row["seed"] = scenario.seed
        if job.configuration:
            scenario = scenario.configured(job.configuration)
        record = fly(scenario)
    except InputError as error:
        return {**row, "seed": row.get("seed"), "ended_early": f"not flown: {error.problem}"}
    ended = record.manifest["ended_early"]
    if ended and ended["reason"] == "interrupted":
        raise KeyboardInterrupt
    outcome = judge(scenario, job.configuration or AS_FILED, record).as_dict()
    row |= {name: outcome[name] for name in sweep.keep}
    row |= _extremes(record, sweep.extremes)
    if sweep.survive:
        row[SURVIVED] = not ended and all(_kept(record[s.channel], s) for s in sweep.survive)
    return {**row, "ended_early": outcome["ended_early"]}


def fly_sweep(
    plan: Plan, journal: Journal, pool: Executor, progress: Progress | None = None
) -> pl.DataFrame:
    """Fly what the journal lacks, and return the table, a row a flight in their order.

    `progress` is called with flights done and to do since this began, so that the time left
    is judged by what is flown now.
    """
    todo = [job for job in jobs(plan) if job.number not in journal.done]
    every = len(journal.done) + len(todo)
    for done, row in enumerate(_rows(plan, todo, pool), 1):
        journal.add(row)
        if progress is not None:
            progress(f"{len(journal.done)} of {every} flights", done, len(todo))
    return table(plan, journal.rows())


def _rows(plan: Plan, todo: Sequence[Job], pool: Executor) -> Iterator[Row]:
    """Yield each row as soon as its flight is done; a bounded number of flights waits."""
    waiting: set[Future[Row]] = set()
    packed = pickle.dumps(plan)
    for job in todo:
        waiting.add(pool.submit(_fly_packed, packed, job))
        patience_s = None if len(waiting) >= _AHEAD else 0.0
        done, waiting = wait(waiting, patience_s, FIRST_COMPLETED)
        yield from (future.result() for future in done)
    yield from (future.result() for future in as_completed(waiting))


def _fly_packed(packed: bytes, job: Job) -> Row:
    """Fly a job of a plan that is sent as bytes, which costs nothing to send again."""
    return fly_job(_unpacked(packed), job)


@lru_cache(maxsize=1)
def _unpacked(packed: bytes) -> Plan:
    plan: Plan = pickle.loads(packed)
    return plan


def table(plan: Plan, rows: Sequence[Row]) -> pl.DataFrame:
    """Return the table of rows, as they stand; numbers as doubles."""
    sweep = plan.sweep
    numbers = [*sweep.keep, *_extreme_names(sweep.extremes)]
    columns: dict[str, pl.Series] = {}
    alive = [SURVIVED] if sweep.survive else []
    for name in ("flight", *plan.keys, "configuration", "seed", *numbers, *alive, "ended_early"):
        values = [row[name] for row in rows]
        kind: Any = pl.Float64 if name in numbers else pl.Int64
        if name in plan.keys:
            real = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values)
            kind = pl.Float64 if real else pl.String
            values = [v if v is None or real else str(v) for v in values]
        elif name in ("configuration", "ended_early"):
            kind = pl.String
        elif name == SURVIVED:
            kind = pl.Boolean
        columns[name] = pl.Series(name, values, dtype=kind, strict=False)
    return pl.DataFrame(columns)


def write_table(found: pl.DataFrame, path: Path) -> None:
    """Write a table as Parquet, whole."""
    write_whole(path, found.write_parquet)


def _cell(value: Any) -> Any:
    """Return a varied value as a cell takes it: a number or word as it is, else as JSON."""
    return value if isinstance(value, (int, float, str)) else json.dumps(value, default=str)


def _kept(values: NDArray[np.float64], survive: Survive) -> bool:
    low = -np.inf if survive.least is None else survive.least
    high = np.inf if survive.most is None else survive.most
    return bool(np.all((values >= low) & (values <= high)))


def _extreme_names(channels: Sequence[str]) -> list[str]:
    return [f"{which}_{name}" for name in channels for which in ("least", "greatest")]


def _extremes(record: Record, channels: Sequence[str]) -> dict[str, float | None]:
    if not len(record):
        return dict.fromkeys(_extreme_names(channels))
    found = [f(record[name]) for name in channels for f in (np.min, np.max)]
    return dict(zip(_extreme_names(channels), map(float, found), strict=True))
