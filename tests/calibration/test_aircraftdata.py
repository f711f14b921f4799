"""The aircraft's own forces as the reference of the static checks, typed into a CSV."""

from __future__ import annotations

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from coupled.calibration.aircraftdata import read_aircraft_data
from coupled.calibration.documentation import check_feel
from coupled.calibration.specification import LEGS, specified_rig
from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.equations import specified_force
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.units import POUND_N, INCH_m, PSF_Pa
from tests.support.commands import coupled
from tests.support.rigs import bench

TRAVEL, FRICTION = 0.1778, 5.0
PLACES = np.array([0.01, 0.02, 0.03, 0.06, 0.1, 0.15])
RIG = {
    "friction_N": FRICTION,
    "breakout_N": 8.0,
    "bend_m_per_N": 0.0,
    "controls.column.compensation.bend_m_per_N": 0.0,
}


def specified_at(rig: Rig, pressure: float, place: float) -> float:
    return float(specified_force(rig, "column", pressure, np.array([place]))[0])


def rows(rig: Rig, pressure: float, directions: bool = True, wrong: float = 1.0) -> list[str]:
    """Return rows of a rig's own specified force; `wrong` is a factor on the one at 0.1 m."""
    found = []
    for place in [*PLACES, *-PLACES]:
        force = specified_at(rig, pressure, float(place))
        force *= wrong if place == 0.1 else 1.0
        rubs = np.sign(place) * FRICTION
        if directions:
            found += [
                f"{pressure},{place},{force + rubs},out",
                f"{pressure},{place},{force - rubs},back",
            ]
        else:
            found.append(f"{pressure},{place},{force},")
    return found


def written(folder: Path, lines: list[str], heads: str = "") -> Path:
    path = folder / "aircraft.csv"
    heads = heads or "dynamic_pressure_Pa,deflection_m,force_N,direction"
    path.write_text("\n".join([heads, *lines]) + "\n", encoding="utf-8")
    return path


def failing(rig: Rig, path: Path) -> dict[str, float]:
    """Return the static checks that fail against the file, and their reference."""
    data = specified_rig(rig).controls["column"]
    aircraft = read_aircraft_data(path, "column", data, 0.4)
    checks = check_feel(rig, "column", 0.4, aircraft=aircraft)
    static = [c for c in checks if c.name.startswith(("force", "breakout", "surface"))]
    assert static
    return {c.name: c.reference for c in static if not c.passed}


@pytest.mark.parametrize("directions", [True, False])
def test_a_rig_like_the_aircraft_passes_and_one_place_beyond_ten_percent_fails(
    tmp_path: Path, directions: bool
) -> None:
    rig = bench(RIG)
    whole = rig.changed({"controls.column.schedule.total_gradient_N_per_m": [3000.0, 6000.0]})
    for factor, passes in ((1.0, True), (1.09, True), (1.13, False)):
        path = written(tmp_path, rows(whole, 1500.0, directions, factor))
        found = failing(whole, path)
        assert (not found) == passes
        if not passes:
            assert set(found) == {"force, out, positive", "force, back, positive"}
            there = specified_at(whole, 1500.0, 0.1) * factor
            assert found["force, out, positive"] == pytest.approx(there + FRICTION)


def test_a_fault_that_the_rigs_own_file_shares_fails_against_the_aircraft(tmp_path: Path) -> None:
    """A schedule that is 30 % too steep passes against its own specification."""
    aircraft = bench(RIG)
    steep = aircraft.changed({"controls.column.schedule.total_gradient_N_per_m": [728.0, 2846.0]})
    own = check_feel(steep, "column", 0.4)
    assert all(c.passed for c in own if c.name.startswith("force"))
    found = failing(steep, written(tmp_path, rows(aircraft, 3000.0)))
    assert {name.split(",")[0] for name in found} == {"force"}
    assert len(found) == 4


def test_friction_is_the_aircrafts_where_directions_were_noted(tmp_path: Path) -> None:
    """30 N more friction than the aircraft's; the rig's own file shares it."""
    aircraft = bench(RIG)
    rubbing = aircraft.changed({"controls.column.loader.friction_N": FRICTION + 30.0})
    assert failing(rubbing, written(tmp_path, rows(aircraft, 1500.0)))
    assert not failing(rubbing, written(tmp_path, rows(aircraft, 1500.0, directions=False)))


def test_a_sweep_in_order_needs_no_directions(tmp_path: Path) -> None:
    """Out and back at places of their own; each row had been taken as the mean of both."""
    rig, lines = bench(RIG), []
    turns = (0.0, 0.17, -0.17, 0.0)
    for begun, ended in pairwise(turns):
        for place in np.linspace(begun, ended, 41 if begun and ended else 21)[1:-1]:
            force = specified_at(rig, 1500.0, place) + FRICTION * np.sign(ended - begun)
            if place != 0.0:
                lines.append(f"1500,{place:.6f},{force:.6f},")
    data = specified_rig(rig).controls["column"]
    legs = read_aircraft_data(written(tmp_path, lines), "column", data).legs[1500.0]
    for leg, (side, motion) in zip(legs, LEGS.values(), strict=True):
        wanted = [specified_at(rig, 1500.0, place) for place in leg.deflection]
        assert len(leg.deflection) > 15
        assert leg.force == pytest.approx(np.array(wanted) + side * motion * FRICTION, abs=1e-3)
    assert not failing(rig, tmp_path / "aircraft.csv")


def test_data_in_us_units_and_one_direction_are_judged_in_that_direction(tmp_path: Path) -> None:
    """Pounds, inches and psf; a pull only, which is then all that is judged."""
    rig = bench(RIG)
    lines = []
    for place in PLACES:
        force = specified_at(rig, 1500.0, float(place)) + FRICTION
        lines.append(f"{1500.0 / PSF_Pa},{place / INCH_m},{force / POUND_N},out")
    path = written(tmp_path, lines, "dynamic_pressure_psf,deflection_in,force_lb,direction")
    data = specified_rig(rig).controls["column"]
    aircraft = read_aircraft_data(path, "column", data)
    [(pressure, legs)] = aircraft.legs.items()
    assert pressure == pytest.approx(1500.0)
    assert [leg.deflection.size for leg in legs] == [len(PLACES), 0, 0, 0]
    np.testing.assert_allclose(legs[0].deflection, PLACES)
    checks = check_feel(rig, "column", aircraft=aircraft)
    static = {c.name for c in checks if c.name.startswith(("force", "breakout"))}
    assert static == {"breakout, positive", "force, out, positive"}


def test_the_aircrafts_surface_is_held_within_two_degrees(tmp_path: Path) -> None:
    rig = bench(RIG)
    full = 0.4  # rad, at the whole travel
    for off_deg, passes in ((1.9, True), (2.1, False)):
        lines = []
        for line in rows(rig, 1500.0):
            place = float(line.split(",")[1])
            degrees = np.degrees(full * abs(place) / TRAVEL) + (off_deg if place == 0.1 else 0.0)
            lines.append(f"{line},{-np.sign(place) * degrees}")
        heads = "dynamic_pressure_Pa,deflection_m,force_N,direction,surface_deg"
        found = failing(rig, written(tmp_path, lines, heads))
        assert set(found) == (set() if passes else {"surface, positive"})


GOOD = "1500,0.05,60,out"


@pytest.mark.parametrize(
    ("lines", "heads", "says"),
    [
        ([], "", "holds no readings"),
        ([GOOD, GOOD], "", r"row 3: is at the place of row 2"),
        (["1500,0.05,60,up"], "", r"row 2: direction: 'up' is neither out nor back"),
        (["1500,0.05,sixty,out"], "", r"row 2: force_N: 'sixty' is no number"),
        (["-3,0.05,60,out"], "", r"row 2: dynamic_pressure_Pa: cannot be negative"),
        (["1500,0.25,60,out"], "", "beyond the rig's travel"),
        ([GOOD, "1500,0.06,70,"], "", "names a direction, or none"),
        (["1500,0,5,out"], "", "is at neutral"),
        (["1500,0.05,60"], "", "has 3 cells"),
        ([f"{q},0.05,60,out" for q in range(1, 10)], "", "9 dynamic pressures"),
        (["1,2,3"], "dynamic_pressure_Pa,deflection_m,force_kg", "force_kg: is no column"),
        (["1,2,3"], "deflection_m,deflection_in,force_N", "mixes units"),
        (["1,2"], "deflection_m,direction", "the column force in force_N or force_lb is missing"),
        (["1,2,3"], "deflection_m,force_N,surface_deg", "no aircraft whose surface"),
        (["1,2,3"], "deflection_rad,force_N,direction", "deflection_rad: is no column"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(
    tmp_path: Path, lines: list[str], heads: str, says: str
) -> None:
    data = bench(RIG).controls["column"]
    with pytest.raises(InputError, match=says):
        read_aircraft_data(written(tmp_path, lines, heads), "column", data)


@pytest.mark.slow
def test_the_command_judges_by_the_file_and_draws_it(tmp_path: Path) -> None:
    """The Cessna's column against forces 30 % above its own, at one q̄."""
    rig = read_rig(shipped_rigs()["c172p"])
    lines = []
    for place in (0.02, 0.04, 0.06, 0.08):
        force = 1.3 * specified_at(rig, 2000.0, place)
        lines.append(f"2000,{place},{force}")
    path = written(tmp_path, lines, "dynamic_pressure_Pa,deflection_m,force_N")
    more = ["--control", "column", "--aircraft", str(path), "--json", "-"]
    result = coupled(tmp_path, "document", "c172p", *more, "-o", str(tmp_path / "doc"))
    checks = json.loads(result.stdout)["column"]
    assert {check["pressure_Pa"] for check in checks} == {2000.0}
    forces = [check for check in checks if check["name"].startswith("force")]
    assert [check["name"] for check in forces] == ["force, out, positive", "force, back, positive"]
    assert not any(check["passed"] for check in forces)
    assert (tmp_path / "doc" / "column-static.png").is_file()
