"""The virtual bench: exact without noise, correct coverage with noise, and calibrated flights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupled.authority.compare import Outcome, compare
from coupled.calibration.accuracy import actual_over_ordered, deflection_off, felt_off
from coupled.calibration.assumedscales import Scales, real_scales
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.calibrated import with_calibration
from coupled.calibration.coverage import measure_coverage
from coupled.calibration.estimate import perfect_instruments, usual_instruments
from coupled.calibration.plan import stations
from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Configuration
from coupled.flight.pilot.base import Start
from coupled.flight.runfile import read_run
from coupled.record.channels import ControlName
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text
from coupled.rig.standalone import run_control, under_supply
from coupled.rig.statics import static_line
from tests.support.readings import report_rig
from tests.support.rigs import G_STIFF, K_REPORT
from tests.support.rigs import bench as bench_rig

CHANGES: dict[str, Any] = {
    "controls.column.loader.breakout_N": 8.0,
    "controls.column.sensing.computed_scale": 0.95,
    "controls.column.sensing.deflection_scale": 0.98,
    "controls.column.sensing.force_scale": 1.04,
    "controls.column.sensing.modifying_scale": 1.1,
    "controls.column.sensing.word_length_bits": 12,
}


def without_errors(rig: Rig, control: ControlName) -> tuple[Any, Any]:
    grid = stations(rig, control, 4, 4)
    readings = take_readings(CalibrationBench(rig, control, grid, perfect_instruments()), 0)
    data = rig.controls[control]
    return calibrate_control(readings, data, control, perfect_instruments(), "bench"), data


@pytest.mark.parametrize("changes", [{}, CHANGES], ids=["as shipped", "off in every scale"])
def test_noise_free_readings_give_s1_s2_s3_and_k_to_1e_9(changes: dict[str, Any]) -> None:
    rig = read_rig(shipped_rigs()["report-column"], changes)
    found, data = without_errors(rig, "column")
    true = real_scales(data)
    assert found.line.s1.value == pytest.approx(true.s1, rel=1e-9)
    assert found.line.bend.value == pytest.approx(data.loader.bend, rel=1e-9)
    assert found.s3.value == pytest.approx(true.s3, rel=1e-9)
    assert found.s2["the null, eq. (14)"].value == pytest.approx(true.s2, rel=1e-9)
    assert not found.suspects


@pytest.mark.parametrize(
    ("name", "control"), [("bench", "column"), ("c172p", "wheel"), ("c172p", "pedals")]
)
def test_noise_free_readings_give_k_with_breakout_friction_and_two_segments(
    name: str, control: ControlName
) -> None:
    found, data = without_errors(read_rig(shipped_rigs()[name]), control)
    true = real_scales(data)
    assert found.line.bend.value == pytest.approx(data.loader.bend, rel=1e-8)
    assert found.line.s1.value == pytest.approx(true.s1, rel=1e-9)
    assert found.s2_chosen.value == pytest.approx(true.s2, rel=1e-8)


def test_friction_is_the_same_with_hand_and_supply() -> None:
    """15 N of friction in 100 N of force: the null still finds S₂ to 1e-5."""
    found, data = without_errors(read_rig(shipped_rigs()["737"]), "column")
    assert found.s2_chosen.value == pytest.approx(real_scales(data).s2, rel=1e-5)


def test_one_gradient_at_every_pressure_cannot_be_benched() -> None:
    with pytest.raises(InputError, match="has one gradient only"):
        stations(read_rig(shipped_rigs()["737"]), "wheel", 3, 3)


@pytest.mark.slow
def test_the_bench_is_the_rig_that_flies() -> None:
    """A run at given pressures is the frame loop's on a rig without aircraft, to the last bit."""
    scenario = read_run("appendix-c")[0]
    rig = scenario.rig
    flown = fly(scenario)
    pressure = flown["dynamic_pressure_Pa"]
    action = scenario.pilots["column"].act(rig, "column", Start(0.0))
    frames = scenario.frames
    nodes = np.arange(frames * rig.substeps + 1, dtype=np.float64)
    times = nodes * (1.0 / (rig.frame_rate * rig.substeps))
    assert action.force is not None
    response = run_control(rig, "column", action.force(times), pressure)
    np.testing.assert_array_equal(response.computed, flown["column_computed_m"])
    np.testing.assert_array_equal(response.deflection, flown["column_deflection_m"])
    np.testing.assert_array_equal(response.estimate, flown["column_estimate_m"])


def test_a_supply_moves_the_control_as_the_hands_force_does() -> None:
    """At rest G_B·δc = v₂/S₂, with v₃ = 0: appendix B."""
    rests_at = under_supply(bench_rig(), "column", 0.5, 4.0)
    assert rests_at(0.0, 28.0) == pytest.approx(0.05, rel=1e-9)
    assert rests_at(0.0, -28.0) == pytest.approx(-0.05, rel=1e-9)


def test_a_supply_from_beyond_comes_to_rest_on_frictions_other_side() -> None:
    """G_B·δc = v₂/S₂ − f outward, + f where it was turned up further first."""
    rests_at = under_supply(bench_rig({"friction_N": 6.0}), "column", 2.0, 4.0)
    assert rests_at(45.0, 50.0) == pytest.approx(44.0 / 560.0, rel=2e-3)
    assert rests_at(70.0, 50.0) == pytest.approx(56.0 / 560.0, rel=2e-3)


def test_a_hand_that_eases_back_leaves_the_control_where_it_is() -> None:
    """On the 737's column a wandering hand moves nothing between the ruler's look and v₁'s.

    All instruments perfect: v₁ = S₁·(δ − K·F) is off by the wander of the bend alone,
    2·0.3 % of K·F at most nine times in ten, and not by creep, which has one sign.
    """
    rig = read_rig(shipped_rigs()["737"])
    tools = replace(perfect_instruments(), hand=0.003)
    made = CalibrationBench(rig, "column", stations(rig, "column", 4, 4), tools, 0)
    off = []
    for seed in range(4):
        r = take_readings(made, seed)
        true, bend = real_scales(rig.controls["column"]), rig.controls["column"].loader.bend
        off.append((r.v1 / true.s1 - r.deflection + bend * r.force) / (bend * r.force))
        assert np.all(np.abs(r.deflection_rise) < 0.02 * bend * r.force)
    share = np.concatenate(off)
    assert abs(np.mean(share)) < 4.0 * np.std(share) / np.sqrt(len(share))
    assert np.mean(np.abs(share) < 0.006) > 0.9


@pytest.mark.parametrize(("name", "control"), [("737", "column"), ("c172p", "pedals")])
def test_the_mean_of_both_sides_is_s2_where_one_side_is_not(
    name: str, control: ControlName
) -> None:
    """Friction keeps a wandering hand's extreme: outward nulls are high, inward ones low."""
    rig = read_rig(shipped_rigs()[name])
    tools = replace(perfect_instruments(), hand=0.003)
    made = CalibrationBench(rig, control, stations(rig, control, 2, 1), tools, 50)
    read = take_readings(made, 1)
    true = real_scales(rig.controls[control])
    ratio = read.null_v2 / read.null_v3 * true.s3 / true.s2 - 1.0
    out, back = ratio[read.null_side > 0.0].mean(), ratio[read.null_side < 0.0].mean()
    assert out > 0.002
    assert back < -0.002
    assert abs(0.5 * (out + back)) < 0.0018  # 4 standard errors


def test_scales_that_are_off_are_felt_by_the_host() -> None:
    changes = {
        "controls.column.sensing.force_scale": 1.1,
        "controls.column.sensing.modifying_scale": 1.25,
    }
    rig = bench_rig(changes)
    force = np.full(400 * rig.substeps + 1, 50.0)
    response = run_control(rig, "column", force, np.full(400, 3000.0))
    assert response.force[-1] == pytest.approx(55.0)
    plain = run_control(bench_rig(), "column", force, np.full(400, 3000.0))
    ratio = (response.modifying[-1] / response.computed[-1]) / (
        plain.modifying[-1] / plain.computed[-1]
    )
    assert ratio == pytest.approx(1.0 / 1.25, rel=1e-9)


def test_a_seed_repeats_a_bench_and_another_does_not() -> None:
    rig = report_rig()
    made = CalibrationBench(
        rig, "column", stations(rig, "column", 2, 2), usual_instruments("column")
    )
    one, two, other = (take_readings(made, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.v1, two.v1)
    assert np.any(one.v1 != other.v1)
    for mean, rise, step in (
        (one.deflection, one.deflection_rise, 0.5e-3),
        (one.force, one.force_rise, 0.5),
    ):
        for look in (mean - 0.5 * rise, mean + 0.5 * rise):
            np.testing.assert_allclose(look / step, np.round(look / step), atol=1e-6)
        assert np.any(rise != 0.0)
    once = take_readings(replace(made, again=False), 1)
    assert np.all(once.deflection_looks == 1.0)
    assert np.all(one.deflection_looks == 2.0)


@pytest.mark.slow
def test_intervals_hold_the_truth_and_k_is_within_5_percent() -> None:
    """120 benches of 25 readings; the benchmark counts 1000."""
    rig = report_rig()
    made = CalibrationBench(
        rig, "column", stations(rig, "column", 5, 5), usual_instruments("column")
    )
    found = measure_coverage(made, 120, seed=5000)
    print("\n" + str(found))
    for name, share in found.covered.items():
        assert share > 0.89, name  # 3 standard deviations of a binomial below 0.95
    assert found.within > 0.93
    assert abs(found.bias) < 0.01
    assert found.accused < 0.03


def flown(rig: Rig, configuration: Configuration) -> Outcome:
    base = read_run("worst-case")[0]
    [flight] = compare([replace(base, rig=rig, configurations=(configuration,))])
    return flight.outcome


def test_a_bench_calibrated_and_flown_has_the_promised_authority(tmp_path: Path) -> None:
    """A calibration restores the authority and feel of a rig that lost 20 %.

    The rig's S₁ is 4 % off and K̂ is 0: 1 − 0.96/1.2 = 20 % is lost.
    """
    base = read_run("worst-case")[0].rig
    rig = base.changed(
        {
            "controls.column.compensation.bend_m_per_N": 0.0,
            "controls.column.sensing.computed_scale": 0.96,
            "controls.column.sensing.force_scale": 1.03,
            "controls.column.sensing.modifying_scale": 0.97,
        }
    )
    never = rig.controls["column"]
    assert flown(rig, "compensated").loss == pytest.approx(0.20, abs=0.012)
    tools = usual_instruments("column")
    true, bend = real_scales(never), never.loader.bend
    for seed in range(4):
        grid = stations(rig, "column", 5, 5)
        readings = take_readings(CalibrationBench(rig, "column", grid, tools), seed)
        found = calibrate_control(readings, never, "column", tools, "bench")
        path = tmp_path / "new.toml"
        path.write_text(rig_text(with_calibration(rig, "column", found)), encoding="utf-8")
        after = flown(read_rig(path), "compensated")
        print(f"full circle: loss {100 * after.loss:+.2f} %, felt {after.felt_ratio:.4f}")
        assert abs(after.loss) < 0.005
        assert after.felt_ratio == pytest.approx(1.0, abs=0.01)
        # and it is what the closed form of the coverage's count says
        s2 = found.s2["the null, eq. (14)"]
        assert found.s3 is not None
        assumed = Scales(found.line.s1.value, s2.value, found.s3.value)
        k, stiff = found.line.bend.value, max(never.schedule.total_gradient)
        off = deflection_off(assumed, k, true, bend, stiff)
        made = actual_over_ordered(assumed, true)
        felt = felt_off(made, k, bend, (stiff, never.loader.basic_gradient))
        assert after.loss == pytest.approx(-off, abs=4e-4)
        assert after.felt_ratio - 1.0 == pytest.approx(felt, abs=4e-4)


def test_a_bench_that_cannot_be_fitted_says_so_from_another_process() -> None:
    """An error in a worker process is reported in the same one line."""
    rig = report_rig()
    few = stations(rig, "column", 3, 1)
    with pytest.raises(InputError, match="in 3 rows; 4 readings are the least"):
        measure_coverage(
            CalibrationBench(rig, "column", few, usual_instruments("column"), 0), 2, workers=2
        )


def test_a_wandering_hand_parts_the_instruments_readings() -> None:
    """With perfect instruments read in sequence, the residual is the hand's 1 % variation."""
    rig = report_rig()
    tools = replace(perfect_instruments(), hand=0.01)
    readings = take_readings(
        CalibrationBench(rig, "column", stations(rig, "column", 5, 5), tools, 0), 2
    )
    found = calibrate_control(readings, rig.controls["column"], "column", tools, "bench")
    assert 0.6 < found.line.excess < 1.3
    assert np.std(readings.v3 / readings.force) / 0.25 == pytest.approx(0.014, rel=0.4)


def test_statics_and_frames_agree_on_scales_that_are_off() -> None:
    """The host's δ̂ and F_mod, breakout's term and all, in closed form and stepped to rest."""
    rig = bench_rig({**CHANGES, "controls.column.sensing.word_length_bits": 0})
    response = run_control(
        rig, "column", np.full(600 * rig.substeps + 1, 70.0), np.full(600, 3000.0)
    )
    line = static_line(rig, "column", 3000.0, response.computed[-1:] / (0.95 * 0.98))
    assert line.force[0] == pytest.approx(70.0, rel=1e-9)
    assert response.estimate[-1] == pytest.approx(line.estimate[0], rel=1e-9)
    control = rig.controls["column"]
    asked = (line.force[0] - 8.0 - 560.0 * line.computed[0]) * 1.1
    felt = G_STIFF / (1.0 - K_REPORT * G_STIFF)
    extra = felt * K_REPORT * control.loader.breakout
    seen = 0.95 * line.computed[0]  # v₁, which the analog multiplier gets
    assert asked == pytest.approx((felt - 560.0) * seen + extra, rel=1e-9)
