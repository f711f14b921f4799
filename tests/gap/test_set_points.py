"""A servo that is given set points: dead time and play, of a machine that is not ours.

What each answer must be was written down before it was run.
"""

from __future__ import annotations

import numpy as np
import pytest

from coupled.gap.chain import STAGES
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.airframe import AIRFRAME, MOTION_ZEROS
from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.nominal import fit_nominal
from coupled.gap.prepare import as_counted, as_driven, in_set_points, readers_of
from coupled.gap.signals.output import Output
from coupled.gap.stages.tried import tried_effects
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


def test_a_number_without_noise_is_a_set_point_however_fast_they_come() -> None:
    record = servo(POINTS)
    rig = servo_rig(drive="force")
    assert as_driven(rig, [record], "column") == servo_rig()
    rng = np.random.default_rng(2)
    hiss = rng.normal(0.0, 1e-4, len(POINTS))
    for measured in (POINTS + hiss, 1.5e-3 * np.round(POINTS / 1.5e-3)):
        data = record.data.copy()
        data[:, record.channels.index("column_computed_m")] = measured
        assert as_driven(rig, [Record(record.channels, data)], "column") == rig
    times = np.arange(3000) / 50.0
    chirp = 0.3 * np.sin(2.0 * np.pi * times * (0.1 + 7.0 * times / times[-1]))
    swept = servo(chirp)  # to 14 Hz: noise estimated over all frames includes it
    assert as_driven(rig, [swept], "column") == servo_rig()
    hosted = np.column_stack((record.data, np.full(len(POINTS), 1000.0)))
    host = Record((*record.channels, "column_gradient_N_per_m"), hosted)
    assert as_driven(rig, [host], "column") == rig


def test_one_record_that_shows_set_points_is_enough_for_the_machine() -> None:
    """Another may be too slow to show them: it moves by one count a frame, which says nothing."""
    slow = servo(1.5e-3 * np.minimum(np.arange(600), 100.0))
    rig = servo_rig(drive="force")
    assert as_driven(rig, [slow], "column") == rig
    assert as_driven(rig, [slow, servo(POINTS)], "column") == servo_rig()


def _tried(record: Record) -> list[Effect]:
    """Return the effects that a record of set points lets be tried."""
    readers = readers_of({"r": servo_rig()}, {"r": record}, "column")
    outputs = [Output(stage, stage, POINTS, lambda _: POINTS, 1.0, 50.0) for stage in STAGES]
    return tried_effects(EFFECTS, readers, outputs)


def test_set_points_whose_grip_nobody_recorded_have_a_limit_at_any_rate() -> None:
    """As where a flight is judged by its surface alone."""
    record = servo(POINTS)
    at = [i for i, name in enumerate(record.channels) if name != "column_deflection_m"]
    blind = Record(tuple(record.channels[i] for i in at), record.data[:, at])
    [limit] = BY_NAME["servo_rate_limit"].parameters
    library = _tried(blind)
    assert next(one for one in library if one.name == "servo_rate_limit").parameters == (limit,)


def test_a_set_point_has_no_scale_and_no_limit_below_the_speed_that_was_reached() -> None:
    swift = servo(POINTS)
    library = _tried(swift)
    left = {effect.name for effect in EFFECTS} - {effect.name for effect in library}
    # Those that need channels which the record lacks, a regressor, or an axis that turns.
    of_channels = {"crosstalk", "gravity", *(effect.name for effect in AIRFRAME if effect.needs)}
    of_channels |= {"regressor_force", "regressor_friction", *(one.name for one in MOTION_ZEROS)}
    of_imposed_motion = {"yielding_contact"}
    assert (
        left == {"deflection_scale", "scale_drift", "mains_hum"} | of_channels | of_imposed_motion
    )
    [limit] = next(one for one in library if one.name == "servo_rate_limit").parameters
    speed = np.max(np.abs(np.gradient(swift["column_deflection_m"], 1 / 50)))
    assert 0.5 * speed < limit.low < 1.02 * speed
    slow = servo(np.clip(5e-4 * np.arange(1000), 0.0, 0.2))  # a ramp of 25 mm/s
    library = _tried(slow)
    [limit] = next(one for one in library if one.name == "servo_rate_limit").parameters
    assert 0.0 < limit.low < 0.025


@pytest.mark.slow
@pytest.mark.parametrize("filed_Hz", [6.0, 3.0])
def test_a_motor_that_accelerates_by_no_more_than_it_can_is_told_from_a_slow_servo(
    filed_Hz: float,
) -> None:
    record = servo(2.0 * POINTS, most_m_per_s2=6.0)
    found = diagnose(servo_rig(frequency_Hz=filed_Hz), {"r": record})
    assert found.verdict == "effect", found.summary
    names = {effect.name for effect in found.effects}
    # A servo filed at half its frequency may be found with its damping ratio, which is as filed.
    assert names - {"servo_delay", "servo_tuning"} == {"servo_acceleration_limit", "backlash"}
    loader = found.improved.controls["column"].loader
    # A servo's frequency, its dead time and what it accelerates by pass for one another.
    assert loader.servo_acceleration_limit == pytest.approx(6.0, rel=0.06)
    assert loader.play == pytest.approx(0.02, abs=5e-4)
    assert loader.servo_delay == pytest.approx(0.06, abs=3e-3)
    assert loader.servo_frequency == pytest.approx(6.0, rel=0.06)


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
