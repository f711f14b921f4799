"""Sweeps: the same table from any number of workers, through kills, full disks and bad rows."""

from __future__ import annotations

import json
import os
import resource
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
from coupled.campaign.labels import parameter_label
from coupled.campaign.plan import SweepPlan, planned_flights, read_plan
from coupled.campaign.sweep import sweep, write_table
from coupled.errors import InputError
from coupled.files import unfinished_name
from coupled.parallel import Here, executor
from coupled.plots.campaign import draw_sweep
from coupled.plots.saving import save
from tests.support.cluster import cluster
from tests.support.commands import coupled, files
from tests.support.processes import begun, ended, kill
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
    (tmp_path / "push.toml").write_text(PUSH)
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "s.toml").write_text(GRID)
    return tmp_path


def plan_of(folder: Path, text: str = GRID) -> SweepPlan:
    (folder / "s.toml").write_text(text)
    return read_plan(folder / "s.toml")


def flown(plan: SweepPlan, folder: Path, workers: int = 1) -> pl.DataFrame:
    with executor(workers) as pool, opened(folder, plan) as journal:
        return fly_sweep(plan, journal, pool)


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


def rows_in(path: Path) -> int:
    return max(0, path.read_bytes().count(b"\n") - 1) if path.exists() else 0


def begun_sweep(folder: Path, workers: int) -> subprocess.Popen[bytes]:
    """Return a sweep of 120 flights once it has a few of them."""
    many = GRID.replace("steps = 3", "steps = 20")
    many += '[[vary]]\nkey = "duration_s"\nvalues = [6.0]\n'
    (folder / "many.toml").write_text(many.replace('name = "s"', 'name = "many"'))
    words = ("sweep", "many.toml", "--folder", "o", "-j", str(workers))
    return begun(folder, *words, until=lambda: rows_in(folder / "o" / JOURNAL) >= 5)


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
    assert process.wait(timeout=30) != 0
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


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('{"flight": 3}', f"line 3: lacks {BEND}"),
        ("[1, 2]", "line 3: is no flight"),
        ("{", "line 3: is not JSON"),
        ("", "line 3: is not JSON"),
        ('{"flight": 18, OTHERS}', "line 3: flight 18 is none of the sweep's 0 to 17"),
        ('{"flight": -1, OTHERS}', "line 3: flight -1 is none of the sweep's"),
        ('{"flight": true, OTHERS}', "line 3: flight True is none"),
        ('{"flight": 0, OTHERS}', "line 3: duplicate flight 0"),
        ('{"flight": 1, OTHERS, "loss": "much"}', "line 3: loss is 'much'"),
        ('{"flight": 1, OTHERS, "seed": 0.5}', "line 3: seed is 0.5"),
    ],
)
def test_a_journal_that_was_meddled_with_is_one_line(folder: Path, line: str, says: str) -> None:
    plan = plan_of(folder)
    entry = fly_planned(plan, planned_flights(plan)[0])
    with opened(folder / "o", plan) as journal:
        journal.add(entry)
    others = json.dumps({k: v for k, v in entry.as_dict(plan.columns).items() if k != "flight"})
    with (folder / "o" / JOURNAL).open("a") as file:
        file.write(line.replace("OTHERS", others[1:-1]) + "\n")
    with pytest.raises(InputError) as fault, opened(folder / "o", plan):
        pass
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_sweep_in_as_few_words(folder: Path) -> None:
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


def test_two_sweeps_into_one_folder_are_one_line(folder: Path) -> None:
    with opened(folder / "o", plan_of(folder)):
        second = coupled(folder, "sweep", "s.toml", "--folder", "o")
    assert (second.returncode, second.stdout) == (2, "")
    assert second.stderr == "error: o: another sweep is writing there\n"


def test_an_interrupted_sweep_says_that_it_goes_on(folder: Path) -> None:
    process = begun_sweep(folder, workers=1)
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(timeout=30) == 130
    kept = [json.loads(line) for line in (folder / "o" / JOURNAL).read_text().splitlines()[1:]]
    assert {row["ended_early"] for row in kept} == {""}


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


def test_a_full_disk_is_one_line_and_keeps_what_is_there(folder: Path) -> None:
    plan, limits = plan_of(folder), resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with opened(folder / "o", plan) as journal:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1500, limits[1]))
            with pytest.raises(InputError, match=r"flights\.jsonl: cannot be written: .* are kept"):
                fly_sweep(plan, journal, Here())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    kept = rows_in(folder / "o" / JOURNAL)
    assert 0 < kept < 18
    whole = flown(plan, folder / "o")
    assert whole.equals(flown(plan, folder / "fresh"))


def changed(old: str, new: str) -> str:
    assert old in GRID
    return GRID.replace(old, new)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (changed("loader.bend_m", "loader.bnd_m"), "vary[0]: rig.controls.column.loader.bnd_m_per"),
        (changed("pilot.column.force_N", "pilot.colum.force_N"), "vary[1]: pilot.colum.force_N"),
        (changed("pilot.column.force_N", "nothing"), "vary[1]: nothing = 20.0: unknown key"),
        (changed("pilot.column.force_N", "event.gust.to"), "has no event 'gust'; it has none"),
        (changed("pilot.column.force_N", "expect.most"), "vary: expect.most changes no flight"),
        (changed("pilot.column.force_N", BEND), f"vary: duplicate {BEND}"),
        (changed("high = 60.0", "high = 10.0"), "vary[1].high: must be above low"),
        (changed("high = 60.0", ""), "vary[1]: give values, or low and high"),
        (changed("steps = 3", ""), "vary[1].steps: is given for a range in a grid"),
        (changed("steps = 3", "steps = 9999999"), "vary[1].steps: input should be"),
        (changed("[2e-5, 4e-5, 8e-5]", "[-1.0]"), "input should be greater than or equal to 0"),
        (changed("[2e-5, 4e-5, 8e-5]", '["x"]'), "= 'x': "),
        (changed("column_force_N", "colum_force_N"), "extremes: no channel 'colum_force_N'; did"),
        (changed('name = "s"', 'name = "s"\nsamples = 3'), "samples: is given with sobol"),
        (changed('name = "s"', 'name = "s"\ncase = "x"'), "case: no 'x'; known: push"),
        (changed('keep = ["loss"]', 'keep = ["los"]'), "keep.0: input should be"),
        (changed(ASSUMED, "rig.controls.column.sensing.force_scal"), "vary[0].also: rig.controls"),
        (changed(ASSUMED, "pilot.column.nothing"), "vary[0].also: pilot.column.nothing = 2e-05"),
        (changed("push.toml", "nothing"), "nothing: is no shipped run"),
        ('name = "s"\nrun = "push.toml"\n', "vary: is missing"),
        ('name = "s"\nrun = "push.toml"\nvary = 3\n', "each is written [[vary]]"),
    ],
)
def test_a_sweep_that_means_nothing_is_one_line(folder: Path, text: str, says: str) -> None:
    with pytest.raises(InputError) as fault:
        plan_of(folder, text)
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)


def test_a_property_that_the_aircraft_lacks_is_refused(folder: Path) -> None:
    text = changed("push.toml", "short.toml").replace(
        "pilot.column.force_N", "rig.flight.properties.fcs/nonsense"
    )
    with pytest.raises(InputError, match=r"vary\[1\]: rig\.flight\.properties\.fcs/nonsense"):
        plan_of(folder, text)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--folder", "push.toml"], "push.toml: is a file; give a folder"),
        (["--folder", "."], "is not empty, and holds no sweep; give a new folder"),
        (["--cluster", "tcp://127.0.0.1:9", "-j", "2"], "--workers: a cluster has its own"),
    ],
)
def test_words_that_lead_nowhere_write_nothing(folder: Path, words: list[str], says: str) -> None:
    before = files(folder)
    done = coupled(folder, "sweep", "s.toml", *words)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert files(folder) == before


def test_another_sweep_does_not_go_on_in_a_folder(folder: Path) -> None:
    flown(plan_of(folder), folder / "o")
    other = plan_of(folder, changed("2e-5", "3e-5"))
    with pytest.raises(InputError, match="holds another sweep"):
        flown(other, folder / "o")
    (folder / "push.toml").write_text(PUSH.replace("ramp_s = 1.0", "ramp_s = 0.9"))
    with pytest.raises(InputError, match="holds another sweep"):
        flown(plan_of(folder), folder / "o")
    (folder / "o" / JOURNAL).write_text("nonsense\n")
    with pytest.raises(InputError, match="holds another sweep"):
        flown(plan_of(folder), folder / "o")


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


def test_a_cluster_that_does_not_answer_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("coupled.parallel._PATIENCE_s", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with (
            pytest.raises(InputError, match=r"--cluster: .* does not answer"),
            executor(1, address),
        ):
            pass
    assert not (folder / "out").exists()
