"""How much faster a local dask cluster of two workers diagnoses a folder than one of one worker.

    COUPLED_RECORDS=1000 pytest -m bench tests/benchmarks/test_cluster.py -s

diagnoses so many records; without the variable, 16. Each is of a bench, of another seed: 15 s
without an effect, or 40 s with one of `MIXED` in turn. What has no effect is diagnosed in a tenth
of a second, so that the scheduler and what hands out work take a part of the two cores that counts.
The rate is counted from when every worker has given one answer, so that starting up is not in it.
"""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from coupled.gap.batch import jobs, run_all
from coupled.record.record import write_record
from coupled.rig.rigwrite import rig_text
from tests.support.benchmarks import keep
from tests.support.cluster import cluster
from tests.support.gaps import made, nominal_rig

pytestmark = pytest.mark.bench

RECORDS = max(16, int(os.environ.get("COUPLED_RECORDS", "0")))
WANTED = 1.9


MIXED: tuple[dict[str, dict[str, float]], ...] = (
    {},
    {"bend": {"bend_{d}_per_N": 2e-4}},
    {"coulomb_friction": {"friction_N": 3.0}},
    {"inertia": {"factor": 1.4}},
)


def folder_of(
    folder: Path, effects: Sequence[dict[str, dict[str, float]]], length_s: float
) -> Path:
    """Write a rig, and records of it that differ in their noise, with these effects in turn."""
    rig = nominal_rig(False)
    (folder / "rigs").mkdir()
    (folder / "rigs" / "mine.toml").write_text(rig_text(rig, "a bench"))
    names = [f"r{i:04d}" for i in range(RECORDS)]
    for i, name in enumerate(names):
        real = made(folder, rig, effects[i % len(effects)], i)
        write_record(real.between(0.0, length_s), folder / f"{name}.csv")
    (folder / "records.toml").write_text("".join(f'{name} = "mine"\n' for name in names))
    return folder


def rate(folder: Path, out: Path, workers: int) -> float:
    """Return the records a second of a cluster with so many workers."""
    times: list[float] = []
    with cluster(folder, workers) as address:
        run_all(jobs(folder, out), lambda *_: times.append(time.perf_counter()), cluster=address)
    begun = 2  # every worker has compiled, and answered, by then
    return (len(times) - begun) / (times[-1] - times[begun - 1])


@pytest.mark.parametrize(
    ("what", "effects", "length_s"),
    [("cluster, no effect", ({},), 15.0), ("cluster", MIXED, 40.0)],
)
def test_two_workers_of_a_cluster_diagnose_nearly_twice_as_fast(
    tmp_path: Path, what: str, effects: Sequence[dict[str, dict[str, float]]], length_s: float
) -> None:
    load = os.getloadavg()[0]
    folder = folder_of(tmp_path, effects, length_s)
    one, two = (rate(folder, tmp_path / f"by-{n}", n) for n in (1, 2))
    print(f"\n{what}, {RECORDS} records: {one:.2f} a second by one worker,", end=" ")
    print(f"{two:.2f} by two: {two / one:.2f}")
    keep(what, {"records": RECORDS, "one_per_s": one, "two_of_one": two / one}, load)
    assert two / one > WANTED * 0.9
