"""What a sweep's flights survive, and the boundary that the shipped recovery draws."""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from coupled.campaign.entry import SURVIVED
from coupled.campaign.flights import fly_planned, table
from coupled.campaign.plan import PlannedFlight, planned_flights, read_plan
from coupled.campaign.survival import limits
from coupled.errors import InputError
from coupled.flight.manoeuvre import Configuration
from coupled.plots.saving import save
from coupled.plots.survival import draw_survival
from coupled.resources import runs_folder

RUN = """
name = "push"
card = "A test."
rig = "bench"
duration_s = 3.0
configurations = ["rigid"]
[bench]
time_s = [0.0]
dynamic_pressure_Pa = [3000.0]
[pilot.column]
kind = "step"
force_N = 40.0
"""
SWEEP = """
name = "s"
run = "push.toml"
keep = ["force_N"]
[[vary]]
key = "pilot.column.force_N"
values = [20.0, 40.0, 60.0]
[[survive]]
channel = "column_force_N"
most = 50.0
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "push.toml").write_text(RUN)
    (tmp_path / "s.toml").write_text(SWEEP)
    return tmp_path


def test_a_flight_is_survived_within_its_bounds(folder: Path) -> None:
    plan = read_plan(folder / "s.toml")
    found = table(plan, [fly_planned(plan, job) for job in planned_flights(plan)])
    assert found[SURVIVED].to_list() == [True, True, False]
    [limit] = limits(found, "pilot.column.force_N")
    assert (limit.survived, limit.flights, limit.boundary) == (2, 3, 50.0)
    save(draw_survival("s", "pilot.column.force_N", [limit]), folder / "f.png")
    assert (folder / "f.png").stat().st_size > 10_000


def test_the_closed_form_moves_the_rigid_boundary_by_the_loss() -> None:
    severity = [0.1 * k for k in range(10)]
    rows = {
        "m": severity * 2,
        "configuration": ["rigid"] * 10 + ["uncompensated"] * 10,
        SURVIVED: [m < 0.75 for m in severity] + [m < 0.55 for m in severity],
        "loss_closed_form": [0.0] * 10 + [0.2] * 10,
    }
    rigid, bent = limits(pl.DataFrame(rows), "m")
    assert rigid.boundary == pytest.approx(0.75)
    assert rigid.predicted is None
    assert bent.boundary == pytest.approx(0.55)
    assert bent.predicted == pytest.approx(0.8 * 0.75)
    twice = {**rows, SURVIVED: [True, False] * 10}  # no one place where survival ends
    assert all(limit.boundary is None for limit in limits(pl.DataFrame(twice), "m"))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"column_force_N"', '"colum_force_N"', "survive[0].channel: no channel 'colum_force_N'"),
        ("most = 50.0", "", "survive[0]: has no bound: give least or most"),
        ("most = 50.0", "mosst = 50.0", "survive[0].mosst: unknown key"),
        ("[[survive]]", "[survive]", "survive: each is written [[survive]]"),
    ],
)
def test_an_invalid_survival_condition_is_refused_in_one_line(
    folder: Path, old: str, new: str, says: str
) -> None:
    (folder / "s.toml").write_text(SWEEP.replace(old, new))
    with pytest.raises(InputError) as fault:
        read_plan(folder / "s.toml")
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    ("severity", "configuration", "alive"),
    [
        pytest.param(-0.58, "gradient only", True, marks=pytest.mark.slow),
        pytest.param(-0.59, "gradient only", False, marks=pytest.mark.slow),
        pytest.param(-0.60, "uncompensated", True, marks=pytest.mark.slow),
        pytest.param(-0.61, "uncompensated", False, marks=pytest.mark.slow),
        (-0.66, "compensated", True),
        (-0.67, "compensated", False),
    ],
)
def test_each_boundary_of_the_recovery_lies_where_the_docs_have_it(
    severity: float, configuration: Configuration, alive: bool
) -> None:
    """What lies between them, at 0.63, the run itself expects."""
    plan = read_plan(runs_folder() / "sweeps" / "recovery.toml")
    row = fly_planned(
        plan, PlannedFlight(0, {"event.runaway.by_norm": severity}, configuration, None)
    )
    assert row.survived is alive


def test_a_sweep_over_an_event_misspelled_names_the_one_it_is_near(folder: Path) -> None:
    text = (runs_folder() / "sweeps" / "recovery.toml").read_text()
    text = text.replace("event.runaway.", "event.runway.")
    (folder / "s.toml").write_text(text)
    with pytest.raises(
        InputError, match=r"event\.runway.*: the run has no event 'runway'; did you"
    ):
        read_plan(folder / "s.toml")


def test_every_shipped_sweep_can_be_flown() -> None:
    files = sorted((runs_folder() / "sweeps").glob("*.toml"))
    assert len(files) >= 2
    for file in files:
        assert len(planned_flights(read_plan(file))) > 50
