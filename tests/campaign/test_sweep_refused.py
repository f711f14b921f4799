"""Refused sweeps: invalid files, damaged journals, targets that cannot be written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from coupled.campaign.flights import fly_planned, fly_sweep
from coupled.campaign.journal import JOURNAL, opened
from coupled.campaign.plan import planned_flights
from coupled.errors import InputError
from coupled.parallel import SerialExecutor, executor
from tests.support.commands import coupled, files
from tests.support.runs import PUSH
from tests.support.sweeps import ASSUMED, BEND, GRID, flown, plan_of, rows_in, write_sweep


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_sweep(tmp_path)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('{"flight": 3}', f"line 3: lacks {BEND}"),
        ("[1, 2]", "line 3: is no line of a flight"),
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
def test_a_damaged_journal_is_refused_in_one_line(folder: Path, line: str, says: str) -> None:
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


def test_two_sweeps_into_one_folder_are_refused_in_one_line(folder: Path) -> None:
    with opened(folder / "o", plan_of(folder)):
        second = coupled(folder, "sweep", "s.toml", "--folder", "o")
    assert (second.returncode, second.stdout) == (2, "")
    assert second.stderr == "error: o: another sweep is writing there\n"


def test_a_full_disk_is_one_line_and_keeps_the_finished_flights(folder: Path) -> None:
    resource = pytest.importorskip("resource")  # not on Windows
    plan, limits = plan_of(folder), resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        with opened(folder / "o", plan) as journal:
            resource.setrlimit(resource.RLIMIT_FSIZE, (1500, limits[1]))
            with pytest.raises(InputError, match=r"flights\.jsonl: cannot be written: .* are kept"):
                fly_sweep(plan, journal, SerialExecutor())
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
        (
            changed("pilot.column.force_N", "expect.most"),
            "vary: expect.most is varied, but has",
        ),
        (changed("pilot.column.force_N", BEND), f"vary: duplicate {BEND}"),
        (changed("high = 60.0", "high = 10.0"), "vary[1].high: must be above low"),
        (changed("high = 60.0", ""), "vary[1]: give values, or low and high"),
        (changed("steps = 3", ""), "vary[1].steps: goes with low and high in a grid"),
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
def test_an_invalid_sweep_is_refused_in_one_line(folder: Path, text: str, says: str) -> None:
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
def test_wrong_arguments_write_nothing(folder: Path, words: list[str], says: str) -> None:
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


def test_a_cluster_that_does_not_answer_is_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("coupled.parallel.PATIENCE_s", 0.5)
    for address in ("tcp://127.0.0.1:9", "nonsense://x"):
        with (
            pytest.raises(InputError, match=r"--cluster: .* does not answer"),
            executor(1, address),
        ):
            pass
    assert not (folder / "out").exists()


@pytest.mark.parametrize("case", ['[case]\nlabel = "a"\n', "case = 1\n", "case = [1]\n"])
def test_a_runs_case_that_is_no_list_of_tables_is_refused(folder: Path, case: str) -> None:
    run = (folder / "push.toml").read_text()
    run = run + case if case.startswith("[") else case + run
    (folder / "push.toml").write_text(run)
    done = coupled(folder, "sweep", "s.toml")
    assert done.returncode == 2
    assert "push.toml: case" in done.stderr
    assert done.stderr.count("\n") == 1
