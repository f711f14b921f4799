"""How often the intervals of 1000 benches hold the truth, and what a fit takes.

Run alone, with its figures printed:  pytest -m bench -s
"""

from __future__ import annotations

import os
import time

import pytest

from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.coverage import measure_coverage
from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.plan import stations
from tests.support.readings import report_rig

USUAL = usual_instruments("column")


def usual_bench() -> CalibrationBench:
    rig = report_rig()
    return CalibrationBench(rig, "column", stations(rig, "column", 5, 5), USUAL)


@pytest.mark.slow
def test_the_intervals_of_1000_benches_hold_the_truth() -> None:
    made = usual_bench()
    take_readings(made, 0)  # the first compiles the physics
    start, before = time.perf_counter(), os.times()
    found = measure_coverage(made, 1000, workers=2)
    taken, after = time.perf_counter() - start, os.times()
    worked = after.children_user + after.children_system
    worked -= before.children_user + before.children_system
    print(f"\n1000 benches and fits: {taken:.1f} s, {worked:.1f} s of two cores' work")
    for name, share in found.covered.items():
        print(f"  95 % interval of {name} holds the truth in {100 * share:.1f} %")
        assert 0.93 <= share <= 0.97
    print(f"  K within 5 % in {100 * found.within:.1f} %; bias {100 * found.bias:+.2f} %")
    print(f"  a good reading accused in {100 * found.accused:.1f} %")
    print(f"  compensated, deflection and felt gradient right in {100 * found.circle:.1f} %")
    assert found.circle > 0.985
    assert found.within > 0.99
    assert abs(found.bias) < 0.003
    assert found.accused < 0.01


@pytest.mark.bench
def test_a_calibration_costs_less_than_20_of_its_fits() -> None:
    made = usual_bench()
    readings = take_readings(made, 1)
    data = made.rig.controls["column"]
    taken, fits = [], []
    for _ in range(30):
        start = time.perf_counter()
        calibrate_control(readings, data, "column", USUAL, "bench")
        between = time.perf_counter()
        errors_in_variables(readings, USUAL)
        taken.append(between - start)
        fits.append(time.perf_counter() - between)
    print(f"\na calibration from 25 readings and 6 nulls: {1e3 * min(taken):.1f} ms,", end=" ")
    print(f"{min(taken) / min(fits):.1f} of its fits")
    assert min(taken) < 20.0 * min(fits)
