"""Plans: the error that is promised is the error that comes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.calibration.bench import CalibrationBench
from coupled.calibration.coverage import measure_coverage
from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.form import form
from coupled.calibration.plan import (
    deflection_needs,
    fewest,
    gradient_sets,
    precision,
    stations,
)
from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.readings import S1, S3, K, report_rig, with_errors
from tests.support.rigs import bench as bench_rig

USUAL = usual_instruments("column")


def test_gradients_are_even_over_the_schedule() -> None:
    found = gradient_sets(report_rig(), "column", 5)
    np.testing.assert_allclose([g for _, g in found], np.linspace(560.4, 2189.1, 5), rtol=1e-3)
    assert [q for q, _ in found] == sorted(q for q, _ in found)


def test_a_schedule_that_falls_is_followed_down() -> None:
    key = "controls.column.schedule.total_gradient_N_per_m"
    found = gradient_sets(bench_rig({key: [2000.0, 500.0]}), "column", 3)
    assert [round(g) for _, g in found] == [500, 1250, 2000]
    assert [round(q) for q, _ in found] == [3000, 1500, 0]


@pytest.mark.parametrize("name", ["report-column", "c172p", "bench"])
def test_stations_keep_within_travel_and_force(name: str) -> None:
    rig = read_rig(shipped_rigs()[name])
    for station in stations(rig, "column", 4, 4, 60.0):
        assert station.force <= 60.0 * 1.01
        assert 0.0 < station.deflection <= 0.95 * rig.controls["column"].travel
    short = 0.02  # the readings are pulls, whose travel may be the shorter one
    rig = rig.changed({"controls.column.travel_pull_m": short})
    assert all(0.0 < s.deflection <= 0.95 * short for s in stations(rig, "column", 4, 4, 60.0))


@pytest.mark.slow
def test_the_promised_error_is_the_one_that_comes() -> None:
    grid = stations(report_rig(), "column", 4, 5)
    promised = precision(report_rig(), "column", grid, USUAL, looks=1)
    delta = np.array([s.deflection for s in grid])
    force = np.array([s.force for s in grid])
    rng = np.random.default_rng(8)
    found = []
    for _ in range(600):
        r = with_errors(delta, force, USUAL, rng)
        found.append(errors_in_variables(r, USUAL).line.bend.value)
    assert promised.bend == pytest.approx(K, rel=1e-3)
    assert np.std(found) / K == pytest.approx(promised.error, rel=0.09)


def test_the_promised_error_of_the_estimate_is_the_one_that_comes() -> None:
    """δ̂/δ = (S₁/Ŝ₁)·(1 − K·G) + K̂·G·S₃/Ŝ₃, of 300 fits to readings with a poor spring scale.

    An interval of 95 % is ±1.96 standard deviations, which 300 fits give to 4 %.
    """
    tools, stiffest = replace(USUAL, scale=10.0), 2189.1
    design = 8 * stations(report_rig(), "column", 5, 5)
    promised = deflection_needs(report_rig(), "column", design, tools, looks=1)
    delta = np.array([s.deflection for s in design])
    force = np.array([s.force for s in design])
    rng = np.random.default_rng(12)
    ratios = []
    for _ in range(300):
        found = errors_in_variables(with_errors(delta, force, tools, rng), tools)
        seen = S1 / found.line.s1.value * (1.0 - K * stiffest)
        ratios.append(seen + found.line.bend.value * stiffest * S3 / found.s3.value)
    assert promised.half_width == pytest.approx(1.96 * np.std(ratios), rel=0.12)


def test_a_poor_spring_scale_costs_the_estimate_nothing() -> None:
    """δ̂ = (v₁ + (K̂·Ŝ₁/Ŝ₃)·v₃)/Ŝ₁: v₁, v₃ and the ruler give K̂·Ŝ₁/Ŝ₃ without the spring scale."""
    design = 8 * stations(report_rig(), "column", 5, 5)
    widths = [
        deflection_needs(report_rig(), "column", design, replace(USUAL, scale=scale_N)).half_width
        for scale_N in (3.0, 30.0)
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.01)


def test_the_fewest_readings_reach_what_is_wanted_and_no_grid_does_better() -> None:
    rig = report_rig()
    for share in (0.1, 0.05, 0.03):
        chosen = fewest(rig, "column", USUAL, share)
        design = [s for s, count in chosen for _ in range(count)]
        reached = precision(rig, "column", design, USUAL)
        assert reached.half_width <= share
        smaller = precision(rig, "column", design[:-1], USUAL)
        assert smaller.half_width > share
        for size in ((3, 3), (4, 4), (5, 5)):
            grid = precision(rig, "column", stations(rig, "column", *size), USUAL)
            if grid.half_width <= share:
                assert reached.readings <= grid.readings


def test_the_reports_advice_is_enough_for_5_percent() -> None:
    """Four or five gradients by four or five deflections: K to ± 4 to 5 % (95 %)."""
    widths = [
        precision(report_rig(), "column", stations(report_rig(), "column", n, n), USUAL).half_width
        for n in (4, 5)
    ]
    assert 0.03 < widths[1] < widths[0] < 0.05


def test_what_no_number_of_readings_gives_is_refused() -> None:
    with pytest.raises(InputError, match=r"400 readings do not give K to ±0\.1 %"):
        fewest(report_rig(), "column", USUAL, 0.001)
    with pytest.raises(InputError, match="does not overcome the breakout"):
        stations(read_rig(shipped_rigs()["737"]), "column", 3, 3, 40.0)


def test_a_form_has_a_row_a_reading() -> None:
    chosen = fewest(report_rig(), "column", USUAL, 0.05)
    lines = form(chosen, "column").splitlines()
    assert len(lines) == 1 + sum(count for _, count in chosen)
    assert lines[0] == (
        "gradient_set,deflection_m,force_N,v1_V,v3_V,force_after_N,deflection_after_m,"
        "v2_V,approach,remark"
    )
    assert all(line.count(",") == lines[0].count(",") for line in lines)
    once = form(chosen, "column", looks=1).splitlines()
    assert once[0] == "gradient_set,deflection_m,force_N,v1_V,v3_V,v2_V,approach,remark"
    assert all(line.count(",") == once[0].count(",") for line in once)


@pytest.mark.slow
def test_what_a_stiff_wheel_needs_is_said_and_does() -> None:
    """The T-37's stick bends little: of 25 readings δ̂ is right to 1.5 %, and 0.5 % is wanted."""
    rig, tools = read_rig(shipped_rigs()["t37"]), usual_instruments("wheel")
    grid = stations(rig, "wheel", 5, 5)
    needs = deflection_needs(rig, "wheel", grid, tools)
    assert needs.half_width == pytest.approx(0.0154, rel=0.02)
    assert needs.readings == 200
    assert needs.ruler is not None
    assert needs.ruler == pytest.approx(3.83, rel=0.02)
    finer = replace(
        tools, ruler=tools.ruler / needs.ruler, ruler_step=tools.ruler_step / needs.ruler
    )
    shares = [
        measure_coverage(CalibrationBench(rig, "wheel", places, with_tools), 60).deflection
        for places, with_tools in ((grid, tools), (8 * grid, tools), (grid, finer))
    ]
    assert shares[0] < 0.5
    assert min(shares[1:]) > 0.86  # 95 % by 3 standard deviations of 60


def test_a_plan_of_one_place_that_is_both_ends_takes_a_second() -> None:
    chosen = fewest(read_rig(shipped_rigs()["t37"]), "wheel", usual_instruments("wheel"), 0.1)
    assert len(chosen) >= 2
