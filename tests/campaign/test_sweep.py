"""Sweeps: the same table from any number of workers, through kills and bad rows."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from coupled.campaign.flights import fly_planned, fly_sweep
from coupled.campaign.journal import JOURNAL, opened
from coupled.campaign.plan import planned_flights, read_plan
from coupled.campaign.sweep import sweep, write_table
from coupled.display import parameter_label
from coupled.files import unfinished_name
from coupled.parallel import executor
from coupled.plots.campaign import draw_sweep
from coupled.plots.saving import save
from tests.support.cluster import cluster
from tests.support.commands import coupled, files
from tests.support.processes import PATIENCE_s, begun, ended, kill
from tests.support.sweeps import BEND, GRID, flown, plan_of, rows_in, write_sweep

DRAW = f"""
name = "s"
run = "push.toml"
method = "sobol"
samples = 12
seed = 5
keep = ["loss"]
[[vary]]
key = "{BEND}"
low = 2e-5
high = 8e-5
spread = "log"
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_sweep(tmp_path)


def test_a_grids_losses_are_those_of_the_closed_form(folder: Path) -> None:
    plan = plan_of(folder, GRID + '[[vary]]\nkey = "duration_s"\nvalues = [3]\n')
    found = flown(plan, folder / "o")
    assert len(found) == 18
    assert found["flight"].to_list() == list(range(18))
    assert set(found["ended_early"]) == {""}
    force = found["pilot.column.force_N"].to_numpy()
    np.testing.assert_allclose(found["greatest_column_force_N"], force, rtol=1e-9)
    bend, plain = found[BEND].to_numpy(), found["configuration"].to_numpy() == "uncompensated"
    # The bench's breakout is 9 N, and its first segment 2189 N/m: of δ = δc + K·F, K·F is lost.
    deflection = (force - 9.0) / 2189.0 + bend * force
    expected = np.where(plain, bend * force / deflection, 0.0)
    first = np.flatnonzero(force < 50.0)
    np.testing.assert_allclose(found["loss"].to_numpy()[first], expected[first], atol=2e-3)


def test_the_same_seed_gives_the_same_points_and_another_others(folder: Path) -> None:
    one, two = (planned_flights(plan_of(folder, DRAW)) for _ in range(2))
    assert one == two
    values = [job.changes[BEND] for job in one]
    assert len(values) == 12
    assert all(2e-5 <= value <= 8e-5 for value in values)
    # A Sobol sequence lies evenly: of 8 points one in each eighth of the logarithm.
    eighths = np.floor(8.0 * np.log(np.array(values[:8]) / 2e-5) / np.log(4.0))
    assert sorted(eighths) == list(range(8))
    other = planned_flights(plan_of(folder, DRAW.replace("seed = 5", "seed = 6")))
    assert [job.changes for job in other] != [job.changes for job in one]
    reseeded = planned_flights(plan_of(folder, DRAW.replace("seed = 5", "seed = 5\nreseed = true")))
    assert len({job.seed for job in reseeded}) == 12


@pytest.mark.slow
def test_one_worker_and_two_make_the_same_bytes(folder: Path) -> None:
    done = coupled(folder, "sweep", "s.toml", "--folder", "two", "-j", "2")
    assert done.returncode == 0, done.stderr
    assert "(18 flights)" in done.stdout
    assert files(folder / "two") == {".lock", JOURNAL, "table.parquet", "sweep.png"}
    write_table(flown(plan_of(folder), folder / "one"), folder / "one.parquet")
    assert (folder / "one.parquet").read_bytes() == (folder / "two/table.parquet").read_bytes()
    again = coupled(folder, "sweep", "s.toml", "--folder", "two", "--json", "-", "-j", "1")
    assert "all 18 flights are there already; none is flown again" in again.stderr
    assert len(json.loads(again.stdout)) == 18


def begun_sweep(folder: Path, workers: int) -> subprocess.Popen[bytes]:
    """Return a sweep of 120 flights once it has a few of them."""
    many = GRID.replace("steps = 3", "steps = 20")
    many += '[[vary]]\nkey = "duration_s"\nvalues = [6.0]\n'
    (folder / "many.toml").write_text(many.replace('name = "s"', 'name = "many"'))
    words = ("sweep", "many.toml", "--folder", "o", "-j", str(workers))
    return begun(folder, *words, until=lambda: rows_in(folder / "o" / JOURNAL) >= 5)


@pytest.mark.slow
def test_a_killed_sweep_goes_on_and_repeats_no_flight(folder: Path) -> None:
    kill(begun_sweep(folder, workers=2))
    kept = rows_in(folder / "o" / JOURNAL)
    assert 5 <= kept < 120
    before = (folder / "o" / JOURNAL).read_bytes()
    before = before[: before.rfind(b"\n") + 1]
    with (folder / "o" / JOURNAL).open("ab") as file:
        file.write(b'{"flight": 119, "lo')  # as a kill in the middle of a line leaves it
    plan = read_plan(folder / "many.toml")
    found = flown(plan, folder / "o")
    after = (folder / "o" / JOURNAL).read_bytes()
    assert after.startswith(before)
    flights = [json.loads(line)["flight"] for line in after.splitlines()[1:]]
    assert sorted(flights) == list(range(120))
    fresh = {
        job.number: fly_planned(plan, job).as_dict(plan.columns)
        for job in planned_flights(plan)[::40]
    }
    for number, row in fresh.items():
        assert found.row(number, named=True) == row


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM], ids=["SIGINT", "SIGTERM"])
def test_workers_end_with_an_interrupted_sweep_and_what_is_flown_is_kept(
    folder: Path, how: signal.Signals
) -> None:
    process = begun_sweep(folder, workers=2)
    os.kill(process.pid, how)
    assert process.wait(PATIENCE_s) != 0
    ended(process)
    journal = (folder / "o" / JOURNAL).read_text()
    assert journal.endswith("\n")
    assert 5 <= journal.count("\n") - 1 < 120
    with opened(folder / "o", read_plan(folder / "many.toml")) as kept:
        assert len(kept.done) == journal.count("\n") - 1


def test_an_interruption_waits_for_no_worker() -> None:
    begin = time.monotonic()
    with pytest.raises(SystemExit), executor(2) as pool:
        futures = [pool.submit(time.sleep, 60.0) for _ in range(2)]
        pool.submit(int).add_done_callback(lambda future: None)
        while not all(future.running() for future in futures):
            time.sleep(0.01)
        raise SystemExit(143)
    assert time.monotonic() - begin < 30.0  # of 60 s that each worker would sleep


def test_what_a_killed_sweep_left_half_written_is_cleared(folder: Path) -> None:
    """A kill before the first line leaves the lock and a part: the folder is the sweep's still."""
    (folder / "o").mkdir()
    (folder / "o" / ".lock").touch()
    name = unfinished_name(".parquet").replace(f"-{os.getpid()}-", f"-{gone()}-")
    (folder / "o" / name).write_text("half")
    with opened(folder / "o", plan_of(folder)) as journal:
        assert not journal.done
    assert files(folder / "o") == {".lock", JOURNAL}


def gone() -> int:
    """Return the number of a process that has ended."""
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait()
    return process.pid


def test_a_sweep_is_a_table_or_a_file_with_or_without_a_folder(folder: Path) -> None:
    """From tables or a file, with no folder kept or one to go on in."""
    table = {
        "name": "s",
        "run": str(folder / "push.toml"),
        "configurations": ["uncompensated"],
        "keep": ["loss"],
        "vary": [{"key": "pilot.column.force_N", "values": [20.0, 40.0]}],
    }
    found = sweep(table, workers=1)
    assert found.to_polars()["pilot.column.force_N"].to_list() == [20.0, 40.0]
    assert (found.found, found.indices, found.limits) == (0, (), ())
    kept = sweep(table, folder / "o", workers=1)
    assert kept.to_polars().equals(found.to_polars())
    assert sweep(table, folder / "o", workers=1).found == 2


@pytest.mark.slow
def test_an_interrupted_sweep_says_that_it_goes_on(folder: Path) -> None:
    process = begun_sweep(folder, workers=1)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(PATIENCE_s) == 130
    kept = [json.loads(line) for line in (folder / "o" / JOURNAL).read_text().splitlines()[1:]]
    assert {row["ended_early"] for row in kept} == {""}


@pytest.mark.slow
def test_a_flight_that_ends_early_or_cannot_be_flown_is_a_row(folder: Path) -> None:
    text = """
name = "s"
run = "short.toml"
keep = ["loss", "peak_load_factor"]
[[vary]]
key = "rig.flight.altitude_m"
values = [60.0, 1500.0]
[[vary]]
key = "rig.flight.calibrated_airspeed_m_per_s"
values = [20.0, 80.0]
[[vary]]
key = "pilot.column.force_N"
values = [-80.0]
[[vary]]
key = "duration_s"
values = [10.0]
"""
    found = flown(plan_of(folder, text), folder / "o")
    why = found["ended_early"].to_list()
    assert why[0].startswith("not flown: T37 does not trim")
    assert why[1].startswith("the aircraft met the ground at")
    assert why[2].startswith("not flown: T37 does not trim")
    assert why[3] == "" or why[3].startswith("the aircraft")
    assert found["loss"][0] is None
    save(draw_sweep(found, ["rig.flight.altitude_m"], ["loss"]), folder / "f.png")


def test_a_column_of_words_and_lists_is_a_column_of_text(folder: Path) -> None:
    text = GRID + '[[vary]]\nkey = "bench.dynamic_pressure_Pa"\nvalues = [[100.0], [200.0]]\n'
    found = flown(plan_of(folder, text), folder / "o")
    assert found["bench.dynamic_pressure_Pa"].to_list()[:4] == ["[100.0]"] * 2 + ["[200.0]"] * 2
    write_table(found, folder / "t.parquet")
    assert pl.read_parquet(folder / "t.parquet").equals(found)


def test_a_parameter_is_drawn_with_its_unit() -> None:
    assert parameter_label(BEND) == "column loader bend, m/N"
    assert parameter_label("rig.flight.calibrated_airspeed_m_per_s") == "calibrated airspeed, m/s"
    assert parameter_label("pilot.column.force_N") == "pilot column force, N"
    assert parameter_label("seed") == "seed"
    assert parameter_label("rig.controls.column.rigging.stretch_loss_per_Pa").endswith("loss, 1/Pa")


@pytest.mark.slow
def test_a_cluster_of_two_workers_makes_the_same_table(folder: Path) -> None:
    plan = plan_of(folder)
    with (
        cluster(folder, 2) as address,
        executor(1, address) as pool,
        opened(folder / "o", plan) as journal,
    ):
        found = fly_sweep(plan, journal, pool)
    assert found.equals(flown(plan, folder / "here"))
