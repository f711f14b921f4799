"""Sensors that are reversed, clipped, held or absent: refused, or named beside the verdict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.signal import lfilter

import coupled
from coupled.errors import InputError
from coupled.gap.chain import Part
from coupled.gap.checks import check_record, clipped, not_measured
from coupled.gap.diagnose import diagnose, findings
from coupled.gap.prepare import prepare
from coupled.gap.search.beam import search_sets
from coupled.gap.signals.live import live_of
from coupled.record.channels import ControlName
from coupled.record.importing.plausible import drives_the_hand, held
from coupled.record.record import Record
from tests.support.gaps import made, nominal_rig
from tests.support.records import NOISE
from tests.support.rigs import bench

TIME_s = np.arange(1200) / 100.0
NAMES = ("time_s", "column_force_N", "column_computed_m", "column_deflection_m")


def moved(rate_Hz: float, signs: tuple[int, int, int] = (1, 1, 1)) -> Record:
    """Return a loader of 4 kg, 75 N·s/m and 560 N/m that moves in a sine, K = 9.1e-5 m/N."""
    turn = 2.0 * np.pi * rate_Hz
    place = 0.02 * np.sin(turn * TIME_s)
    rate = 0.02 * turn * np.cos(turn * TIME_s)
    force: NDArray[np.float64] = (560.0 - 4.0 * turn**2) * place + 75.0 * rate
    columns = [sign * each for sign, each in zip(signs, (force, place, place), strict=True)]
    noise = 1e-5 * np.random.default_rng(4).standard_normal((3, TIME_s.size))
    return Record(NAMES, np.column_stack([TIME_s, *(columns + noise)]))


@pytest.mark.parametrize("rate_Hz", [0.2, 1.0, 3.0])
def test_a_loader_takes_power_at_any_rate(rate_Hz: float) -> None:
    """At 3 Hz its inertia turns the force against the deflection: that is no reversed sign."""
    two = moved(rate_Hz), moved(rate_Hz * 1.3)
    force, place = (np.concatenate([each[name] for each in two]) for name in NAMES[1:3])
    assert not drives_the_hand(force, place)
    assert drives_the_hand(-force, place)


@pytest.mark.parametrize(
    ("signs", "name"),
    [((-1, 1, 1), "column_force_N"), ((1, 1, -1), "column_deflection_m")],
)
def test_a_reversed_sensor_is_refused_by_name(signs: tuple[int, int, int], name: str) -> None:
    rig = bench({})
    check_record(rig, moved(0.2), "column", "r.csv")
    with pytest.raises(InputError, match=f"r.csv: {name}: moves against column_computed_m"):
        check_record(rig, moved(0.2, signs), "column", "r.csv")


def test_a_clipped_sensor_is_named() -> None:
    record = moved(0.2)
    assert clipped(record, "column", "r.csv") == []
    data = record.data.copy()
    data[:, 1] = np.clip(data[:, 1], -10.0, 10.0)
    [said] = clipped(Record(NAMES, data), "column", "r.csv")
    assert "column_force_N of r.csv is clipped at 10" in said


@pytest.mark.parametrize("rows", [2, 6])
def test_a_sensor_that_renews_its_value_more_rarely_than_the_rows_is_named(rows: int) -> None:
    """A grip's transducer on a bus of 20 Hz was a servo lag, without a word on it."""
    record = moved(1.0)
    data = record.data.copy()
    data[:, 3] = data[np.arange(len(data)) // rows * rows, 3]
    [said] = not_measured(Record(NAMES, data), "column", "r.csv")
    assert f"column_deflection_m of r.csv holds each value over {rows}" in said


@pytest.mark.parametrize(
    ("column", "rows", "set_points", "count"),
    [(1, 50, False, 0), (1, 6, False, 1), (2, 50, False, 1), (2, 50, True, 0), (2, 6, True, 1)],
)
def test_what_a_bench_applies_in_long_steps_is_measured(
    column: int, rows: int, set_points: bool, count: int
) -> None:
    """A stair of force, held for half a second each, had halved the probability of any effect."""
    data = moved(1.0).data.copy()
    data[:, column] = data[np.arange(len(data)) // rows * rows, column]
    said = not_measured(Record(NAMES, data), "column", "r.csv", set_points)
    assert len(said) == count


def test_sensors_that_hold_their_values_alike_are_named_together() -> None:
    data = moved(1.0).data.copy()
    data[:, 1:] = data[np.arange(len(data)) // 4 * 4, 1:]
    (said,) = not_measured(Record(NAMES, data), "column", "r.csv")
    names = "column_force_N, column_computed_m and column_deflection_m"
    assert said.startswith(f"Each of {names} of r.csv holds each value over 4 rows: ")


@pytest.mark.slow
def test_an_effect_beside_a_sensor_that_holds_its_value_is_as_probably_the_recorders(
    tmp_path: Path,
) -> None:
    """A servo lag at 0.89 was the answer for a healthy machine."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {}, 5)
    data, at = record.data.copy(), record.channels.index("column_deflection_m")
    data[:, at] = data[np.arange(len(data)) // 6 * 6, at]
    found = diagnose(rig, {"r": replace(record, data=data)})
    assert found.verdict == "ambiguous"
    assert found.effects
    assert max(one.probability for one in found.effects) < 0.5
    assert "may be the recorder's" in found.summary


@pytest.mark.parametrize("value", [0.0, None])
def test_a_sensor_that_stands_still_while_the_control_moves_is_named(value: float | None) -> None:
    data = moved(1.0).data.copy()
    data[:, 1] += 0.02 * np.random.default_rng(5).standard_normal(len(data))
    data[510:530, 1] = data[510, 1] if value is None else value
    [said] = not_measured(Record(NAMES, data), "column", "r.csv")
    stuck = "stands still over rows 512 to 531"
    assert f"column_force_N of r.csv {stuck}" in said


def test_sensors_that_stand_still_over_the_same_rows_have_one_sentence() -> None:
    data = moved(1.0).data.copy()
    data[:, 1] += 0.02 * np.random.default_rng(5).standard_normal(len(data))
    data[510:530, 1] = data[510, 1]
    data[:, 2] = 0.5 * data[:, 1]
    [said] = not_measured(Record(NAMES, data), "column", "r.csv")
    assert said.startswith("Each of column_force_N and column_computed_m of r.csv stands still")


def test_a_reading_that_repeats_for_another_reason_is_not_named() -> None:
    rise = np.sin(TIME_s[:157])
    smooth = np.concatenate([np.zeros(300), rise, np.full(300, rise[-1]), rise[::-1]])
    noise = np.random.default_rng(1).standard_normal(smooth.size)
    rest = np.where(np.arange(smooth.size) < 200, 0.3, 0.3 + 0.01 * noise)
    for signal in (
        smooth,  # of a simulation without noise
        np.round(smooth + 0.01 * noise, 2),  # of an encoder
        np.round(smooth, 2),
        rest,  # of a sensor whose noise begins with the motion
        np.clip(smooth + 0.01 * noise, -0.5, 0.5),
        np.full(100, 3.0),
    ):
        assert held(signal) == ""


def filled(record: Record, lost: NDArray[np.bool_]) -> Record:
    """Return a record whose recorder fills lost rows with the last row."""
    fresh = np.where(lost, 0, np.arange(len(record)))
    data = record.data[np.maximum.accumulate(fresh)]
    data[:, 0] = record.data[:, 0]
    return replace(record, data=data)


@pytest.mark.slow
def test_rows_that_a_recorder_filled_with_the_last_row_are_no_readings(tmp_path: Path) -> None:
    """Digital multiplier and viscous damping at 0.89 were the answer for a healthy machine."""
    rig = nominal_rig(False)
    lost = np.random.default_rng(3).random(5000) < 0.02
    lost[:100] = False
    lost[300:308] = True  # longer than what is interpolated
    for given, names in (({}, []), ({"backlash": {"play_{d}": 1e-3}}, ["backlash"])):
        record = made(tmp_path, rig, given, 5)
        found = diagnose(rig, {"r": filled(record, lost[: len(record)])})
        assert [one.name for one in found.effects] == names
        assert max(stage.left or 0.0 for stage in found.stages) < 1.2
        assert "samples are missing" in found.summary


def test_rows_that_repeat_for_another_reason_are_readings() -> None:
    plain = moved(0.2).data
    coarse, slow = plain.copy(), plain[np.arange(1200) // 2 * 2]
    coarse[:, 1:] = np.round(plain[:, 1:], 4)
    smooth = np.column_stack([TIME_s, *3 * [np.clip(np.sin(TIME_s), 0.0, 1.0)]])
    for data in (plain, coarse, slow, smooth):
        data[:, 0] = TIME_s
        assert live_of(Record(NAMES, data)) is None


def test_an_encoder_at_rest_in_an_interpolated_log_is_not_named() -> None:
    """Play behind a servo stands still at each reversal: the recorder was as probable a cause."""
    rng = np.random.default_rng(6)
    log_s = TIME_s + rng.uniform(-1e-3, 1e-3, TIME_s.size)
    way, count, at = 0.7 * np.sin(2.6 * np.pi * log_s), 1.5e-3, 0.0
    follows = [at := min(max(at, x - 0.015), x + 0.015) for x in way.tolist()]
    read = PchipInterpolator(log_s, count * np.rint(np.array(follows) / count))(TIME_s[1:-1])
    assert held(read) == ""


def test_a_log_of_fewer_rows_than_the_record_is_named() -> None:
    record = moved(1.0)
    for log_rate_Hz, count in ((50.0, 1), (100.0, 0), (None, 0), ("50", 0)):
        manifest = {"import": {"clock": {"log_rate_Hz": log_rate_Hz}}}
        said = not_measured(replace(record, manifest=manifest), "column", "r.csv")
        assert len(said) == count
        assert all("interpolated between the 50 rows a second of its log" in one for one in said)


@pytest.mark.parametrize("control", ["wheel", None])
def test_a_control_without_channels_is_not_called_healthy(
    flown: Record, control: ControlName | None
) -> None:
    """Its answer was "No gap in the wheel", as if it had been judged."""
    nominal = coupled.load_rig("t37")
    names = [name for name in flown.channels if not name.startswith("column")]
    bare = Record(tuple(names), np.column_stack([flown[name] for name in names]))
    found = diagnose(nominal, {"r": bare}, control)
    assert "No gap in the airframe: every stage that could be judged" in found.summary


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """Return a record of a T-37 as its rig file says."""
    return made(tmp_path_factory.mktemp("flown"), nominal_rig(True), {}, 5)


@pytest.mark.parametrize(
    ("name", "against"), [("elevator_rad", "that of"), ("pitch_rate_rad_per_s", "pitch_rad")]
)
def test_a_motion_of_another_sign_is_refused(flown: Record, name: str, against: str) -> None:
    """A reversed surface was a gap that no effect explains."""
    data = flown.data.copy()
    data[:, flown.channels.index(name)] *= -1.0
    with pytest.raises(InputError, match=rf"r.csv: {name}: moves against {against}.*reversed"):
        diagnose(nominal_rig(True), {"r.csv": replace(flown, data=data)}, "column")


@pytest.mark.slow
def test_a_motion_of_the_models_sign_is_judged(flown: Record) -> None:
    assert diagnose(nominal_rig(True), {"r.csv": flown}, "column").verdict == "no_gap"


@pytest.mark.slow
def test_a_repeating_sensor_is_no_alternative_to_an_effect_that_explains_nothing(
    tmp_path: Path,
) -> None:
    """With a dead zone of the transducer and a bend of probability 4e-5, the verdict was wrong."""
    rig = nominal_rig(True)
    record = made(tmp_path, rig, {}, 31)
    data, at = record.data.copy(), record.channels.index("column_deflection_m")
    data[:, at] -= np.clip(data[:, at], -2e-3, 2e-3)
    dead = {"r": Record(record.channels, data, record.manifest)}
    prepared = prepare(rig, dead, Part("column"))
    assert prepared.by_recorder
    library = [effect for effect in prepared.library if effect.name == "bend"]
    found = findings(prepared, *search_sets(prepared.case, library))
    assert [effect.name for effect in found.effects] == ["bend"]
    assert found.verdict == "unexplained"


def test_slow_noise_of_a_sensor_is_named_as_what_it_may_be(tmp_path: Path) -> None:
    """The summary did not say what may leave a small residual that no signal predicts."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {}, 33)
    data, at = record.data.copy(), record.channels.index("column_deflection_m")
    kept = np.exp(-1.0 / (0.3 * rig.frame_rate))
    slow = lfilter([1.0], [1.0, -kept], np.random.default_rng(3).standard_normal(len(data)))
    data[:, at] += 1.2 * NOISE["column_deflection_m"] * slow / slow.std()
    drifting = {"r": Record(record.channels, data, record.manifest)}
    prepared = prepare(rig, drifting, Part("column"))
    library = [effect for effect in prepared.library if effect.name == "bend"]
    found = findings(prepared, *search_sets(prepared.case, library))
    assert found.guilty == ("linkage",)
    assert "no function of the stage's signals" in found.summary
    assert "slow noise of a sensor would look the same" in found.summary
