"""A servo that is given set points: dead time and play, of a machine that is not ours.

What each answer must be was written down before it was run.
"""

from __future__ import annotations

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.nominal import fit_nominal
from coupled.gap.signals.counts import as_counted
from coupled.gap.signals.drives import as_driven, in_set_points
from coupled.record.record import Record
from tests.support.machines import servo, servo_rig, set_points

POINTS = set_points(50.0, 40.0, 1)


def test_a_servo_beside_its_own_numbers_has_no_gap_and_no_loader() -> None:
    found = diagnose(servo_rig(), {"r": servo(POINTS, delay_s=0.0, play_m=0.0)})
    assert found.verdict == "no_gap"
    assert found.stage("loader").why == "δc is a set point"
    assert found.stage("linkage").gap == pytest.approx(1.0, abs=0.1)
    assert found.next_test == ""  # it has no force, no host, no schedule to record


def test_set_points_slower_than_the_log_are_seen_as_such() -> None:
    slow = set_points(50.0, 40.0, 1, every=2)
    record = servo(slow, delay_s=0.0, play_m=0.0)
    rig = servo_rig(drive="force")
    assert as_driven(rig, [record], "column") == servo_rig()
    assert not in_set_points(POINTS)  # one a row: the file has to say it
    noise = np.random.default_rng(1).normal(0.0, 1e-3, len(slow))
    assert not in_set_points(slow + noise)
    assert not in_set_points(1e-3 * np.round(POINTS / 1e-3))  # a sensor's counts
    steps = np.repeat([0.0, 0.1, -0.2, 0.3, 0.0], 400)
    assert not in_set_points(steps)  # a few holds are a test's own


@pytest.mark.slow
@pytest.mark.parametrize(
    ("real", "frequency_Hz", "names"),
    [
        ({"delay_s": 0.0}, 6.0, {"backlash"}),
        ({"play_m": 0.0}, 6.0, {"servo_delay"}),
        ({}, 6.0, {"servo_delay", "backlash"}),
        ({}, 3.0, {"servo_delay", "backlash"}),  # a rig fitted without dead time: too slow
    ],
    ids=["play", "dead time", "both", "both, and a servo too slow"],
)
def test_dead_time_and_play_are_named_apart(
    real: dict[str, float], frequency_Hz: float, names: set[str]
) -> None:
    truth = {"delay_s": 0.06, "play_m": 0.02} | real
    record = servo(POINTS, delay_s=truth["delay_s"], play_m=truth["play_m"])
    found = diagnose(servo_rig(frequency_Hz=frequency_Hz), {"r": record})
    assert found.verdict == "effect"
    assert {effect.name for effect in found.effects} == names
    loader = found.improved.controls["column"].loader
    assert loader.play == pytest.approx(truth["play_m"], abs=4e-4)
    assert loader.servo_delay == pytest.approx(truth["delay_s"], abs=3e-3)
    if "servo_delay" in names:
        assert loader.servo_frequency == pytest.approx(6.0, rel=0.04)


@pytest.mark.slow
def test_a_servos_numbers_are_fitted_with_its_dead_time() -> None:
    truth = {"servo_frequency_Hz": 6.0, "servo_delay_s": 0.06, "play_m": 0.02}
    keys = [f"loader.{key}" for key in truth]
    fitted = fit_nominal(servo_rig(frequency_Hz=3.0), {"r": servo(POINTS)}, keys)
    numbers = {number.key.removeprefix("loader."): number for number in fitted.numbers}
    for key, wanted in truth.items():
        assert numbers[key].interval is not None
        low, high = numbers[key].interval or (0.0, 0.0)
        assert low < wanted < high, (key, low, high)


def test_an_encoders_zero_is_known_to_a_count_and_no_finer() -> None:
    record = servo(POINTS)
    key = "sensing.deflection_zero_m"
    counted = as_counted(servo_rig(), [record], "column")
    assert counted.controls["column"].tolerance == {key: pytest.approx(1.5e-3)}
    filed = servo_rig().changed({"controls.column.tolerance": {key: 0.01}})
    assert as_counted(filed, [record], "column") == filed
    data = record.data + np.random.default_rng(3).normal(0.0, 3e-3, record.data.shape)
    fine = Record(record.channels, np.column_stack((record.time_s, data[:, 1:])))
    assert as_counted(servo_rig(), [fine], "column") == servo_rig()
