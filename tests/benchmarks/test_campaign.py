"""How fast a sweep flies beside bare JSBSim, what a second worker adds, and whether memory is flat.

Run alone, with its figures printed, on an idle machine:

    COUPLED_FLIGHTS=10000 pytest -m bench tests/benchmarks/test_campaign.py -s

flies 10,000; without the variable, 1000, which is the fewest that can be judged by.
Each flight is 20 s of the report's column on a T-37. Bare JSBSim loads and trims the same model
for each flight and takes the same steps, in as many processes; a sweep trims for each flight, too,
but loads a T-37 once a process. Rates are counted from the first
flight done, so that starting up is not in them. The second test counts processor time, which a
busy machine changes little.
"""

from __future__ import annotations

import multiprocessing
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import repeat
from pathlib import Path

import polars as pl
import pytest

from coupled.campaign.journal import JOURNAL
from coupled.flight.airframe import JSBSimAirframe
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.benchmarks import keep

resource = pytest.importorskip("resource")  # not on Windows
pytestmark = pytest.mark.bench

ENOUGH = 1000  # flights: fewer are over before memory could grow, or a rate be sure
FLIGHTS = max(ENOUGH, int(os.environ.get("COUPLED_FLIGHTS", "0")))
SECONDS = 20.0
SWEEP = """
name = "many"
run = "worst-case-t37"
configurations = ["uncompensated"]
method = "sobol"
samples = {flights}
seed = 1
[[vary]]
key = "rig.controls.column.loader.bend_m_per_N"
low = 2e-5
high = 1.2e-4
[[vary]]
key = "pilot.column.deflection_m"
low = 0.02
high = 0.05
[[vary]]
key = "duration_s"
values = [{seconds}]
"""


@dataclass(frozen=True)
class Watched:
    """A sweep as it was watched from outside: flights a second, and memory at each quarter.

    `parent_MB` and `worker_MB` are resident, at start, quarters and end; that of the largest
    worker, or none.
    """

    rate: float
    taken_s: float
    parent_MB: list[float]
    worker_MB: list[float]


def resident_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def workers_of(pid: int) -> list[int]:
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(status.read_text().rpartition(")")[2].split()[1])
        except (OSError, IndexError):
            continue  # it has ended
        if parent == pid:
            found.append(int(status.parent.name))
    return found


def watch(folder: Path, workers: int, flights: int) -> Watched:
    """Fly a sweep and look at its journal and memory meanwhile."""
    (folder / f"{workers}.toml").write_text(SWEEP.format(flights=flights, seconds=SECONDS))
    words = ["sweep", f"{workers}.toml", "--folder", str(workers), "-j", str(workers)]
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "coupled", *words], cwd=folder, stdout=subprocess.DEVNULL
    )
    journal, done = folder / str(workers) / JOURNAL, 0
    rows: list[tuple[float, int]] = []
    parent: list[float] = []
    worker: list[float] = []
    while process.poll() is None:
        done = max(0, journal.read_bytes().count(b"\n") - 1) if journal.exists() else 0
        if done:
            rows.append((time.perf_counter(), done))
        # The last look is ahead of the end, where the table is made and drawn.
        if done >= max(1, len(parent) * (flights - max(4, flights // 20)) // 4) and len(parent) < 5:
            try:
                inside = max((resident_mb(each) for each in workers_of(process.pid)), default=0.0)
                parent.append(resident_mb(process.pid))
                worker.append(inside)
            except OSError:
                break  # it has just ended
        time.sleep(0.2)
    assert process.wait() == 0
    (first_s, first), (last_s, last) = rows[0], next(r for r in rows if r[1] == rows[-1][1])
    rate = (last - first) / (last_s - first_s) if last > first else float("nan")
    return Watched(rate, time.perf_counter() - start, parent, worker)


def bare(count: int, frames: int) -> float:
    """Load, trim and run a T-37 so many times; return what one second of that flies."""
    rig = read_rig(shipped_rigs()["report-column"])
    assert rig.flight is not None
    start = time.perf_counter()
    for _ in range(count):
        run = JSBSimAirframe(rig.flight, 1.0 / rig.frame_rate)._fdm.run
        for _ in range(frames):
            run()
    return count / (time.perf_counter() - start)


def bare_rate(workers: int, flights: int) -> float:
    """Return the flights a second of bare JSBSim in so many processes at once."""
    frames = round(SECONDS * read_rig(shipped_rigs()["report-column"]).frame_rate)
    each = max(4, flights // workers)
    with ProcessPoolExecutor(workers, multiprocessing.get_context("spawn")) as pool:
        list(pool.map(bare, [1] * workers, repeat(2)))  # start up
        return sum(pool.map(bare, [each] * workers, repeat(frames)))


def shown(sizes: Sequence[float]) -> str:
    return ", ".join(f"{size:.0f}" for size in sizes)


def test_a_sweeps_rate_and_memory(tmp_path: Path) -> None:
    if len(os.sched_getaffinity(0)) < 2:
        pytest.skip("two workers need two cores")
    load = os.getloadavg()[0]
    two = watch(tmp_path, 2, FLIGHTS)
    print(f"\n{FLIGHTS} flights of {SECONDS:g} s, two workers: {two.taken_s:.1f} s")
    print(f"  two workers      {two.rate:6.1f} flights/s")
    print(f"  parent, MB at start, quarters, end: {shown(two.parent_MB)}")
    print(f"  larger worker, MB:                  {shown(two.worker_MB)}")
    table = pl.read_parquet(tmp_path / "2" / "table.parquet")
    assert len(table) == FLIGHTS
    assert table["ended_early"].eq("").all()
    # Flat from the first quarter on: caches are full then.
    for sizes in (two.parent_MB, two.worker_MB):
        assert sizes[-1] - sizes[1] < 10.0
    fewer = FLIGHTS // 4
    one, beside = watch(tmp_path, 1, fewer), bare_rate(2, fewer)
    print(f"  one              {one.rate:6.1f}; two are {two.rate / one.rate:.2f} times one")
    print(f"  bare JSBSim, two {beside:6.1f}; a sweep flies {two.rate / beside:.2f} of it")
    # A Sobol sequence of fewer points is the beginning of one of more.
    assert pl.read_parquet(tmp_path / "1" / "table.parquet").equals(table.head(fewer))
    figures = {"flights": FLIGHTS, "seconds": SECONDS, "taken_s": two.taken_s}
    figures |= {"two_of_one": two.rate / one.rate, "of_bare": two.rate / beside}
    keep("sweep", figures, load)
    assert two.rate / one.rate > 1.8


def processor_s(folder: Path, workers: int, flights: int) -> float:
    """Fly a sweep, and return the processor time of all its processes, s."""
    name = f"{workers}-{flights}"
    (folder / f"{name}.toml").write_text(SWEEP.format(flights=flights, seconds=SECONDS))
    words = ["sweep", f"{name}.toml", "--folder", name, "-j", str(workers)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "coupled", *words], cwd=folder, stdout=subprocess.DEVNULL, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return float(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def test_what_a_second_worker_and_the_rig_cost_of_processor_time(tmp_path: Path) -> None:
    """Without what waits for a disk or another core; so other work changes little of it.

    Two workers that share nothing take for a flight what one takes, and are twice as fast.
    """
    frames = round(SECONDS * read_rig(shipped_rigs()["report-column"]).frame_rate)
    few, many, load = 60, 360, os.getloadavg()[0]
    processor_s(tmp_path, 1, 2)  # compiles, if need be
    one, two, beside = list[float](), list[float](), list[float]()
    for turn in range(3):
        folder = tmp_path / str(turn)
        folder.mkdir()
        for workers, found in ((1, one), (2, two)):
            starting = processor_s(folder, workers, few)
            found.append((processor_s(folder, workers, many) - starting) / (many - few))
        start = time.thread_time()
        bare(few, frames)
        beside.append((time.thread_time() - start) / few)
    figures = {"two_of_one": 2.0 * min(one) / min(two), "of_bare": min(beside) / min(one)}
    print(f"\na flight {1e3 * min(one):.1f} ms, with two workers {1e3 * min(two):.1f} ms,")
    print(f"bare JSBSim {1e3 * min(beside):.1f} ms: {figures}")
    keep("sweep, processor time", figures, load)
    assert figures["two_of_one"] > 1.8
    assert figures["of_bare"] > 0.68
