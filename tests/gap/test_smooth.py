"""Taking noise off a smooth signal: white, or coloured, with more of it at low frequencies."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from coupled.gap.effects.library import BY_NAME
from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import Smoother, corners_in, smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
from coupled.rig.replay import replay_linkage
from tests.support import gaps

RATE_Hz = 120.0


def pushes(seed: int, most_Hz: float = 3.0, frames: int = 4800) -> NDArray[np.float64]:
    """Return a smooth motion of many frequencies up to one, of rms 1."""
    rng = np.random.default_rng(seed)
    at = np.arange(frames) / RATE_Hz
    waves = [
        np.sin(2.0 * np.pi * f * at + rng.uniform(0.0, 6.0)) for f in rng.uniform(0.1, most_Hz, 12)
    ]
    return np.asarray(sum(waves) / math.sqrt(6.0))


@pytest.mark.parametrize("memory", [0.2, 0.5, 0.7])
def test_coloured_noise_is_not_kept_as_a_part_of_the_motion(memory: float) -> None:
    """Taken for white, what it has more of at low frequencies passed for motion."""
    noise = Noise(0.01, memory)
    wrong, white = [], []
    for seed in range(6):
        true = pushes(seed)
        read = true + noise.sample(len(true), np.random.default_rng(seed))
        wrong.append(np.std(smoothed(read, noise) - true))
        white.append(np.std(smoothed(read, Noise(0.01)) - true))
        estimated = smoothed(read)
        assert np.std(estimated - true) < 1.3 * wrong[-1]
    assert np.mean(wrong) < 0.9 * np.mean(white)


@given(memory=st.floats(0.0, 0.84), seed=st.integers(0, 50))
def test_a_smoother_passes_what_is_slow_and_adds_nothing(memory: float, seed: int) -> None:
    gain = Smoother.of(pushes(seed, frames=600), noise=Noise(0.01, memory)).gain
    assert gain[0] == 1.0
    assert np.all(np.diff(gain) <= 1e-12)
    assert gain[-1] >= 0.0


def test_a_servo_is_found_as_it_is_beside_coloured_noise_of_its_command() -> None:
    """Noise that drives the replay made the servo slower than it is, and its dead time shorter."""
    nominal = gaps.nominal_rig(False)
    nominal = nominal.changed({"controls.column.loader.servo_frequency_Hz": 19.0})
    real = nominal.changed({"controls.column.loader.servo_delay_s": 0.02})
    at = np.arange(4800) / RATE_Hz
    command = 0.02 * pushes(1, 1.5)
    motion = replay_linkage(real, "column", command, np.zeros(len(at)))
    found = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        data = {
            "time_s": at,
            "column_force_N": np.zeros(len(at)),
            "column_computed_m": command + Noise(4e-5, 0.3).sample(len(at), rng),
            "column_deflection_m": motion + rng.normal(0.0, 4e-5, len(at)),
        }
        record = Record(tuple(data), np.column_stack(list(data.values())))
        outputs = Reader(nominal, record, "column", surface_points).outputs()
        case = Case(nominal, "column", [one for one in outputs if one.stage == "linkage"])
        values = Problem(case).fit((BY_NAME["servo_delay"],)).values
        found.append([values["servo_delay.factor"], values["servo_delay.delay_s"]])
    assert np.mean(found, axis=0) == pytest.approx([1.0, 0.02], rel=0.03)


def test_a_noise_as_large_as_the_signal_may_be_the_signal_and_lends_it_no_colour() -> None:
    broad = Noise(1.0, 0.48).sample(2400, np.random.default_rng(1))
    as_white = Smoother.of(broad, noise=Noise(1.0)).gain
    assert np.array_equal(Smoother.of(broad, noise=Noise(1.0, 0.48)).gain, as_white)
    assert np.array_equal(Smoother.of(broad).gain, as_white)


def trapezoids(slope: float, at: float = 0.0) -> NDArray[np.float64]:
    """Return a doublet and a 3-2-1-1 with ramps of 18 frames, from frame 600 + `at` on."""
    frames, force = np.arange(2400.0), np.zeros(2400)
    for first, height in ((600, 1.0), (720, -2.0), (840, 1.0), (1200, 1.0), (1560, -2.0)):
        force += height * slope * np.clip(frames - first - at, 0.0, 18.0)
    return force


def polygon(signal: NDArray[np.float64]) -> NDArray[np.float64]:
    return corners_in(signal).over(np.arange(len(signal), dtype=np.float64))


@given(
    slope=st.floats(0.3, 3.0),
    at=st.floats(0.0, 1.0),
    noise=st.floats(0.0, 0.1),
    seed=st.integers(0, 30),
)
def test_the_corners_of_a_script_are_seen_where_they_are(
    slope: float, at: float, noise: float, seed: int
) -> None:
    """Of 1500 drawn records none lost a corner of 10 times the noise, 7 one of 7 times."""
    true = trapezoids(slope, at)
    read = true + noise * slope * np.random.default_rng(seed).standard_normal(len(true))
    turns = np.abs(np.diff(polygon(read), 2))
    sharp = np.abs(np.diff(true, 2)) > 0.2 * slope
    beside = np.convolve(sharp, np.ones(5), mode="same") > 0.0
    assert np.all(turns[~beside] < 0.3 * slope)
    for frame in np.flatnonzero(sharp):
        assert turns[max(frame - 2, 0) : frame + 3].sum() > 0.5 * slope


def test_a_smoother_neither_rounds_a_corner_nor_rings_beside_it() -> None:
    """It once overshot by 3.5 times the noise, and dry friction kept the peak."""
    true, noise = trapezoids(2.4), 0.05
    worst = []
    for seed in range(8):
        read = true + noise * np.random.default_rng(seed).standard_normal(len(true))
        worst.append(
            float(np.max(np.abs(Smoother.of(read, with_corners=True).smooth(read) - true)))
        )
    assert np.mean(worst) < 2.5 * noise


@given(seed=st.integers(0, 40), noise=st.sampled_from([0.0, 0.001, 0.01]))
def test_a_smooth_motion_has_no_corners(seed: int, noise: float) -> None:
    read = pushes(seed, frames=2400)
    read += noise * np.random.default_rng(seed).standard_normal(len(read))
    assert corners_in(read).each == ()


@given(rounded=st.floats(6.0, 12.0), seed=st.integers(0, 20))
def test_a_corner_that_a_servo_has_rounded_is_none(rounded: float, seed: int) -> None:
    """Where the noise lets the rounding be seen."""
    width = np.hanning(round(2.0 * rounded) + 1)
    true = np.convolve(np.pad(trapezoids(2.4), 40, mode="edge"), width / width.sum(), mode="same")
    read = true[40:-40] + 0.002 * np.random.default_rng(seed).standard_normal(2400)
    assert not np.any(np.abs(np.diff(polygon(read), 2)) > 0.3)
