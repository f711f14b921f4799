"""Since when, and how fast: courses of known shape, and onsets that are none but of amplitude."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.diagnose import diagnose
from coupled.gap.findings.where import in_time
from coupled.gap.search.course import Bounds, Course, Timing, course_of, course_of_events, timing_of
from coupled.record.record import Record
from tests.support.gaps import LONG_s, made, nominal_rig

RATE_Hz, LASTS_s = 120.0, 40.0
T_s = np.arange(round(LASTS_s * RATE_Hz)) / RATE_Hz
VALUE = Bounds(2.0, 1.9, 2.1)
Floats = NDArray[np.float64]
Size = Callable[[Floats], Floats]


def seen(size: Floats, seed: int = 1, action: Floats | None = None) -> Course:
    """Return the course found of an effect whose size goes so, its mean fitted beforehand."""
    acts = 20.0 * np.sin(2.0 * T_s) * (1.0 + 0.5 * np.sin(0.3 * T_s)) if action is None else action
    residual = size * acts + np.random.default_rng(seed).standard_normal(len(T_s))
    mean = float(residual @ acts) / float(acts @ acts)
    scaled = mean * acts
    value = Bounds(mean * VALUE.value, 0.0, 4.0)
    return course_of([(scaled, residual - scaled)], RATE_Hz, value, False)


@pytest.mark.parametrize("seed", range(8))
def test_what_is_the_same_all_the_time_has_no_onset_and_no_rate(seed: int) -> None:
    rising = 40.0 * T_s / LASTS_s * np.sin(2.0 * T_s)  # the motion grows, the effect does not
    for action in (None, rising):
        course = seen(np.ones_like(T_s), seed, action)
        assert course == Course("constant")


@pytest.mark.parametrize("onset_s", [6.0, 12.4, 31.0])
def test_what_begins_is_found_to_begin_within_its_interval(onset_s: float) -> None:
    course = seen((onset_s < T_s).astype(np.float64))
    assert course.kind == "from"
    assert course.onset_s is not None and course.rate_per_s is None
    assert course.onset_s.low <= onset_s <= course.onset_s.high
    assert course.onset_s.high - course.onset_s.low < 2.0
    power = (np.sin(2.0 * T_s) * (1.0 + 0.5 * np.sin(0.3 * T_s))) ** 2
    held = float(np.sum(power[onset_s < T_s]) / np.sum(power))
    assert course.then * held == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(("onset_s", "rate_per_s"), [(10.0, 0.05), (20.0, 0.1)])
def test_what_grows_has_an_onset_and_a_rate_in_their_intervals(
    onset_s: float, rate_per_s: float
) -> None:
    course = seen(rate_per_s * np.maximum(T_s - onset_s, 0.0))
    assert course.kind == "grows"
    onset, rate = course.onset_s, course.rate_per_s
    assert onset is not None and rate is not None
    assert onset.low <= onset_s <= onset.high
    assert rate.value == pytest.approx(VALUE.value * rate_per_s, rel=0.02)
    assert rate.high - rate.low < 0.3 * rate.value


def test_intervals_of_a_rate_hold_it_as_often_as_they_say() -> None:
    """Of 60 each, 95 %: 52 or more but for one time in 500."""
    worn = grown = 0
    for seed in range(60):
        course = seen(0.5 + T_s / LASTS_s, seed)
        assert course.kind == "changes"
        assert course.onset_s is None and course.rate_per_s is not None
        worn += course.rate_per_s.low <= VALUE.value / LASTS_s <= course.rate_per_s.high
        course = seen(0.1 * np.maximum(T_s - 20.0, 0.0), seed)
        assert course.kind == "grows"
        assert course.onset_s is not None and course.rate_per_s is not None
        assert course.onset_s.low <= 20.0 <= course.onset_s.high
        grown += course.rate_per_s.low <= 0.1 * VALUE.value <= course.rate_per_s.high
    assert min(worn, grown) >= 52


def test_events_are_counted_as_poissons() -> None:
    rng = np.random.default_rng(2)
    at_s = np.sort(rng.uniform(0.0, 60.0, 30))
    course = course_of_events(at_s, 60.0)
    assert course.onset_s is None and course.rate_per_s is not None
    # Garwood's interval of 30 events: 20.24 to 42.83.
    assert course.rate_per_s.low * 60.0 == pytest.approx(20.24, abs=0.01)
    assert course.rate_per_s.high * 60.0 == pytest.approx(42.83, abs=0.01)
    late = course_of_events(40.0 + at_s / 3.0, 60.0)
    assert late.onset_s is not None and late.rate_per_s is not None
    assert late.onset_s.low <= 40.0 <= late.onset_s.high
    assert late.rate_per_s.low <= 1.5 <= late.rate_per_s.high
    assert course_of_events(np.array([50.0]), 60.0).onset_s is None  # one event has no rate


def loud(size: Floats, motion: Floats) -> Any:
    """Return when a residual that goes with the cube of a motion is loud."""
    hiss = np.random.default_rng(3).standard_normal(len(T_s))
    return in_time(8.0 * size * motion**3 + hiss, {"x": motion}, RATE_Hz)


def test_a_gap_that_grows_with_amplitude_has_no_onset() -> None:
    growing = T_s / LASTS_s * np.sin(3.0 * T_s)
    assert loud(np.ones_like(T_s), growing).begins is None
    steady = np.sin(3.0 * T_s)
    found = loud((T_s > 15.0).astype(np.float64), steady)
    assert found.begins.low <= 15.0 <= found.begins.high
    assert found.ends is None
    jam = loud(((T_s > 15.0) & (T_s < 30.0)).astype(np.float64), steady)
    assert jam.begins.value == pytest.approx(15.0, abs=0.6)
    assert jam.ends.value == pytest.approx(30.0, abs=0.6)
    assert jam.ends.low <= 30.0 <= jam.ends.high


def coming(tmp_path: Path, values: dict[str, dict[str, float]], size: Size) -> Record:
    """Return a record of a linkage whose effect has a size in time; what it does goes with that."""
    nominal = nominal_rig(False)
    whole, faulty = (made(tmp_path, nominal, some, 4) for some in ({}, values))
    data, at = whole.data.copy(), whole.channels.index("column_deflection_m")
    data[:, at] += size(whole.time_s) * (faulty.data - whole.data)[:, at]
    return Record(whole.channels, data)


BENT = {"bend": {"bend_{d}_per_N": 1.6e-4}}
BENT_MORE = BENT["bend"]["bend_{d}_per_N"] - 9.14e-5


@pytest.mark.slow
def test_a_bend_that_comes_late_is_said_in_time(tmp_path: Path) -> None:
    record = coming(tmp_path, BENT, lambda t: np.where(t < 12.5, 0.0, 1.0))
    found = diagnose(nominal_rig(False), {"r.csv": record})
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert effect.parameters[0].found == pytest.approx(1.6e-4, rel=0.015)
    course = effect.course
    assert course is not None and course.onset_s is not None
    assert course.onset_s.low <= 12.5 <= course.onset_s.high
    assert "Bend: from 12.5 s on (12.3 to 12.8), then 1.60e-4 m/N." in found.summary
    said = effect.as_dict()["course"]
    assert said["kind"] == "from"
    assert said["onset_s"]["value"] == pytest.approx(12.5, abs=0.1)


@pytest.mark.slow
def test_a_bend_that_wears_from_nothing_is_as_large_as_at_the_end(tmp_path: Path) -> None:
    """What is said of it is its size at the record's end, and by how much it grew in a second."""
    begins_s = 15.0
    over_s = LONG_s - begins_s
    record = coming(tmp_path, BENT, lambda t: np.maximum(t - begins_s, 0.0) / over_s)
    found = diagnose(nominal_rig(False), {"r.csv": record})
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert effect.parameters[0].found == pytest.approx(1.6e-4, rel=0.015)
    course = effect.course
    assert course is not None and course.kind == "grows"
    assert course.onset_s is not None and course.rate_per_s is not None
    assert course.onset_s.low <= begins_s <= course.onset_s.high
    assert course.rate_per_s.low <= BENT_MORE / over_s <= course.rate_per_s.high


@pytest.mark.slow
def test_what_changes_from_the_first_is_said_and_no_cause(tmp_path: Path) -> None:
    found = diagnose(nominal_rig(False), {"r": coming(tmp_path, BENT, lambda t: t / LONG_s)})
    assert found.verdict == "unexplained"
    (effect,) = found.effects
    course = effect.course
    assert course is not None and course.kind == "changes" and course.rate_per_s is not None
    assert course.rate_per_s.low <= BENT_MORE / LONG_s <= course.rate_per_s.high


@pytest.mark.slow
def test_a_play_that_comes_late_is_as_large_as_it_is(tmp_path: Path) -> None:
    values = {"backlash": {"play_{d}": 1.5e-3}}
    record = coming(tmp_path, values, lambda t: np.where(t < 22.0, 0.0, 1.0))
    found = diagnose(nominal_rig(False), {"r.csv": record})
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert effect.name == "backlash"
    assert effect.value == pytest.approx(1.5e-3, rel=0.02)


@pytest.mark.parametrize("timing", [Timing(20.0, False), Timing(12.0, True), Timing(30.0, True)])
def test_a_timing_is_found_by_what_an_effect_does(timing: Timing) -> None:
    rng = np.random.default_rng(4)
    action = np.sin(1.3 * T_s) + 0.4 * np.sin(3.1 * T_s)
    size = timing.size(len(T_s), RATE_Hz)
    left = size * 5.0 * action - action + 0.5 * rng.standard_normal(len(T_s))
    found = timing_of([(action, left)], RATE_Hz)
    assert found.grows == timing.grows
    assert found.onset_s == pytest.approx(timing.onset_s, abs=0.25)
    assert size.max() == 1.0


@pytest.mark.slow
def test_a_drift_is_said_by_the_minute(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    found = diagnose(
        nominal, {"r.csv": made(tmp_path, nominal, {"scale_drift": {"per_s": 2e-3}}, 4)}
    )
    assert "Scale drift: at 12 % a minute (" in found.summary
