"""Release of a compensated control: Part 60's dynamic check fails, and passes with the remedy."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from coupled.authority.stability.linear import growth, motion_matrix
from coupled.authority.stability.planes import linear_rig
from coupled.calibration.checks import swing_of
from coupled.calibration.documentation import check_feel
from coupled.calibration.releaseschedule import LATE, schedule_for_release
from coupled.calibration.specification import specified_rig
from coupled.calibration.sweeps import Release
from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Step
from coupled.resources import shipped_rigs
from coupled.rig.growth import growth as simulated
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text
from tests.support.commands import coupled
from tests.support.rigs import G_STIFF, K_REPORT, bench, push

HOST = "controls.column.compensation"
MASS, DAMPING = 4.0, 75.0


def factors(mass: float, damping: float, lead_s: float = 0.0) -> Rig:
    """Return the bench with the same factors and lead at every gradient."""
    table = {"mass_factor": [mass] * 2, "damping_factor": [damping] * 2}
    return bench(
        {
            f"{HOST}.inertia_gradient_N_per_m": [1.0, 2.0],
            f"{HOST}.force_lead_s": [lead_s] * 2,
            **{f"{HOST}.{key}": value for key, value in table.items()},
        }
    )


@pytest.mark.slow
def test_factors_at_one_over_the_rest_keep_frequency_and_damping_ratio_as_specified() -> None:
    factor = 1.0 / (1.0 - K_REPORT * G_STIFF)
    table = {f"{HOST}.{of}_factor": [1.0, factor] for of in ("mass", "damping")}
    rig = bench({**table, f"{HOST}.inertia_gradient_N_per_m": [0.0, G_STIFF]})
    poles = np.linalg.eigvals(motion_matrix(linear_rig(rig, "column", G_STIFF), Hand()))
    slow = poles[np.argmin(np.abs(poles))]
    assert abs(slow) == pytest.approx(math.sqrt(G_STIFF / MASS), rel=1e-9)
    assert -slow.real / abs(slow) == pytest.approx(
        DAMPING / (2.0 * math.sqrt(G_STIFF * MASS)), rel=1e-9
    )
    found = simulated(linear_rig(rig, "column", G_STIFF), Hand(), 4.0)
    assert found == pytest.approx(slow.real, rel=1e-3)


def test_factors_are_straight_between_the_rows_and_held_beyond_them() -> None:
    rig = bench(
        {
            f"{HOST}.inertia_gradient_N_per_m": [1000.0, 2000.0],
            f"{HOST}.mass_factor": [1.0, 3.0],
        }
    )
    for gradient, factor in (
        (560.0, 1.0),
        (1000.0, 1.0),
        (1250.0, 1.5),
        (2000.0, 3.0),
        (2100.0, 3.0),
    ):
        plain = bench({"mass_kg": factor * MASS})
        assert push(rig, 20.0, 0.3, gradient) == pytest.approx(push(plain, 20.0, 0.3, gradient))


def test_a_lead_on_a_step_of_force_is_an_impulse() -> None:
    """T·F of momentum at once: the answer is that to the step, and T times that to an impulse."""
    lead_s, force = 0.03, 20.0
    with_lead, without = (push(factors(1.0, 1.0, t), force, 0.3) for t in (lead_s, 0.0))
    rate = np.gradient(without, 1.0 / 2000.0)  # what an impulse does is the step's derivative
    # From rest under the force: it steps up at the first substep, behind a lag of 2 ms.
    late = slice(40, None)
    shifted = without + lead_s * np.interp(
        np.arange(rate.size) / 2000.0 - 0.002, np.arange(rate.size) / 2000.0, rate
    )
    assert with_lead[late] == pytest.approx(shifted[late], rel=0.02)


def test_without_damping_and_servo_the_lead_is_the_closed_form() -> None:
    """T = √(m/G_T)·cot(1.06·asin 0.9): both motions are harmonic, and the second starts late."""
    rig = bench(
        {
            "damping_N_s_per_m": 0.01,
            "servo_frequency_Hz": 0.0,
            "controls.column.schedule.dynamic_pressure_Pa": [1000.0],
            "controls.column.schedule.total_gradient_N_per_m": [G_STIFF],
            f"{HOST}.force_lead_lag_s": 1e-4,
        }
    )
    found = schedule_for_release(rig, "column").controls["column"].compensation
    assert found.force_lead is not None
    closed = math.sqrt(MASS / G_STIFF) / math.tan((1.0 + LATE) * math.asin(0.9))
    assert found.force_lead[0] == pytest.approx(closed, rel=0.05)


@pytest.mark.parametrize("name", ["report-column", "t37"])
def test_a_compensated_release_passes_with_the_remedy_and_fails_without(name: str) -> None:
    rig = read_rig(shipped_rigs()[name])
    before = [check for check in check_feel(rig, "column") if not check.passed]
    assert {check.name.split(",")[0] for check in before} == {"first zero crossing"}
    remedied = schedule_for_release(rig, "column")
    assert all(check.passed for check in check_feel(remedied, "column"))
    # as data: through a rig file and back
    assert "force_lead_s" in rig_text(remedied, "remedied")
    host, loader = remedied.controls["column"].compensation, rig.controls["column"].loader
    assert host.inertia_gradient is not None
    stiffest = host.inertia_gradient[-1]
    # A pilot's arm and a clamp stay as stable as theory says, and are stable.
    linear = linear_rig(remedied, "column", stiffest)
    for hand in (Hand(), Hand(500.0), Hand(6.0 * loader.damping, 6.0 * loader.mass)):
        assert simulated(linear, hand, 8.0) == pytest.approx(growth(linear, hand), rel=0.02)
        assert growth(linear, hand) < -2.0


def flown(rig: Rig) -> Release:
    """Return the column of a T-37 at high speed, pulled with 40 N for 2 s and let go."""
    fast = rig.changed({"flight.calibrated_airspeed_m_per_s": 154.3, "frame_rate_Hz": 500.0})
    pull = Step(start_s=0.5, duration_s=2.0, force_N=40.0)
    record = fly(Manoeuvre(fast, {"column": pull}, 4.0, name="let-go"))
    after = record.time_s >= 2.5
    deflection = record["column_deflection_m"]
    start = float(deflection[np.flatnonzero(after)[0] - 1])
    return Release(record.time_s[after] - 2.5, deflection[after], start)


def test_in_flight_a_column_let_go_comes_back_when_specified() -> None:
    rig = read_rig(shipped_rigs()["t37"]).only("column")
    aircraft = {"flight": read_rig(shipped_rigs()["t37"]).flight}
    specified = specified_rig(rig).changed(aircraft)
    crossed = {
        name: swing_of(flown(each.changed(aircraft))).crossings[0]
        for name, each in (
            ("specified", specified),
            ("as filed", rig),
            ("remedied", schedule_for_release(rig, "column")),
        )
    }
    assert crossed["as filed"] > 1.15 * crossed["specified"]
    assert crossed["remedied"] == pytest.approx(crossed["specified"], rel=0.1)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"mass_factor": [1.0, 1.1]}, "mass_factor: needs the gradients"),
        ({"force_lead_s": [0.0, 0.1]}, "force_lead_s: needs the gradients"),
        ({"inertia_gradient_N_per_m": [2.0, 1.0]}, "must rise from value to value"),
        (
            {"inertia_gradient_N_per_m": [1.0, 2.0], "mass_factor": [1.0]},
            "mass_factor: has 1 values, inertia_gradient_N_per_m 2; give as many",
        ),
        (
            {"inertia_gradient_N_per_m": [1.0, 2.0], "damping_factor": [0.0, 1.0]},
            "damping_factor: a factor must be above 0",
        ),
        (
            {"inertia_gradient_N_per_m": [1.0, 2.0], "force_lead_s": [0.0, -0.1]},
            "force_lead_s: a lead is not negative",
        ),
        ({"inertia_gradient_N_per_m": [float(i) for i in range(33)]}, "has more than 32 rows"),
    ],
)
def test_an_invalid_table_is_refused(changes: dict[str, list[float]], says: str) -> None:
    with pytest.raises(InputError, match=says):
        bench({f"{HOST}.{key}": value for key, value in changes.items()})


@pytest.mark.slow
def test_the_command_writes_the_rig_whose_releases_pass(tmp_path: Path) -> None:
    more = ["--control", "column", "--write", "new.toml", "--json", "-", "-o", "doc"]
    checks = json.loads(coupled(tmp_path, "document", "report-column", *more).stdout)["column"]
    crossings = [check for check in checks if check["name"].startswith("first zero")]
    assert crossings
    assert all(check["passed"] for check in checks)
    written = read_rig(tmp_path / "new.toml")
    assert written == schedule_for_release(read_rig(shipped_rigs()["report-column"]), "column")


@pytest.mark.parametrize(
    ("gradient", "target", "says"),
    [
        (True, "new.csv", "--write: a rig file ends in .toml"),
        (False, "new.toml", "compensation.gradient: is false"),
        (True, "rig.toml", "rig.toml: is a file that this command reads"),
    ],
)
def test_an_unwritable_target_is_refused_before_any_work(
    tmp_path: Path, gradient: bool, target: str, says: str
) -> None:
    rig = bench({f"{HOST}.gradient": gradient})
    (tmp_path / "rig.toml").write_text(rig_text(rig))
    result = coupled(tmp_path, "document", "rig.toml", "--write", target)
    assert result.returncode == 2
    assert says in " ".join(result.stderr.split())
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]
