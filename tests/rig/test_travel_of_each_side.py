"""A control whose travel differs from side to side: its stops, and full surface travel at both."""

from __future__ import annotations

from pathlib import Path

import jsbsim
import numpy as np
import pytest

import coupled
from coupled.authority.compare import fly_and_judge
from coupled.errors import InputError
from coupled.exporting.write import Flown, export
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Clamp, Doublet
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.serving import check_service
from coupled.rig.surface import share_of_travel

PULL_m, PUSH_m = 0.09, 0.06


def uneven() -> Rig:
    rig = read_rig(shipped_rigs()["t37"])
    sides = {"travel_m": PULL_m, "travel_push_m": PUSH_m}
    sides |= {"loader.bend_m_per_N": 0.0, "compensation.bend_m_per_N": 0.0}
    return rig.changed({f"controls.column.{key}": value for key, value in sides.items()})


def test_each_side_stops_at_its_travel_and_moves_the_surface_fully() -> None:
    hard = Doublet(force_N=400.0, half_period_s=0.4, start_s=0.05)
    record = fly(Manoeuvre(uneven(), {"column": hard}, 1.0))
    place, command = record["column_computed_m"], record["column_surface_norm"]
    assert place.max() == pytest.approx(PULL_m, abs=1e-12)
    assert place.min() == pytest.approx(-PUSH_m, abs=1e-12)
    assert (command.min(), command.max()) == pytest.approx((-1.0, 1.0), abs=1e-12)
    share = np.where(place > 0.0, place / PULL_m, place / PUSH_m)
    np.testing.assert_allclose(command, -share, atol=1e-12)
    np.testing.assert_allclose(share_of_travel(uneven().controls["column"], place), share)


def test_a_push_loses_by_its_own_travel() -> None:
    """Rigid and without a correction, the surface asked for is that reached."""
    push = Doublet(force_N=-20.0, half_period_s=5.0, start_s=0.1)
    outcome = fly_and_judge(Manoeuvre(uneven(), {"column": push}, 2.0)).outcome
    assert outcome.loss == pytest.approx(0.0, abs=1e-6)
    assert abs(outcome.asked_norm) > 0.1


def test_the_export_has_both_sides() -> None:
    hard = Doublet(force_N=60.0, half_period_s=0.4, start_s=0.05)
    rig = uneven()
    made = export(rig, [Flown(Manoeuvre(rig, {"column": hard}, 1.0), ("compensated",))])
    (found,) = made.beside
    assert found.surface < 0.01


@pytest.mark.parametrize(("axis", "place"), [(1.0, -PUSH_m), (0.5, -0.03), (-0.5, 0.03)])
def test_a_joystick_of_the_export_moves_the_grip_within_the_stops_of_its_side(
    tmp_path: Path, axis: float, place: float
) -> None:
    """Full throw is the travel of a side. A grip held beyond a stop would take an endless force."""
    rig = uneven().changed({"controls.column.travel_pull_m": 0.06})
    coupled.export(rig, tmp_path / "made", runs=[], check=False)
    fdm = jsbsim.FGFDMExec(str(tmp_path / "made"))
    fdm.load_model("T37")
    fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 5000.0, 200.0
    fdm.run_ic()
    fdm["coupled/column/hand"] = 1.0
    for _ in range(480):
        fdm["fcs/elevator-cmd-norm"] = axis
        fdm.run()
    assert fdm["coupled/column/deflection-m"] == pytest.approx(place, abs=1e-3)
    assert abs(fdm["coupled/column/force-held-N"]) < 150.0


def test_a_side_beyond_the_travel_is_refused() -> None:
    with pytest.raises(InputError, match=r"travel_pull_m: is above travel_m = 0\.09"):
        uneven().changed({"controls.column.travel_pull_m": 0.1})


def test_a_clamp_beyond_the_travel_of_its_side_is_refused() -> None:
    """There the hand would push ever harder into the stop."""
    Clamp(deflection_m=0.07).check(uneven(), "column", "run.toml")
    with pytest.raises(InputError, match=r"beyond the control's travel, -0\.06 to 0\.09"):
        Clamp(deflection_m=-0.07).check(uneven(), "column", "run.toml")


def test_a_trim_beyond_the_travel_of_its_side_is_refused() -> None:
    check_service(uneven(), "column", "trim_m", 0.07, "run.toml", "event.e")
    with pytest.raises(InputError, match=r"beyond the control's travel, -0\.06 to 0\.09"):
        check_service(uneven(), "column", "trim_m", -0.07, "run.toml", "event.e")
