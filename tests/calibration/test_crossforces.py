"""What forces on other controls bend at one: readings, their file, the fit, and its intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.calibrated import with_calibration
from coupled.calibration.coverage import measure_coverage
from coupled.calibration.crossforces import crossed_forces, crossed_precision
from coupled.calibration.estimate import Instruments, perfect_instruments, usual_instruments
from coupled.calibration.fit import ordinary
from coupled.calibration.plan import stations
from coupled.calibration.readings import Readings
from coupled.calibration.readingsfile import read_readings, write_readings
from coupled.calibration.result import CalibrationResult
from coupled.errors import InputError
from tests.support.joined import BETWEEN, RADIUS, joined
from tests.support.rigs import K_REPORT

RIG = joined()
TOOLS = usual_instruments("column")


def bench(tools: Instruments = TOOLS, force_N: float = 150.0) -> CalibrationBench:
    grid = stations(RIG, "column", 3, 4)
    held = crossed_forces(RIG, "column", len(grid), force_N)
    return CalibrationBench(RIG, "column", grid, tools, 0, True, held)


def fitted(readings: Readings) -> CalibrationResult:
    return calibrate_control(readings, RIG.controls["column"], "column", TOOLS, "readings")


def test_readings_without_errors_give_every_term() -> None:
    readings = take_readings(bench(perfect_instruments()), seed=0)
    assert readings.other_names == ("wheel",)
    found = fitted(readings)
    assert found.fit.others["wheel"].value == pytest.approx(BETWEEN, rel=1e-9)
    assert found.line.bend.value == pytest.approx(K_REPORT, rel=1e-9)
    plain = ordinary(readings, TOOLS)
    assert plain.bend.value == pytest.approx(K_REPORT, rel=1e-9)
    table = found.as_dict()["bend_by_others"]["column_by_wheel_m_per_N"]
    assert table["value"] == pytest.approx(BETWEEN, rel=1e-9)


def test_without_the_column_the_force_on_the_wheel_is_taken_for_a_slip_of_the_ruler() -> None:
    """K alone is then biased or its residuals are too large: the column of readings is needed."""
    readings = take_readings(bench(), seed=1)
    blind = replace(readings, other_names=(), others=readings.others[:, :0])
    assert ordinary(blind, TOOLS).excess > 3.0
    assert ordinary(readings, TOOLS).excess < 2.0


def test_a_wheel_reads_what_the_column_bends_there() -> None:
    grid = stations(RIG, "wheel", 3, 4, 100.0)
    held = crossed_forces(RIG, "wheel", len(grid), 150.0)
    tools = usual_instruments("wheel")
    made = CalibrationBench(RIG, "wheel", grid, tools, 0, True, held)
    wheel = RIG.controls["wheel"]
    found = calibrate_control(take_readings(made, 2), wheel, "wheel", tools, "readings")
    assert found.fit.others["column"].holds(BETWEEN / RADIUS)
    assert found.fit.others["column"].half_width < 0.3 * BETWEEN / RADIUS


def test_a_mistyped_row_is_named_with_forces_on_others_too() -> None:
    readings = take_readings(bench(), seed=3)
    v1 = readings.v1.copy()
    v1[5] += 2.0
    found = fitted(replace(readings, v1=v1))
    assert [suspect.row for suspect in found.suspects] == [7]
    assert found.fit.others["wheel"].holds(BETWEEN)


@pytest.mark.parametrize("inches", [False, True])
def test_the_file_holds_forces_on_others(tmp_path: Path, inches: bool) -> None:
    readings = take_readings(bench(), seed=4)
    path = tmp_path / "readings.csv"
    write_readings(path, readings, "column", inches)
    assert f"force_on_wheel_{'lb' if inches else 'N'}" in path.read_text().splitlines()[0]
    again = read_readings(path, "column")
    assert again.other_names == ("wheel",)
    assert again.others == pytest.approx(readings.others, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize(
    ("column", "cells", "problem"),
    [
        ("force_on_wheel_N", [""] * 6, r"row 2: force_on_wheel_N: is empty"),
        ("force_on_column_N", ["1"] * 6, r"row 1: force_on_column_N: is no column"),
        ("force_on_wheel_N", ["0"] * 6, r"force_on_wheel: is not 0 in 0 rows"),
        ("force_on_wheel_N", ["10", "20", "30", "10", "20", "30"], "go with this control's own"),
    ],
)
def test_forces_on_others_that_do_not_determine_a_term_are_refused(
    tmp_path: Path, column: str, cells: list[str], problem: str
) -> None:
    force = [10.0, 20.0, 30.0, 10.0, 20.0, 30.0]
    deflection = [0.01, 0.02, 0.03, 0.005, 0.01, 0.015]
    rows = [f"gradient_set,deflection_m,force_N,v1_V,v3_V,{column}"]
    for k, (d, f, cell) in enumerate(zip(deflection, force, cells, strict=True)):
        rows.append(f"{1 + k // 3},{d},{f},{562.4 * (d - 9e-5 * f):.5f},{0.26 * f:.3f},{cell}")
    path = tmp_path / "readings.csv"
    path.write_text("\n".join(rows) + "\n")
    with pytest.raises(InputError, match=problem):
        fitted(read_readings(path, "column"))


@pytest.mark.slow
def test_intervals_of_the_terms_hold_what_they_should() -> None:
    """40 benches: a share of 0.95 leaves under 32 in 3 of 10 000; 200 are in the docs."""
    coverage = measure_coverage(bench(), 40)
    assert coverage.covered["K by wheel"] >= 0.8
    assert coverage.covered["K"] >= 0.8


def test_a_calibration_gives_the_host_its_terms() -> None:
    found = fitted(take_readings(bench(), seed=5))
    rig = with_calibration(RIG, "column", found)
    assert rig.structure.assumed.column_by_wheel == found.fit.others["wheel"].value
    assert rig.structure.column_by_wheel == BETWEEN
    free = RIG.changed({"structure.reciprocal": False})
    real = with_calibration(free, "column", found, hardware=True)
    assert real.structure.column_by_wheel == found.fit.others["wheel"].value


@pytest.mark.slow
def test_a_plan_says_how_well_the_terms_get_known() -> None:
    """Against the scatter of 40 benches, and the closed form of its docstring within a third."""
    made = bench()
    planned = crossed_precision(RIG, "column", made.stations, 150.0, TOOLS)["wheel"]
    found = [fitted(take_readings(made, seed)).fit.others["wheel"] for seed in range(40)]
    spread = float(np.std([one.value for one in found]))
    assert planned == pytest.approx(float(np.mean([one.half_width for one in found])), rel=0.3)
    own = np.sqrt(TOOLS.deflection_variance(np.array(0.05), 2.0))
    meter = np.sqrt(TOOLS.voltage_variance(np.array(20.0))) / 562.43
    assert spread == pytest.approx(float(np.hypot(own, meter)) / 150.0 / np.sqrt(6), rel=0.35)
    twice = crossed_precision(RIG, "column", list(made.stations) * 2, 150.0, TOOLS)["wheel"]
    assert twice < planned / 1.3
    weak = crossed_precision(RIG, "column", made.stations, 50.0, TOOLS)["wheel"]
    assert weak == pytest.approx(3.0 * planned, rel=0.1)


def test_forces_on_others_are_orthogonal_to_the_rest_of_the_design() -> None:
    held = crossed_forces(RIG, "column", 25, 100.0)["wheel"]
    assert {*held} == {-100.0, 0.0, 100.0}
    force = [station.force for station in stations(RIG, "column", 5, 5)]
    assert abs(float(np.corrcoef(held, force)[0, 1])) < 0.3
    assert crossed_forces(RIG, "column", 25, 0.0) == {}
