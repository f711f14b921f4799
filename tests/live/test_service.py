"""K in service: found without bias, frozen without excitation, alarmed, and adapted to."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter, lsim

from coupled.api.rigs import load_rig
from coupled.live.service import LEAST_N, Adaptation, BendEstimator, ServiceBend
from coupled.plots.service import lost_share
from tests.support.softening import TIMES, SOFTENS_s, softened

FRAME_s = 1.0 / 120.0
COLUMN = load_rig("report-column").controls["column"]
K = COLUMN.loader.bend


def seen(bend: float, force: np.ndarray, noise: float, seed: int) -> ServiceBend:
    """Return what is found of a control held still at δc = 0 under a force, δ = K·F + noise."""
    estimator = BendEstimator(COLUMN, FRAME_s)
    random = np.random.default_rng(seed)
    for f in force:
        estimator.update(float(f), 0.0, bend * f + 1e-3 + noise * random.standard_normal())
    return estimator.now


def test_the_slope_is_that_of_least_squares_without_noise() -> None:
    force = 30.0 * np.sin(2.0 * np.pi * 0.5 * FRAME_s * np.arange(1200))
    found = seen(1.3e-4, force, 0.0, 0)
    assert found.bend == pytest.approx(1.3e-4, rel=1e-9)  # the zero of 1 mm does no harm
    assert found.excitation_N == pytest.approx(30.0 / np.sqrt(2.0), rel=0.02)


def test_the_interval_has_its_nominal_coverage() -> None:
    force = 30.0 * np.sin(2.0 * np.pi * 0.5 * FRAME_s * np.arange(720))
    held = 0
    for seed in range(100):
        found = seen(K, force, 1e-4, seed)
        assert found.bend is not None and found.error is not None
        held += abs(found.bend - K) < 1.96 * found.error
    assert 88 <= held <= 100  # 95 % of 100, within 3 standard deviations


def correlated(count: int, memory: float, random: np.random.Generator) -> np.ndarray:
    """Return noise of unit variance whose neighbours correlate by `memory`."""
    white = np.sqrt(1.0 - memory**2) * random.standard_normal(count)
    white[0] /= np.sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], white))


@pytest.mark.slow
def test_the_interval_has_its_coverage_with_correlated_noise() -> None:
    """The variance is (1 + ρ)/(1 − ρ) times that of white noise; without it 59 % would hold K."""
    memory, count, frames = 0.7, 100, 1800
    force = 30.0 * np.sin(2.0 * np.pi * 0.5 * FRAME_s * np.arange(frames))
    held = 0
    for seed in range(count):
        noise = 1e-4 * correlated(frames, memory, np.random.default_rng(seed))
        estimator = BendEstimator(COLUMN, FRAME_s)
        for f, off in zip(force.tolist(), noise.tolist(), strict=True):
            estimator.update(f, 0.0, K * f + off)
        found = estimator.now
        assert found.bend is not None and found.error is not None
        held += abs(found.bend - K) < 1.96 * found.error
    assert 88 <= held <= 100  # 95 % of 100, within 3 standard deviations


@pytest.mark.parametrize(
    ("times", "noise_m", "alarm"),
    [
        (1.02, 1e-6, False),  # 2 % off, by far more than four standard errors
        (1.10, 5e-3, False),  # 10 % off, within four standard errors
        (1.10, 1e-6, True),
        (0.90, 1e-6, True),
    ],
)
def test_an_alarm_needs_four_standard_errors_and_5_percent(
    times: float, noise_m: float, alarm: bool
) -> None:
    force = 30.0 * np.sin(2.0 * np.pi * 0.5 * FRAME_s * np.arange(1200))
    found = seen(times * K, force, noise_m, 4)
    assert found.bend is not None and found.error is not None
    certain = abs(found.bend - K) > 4.0 * found.error
    large = abs(found.bend - K) > 0.05 * K
    assert (certain, large) == (noise_m < 1e-3, times != 1.02)
    assert found.alarm == alarm


def test_too_little_excitation_freezes_the_estimate() -> None:
    active = 30.0 * np.sin(2.0 * np.pi * 0.5 * FRAME_s * np.arange(720))
    idle = 0.5 * LEAST_N * np.sin(2.0 * np.pi * 0.5 * FRAME_s * np.arange(3600))
    estimator = BendEstimator(COLUMN, FRAME_s)
    for f in active:
        estimator.update(float(f), 0.0, K * f)
    before = estimator.now.bend
    for f in idle:
        estimator.update(float(f), 0.0, 3.0 * K * f)
    assert estimator.now.frozen
    assert estimator.now.bend == pytest.approx(before, rel=0.02)  # but for the second it takes


def moved(frames: int) -> tuple[np.ndarray, np.ndarray]:
    """Return F in N and δc in d of a control that is moved by a hand, shape (frames,) each."""
    time = FRAME_s * np.arange(frames)
    force = 30.0 * np.sin(2.0 * np.pi * 0.5 * time)
    return force, force / 1500.0


def servoed(computed: np.ndarray) -> np.ndarray:
    """Return the servo's answer to δc, straight between frames, by scipy's linear systems."""
    w, z = 2.0 * np.pi * COLUMN.loader.servo_frequency, COLUMN.loader.servo_damping_ratio
    time = FRAME_s * np.arange(len(computed))
    _, answer, _ = lsim(([w * w], [1.0, 2.0 * z * w, w * w]), computed, time)
    return np.asarray(answer)


def test_a_repeated_sample_does_not_change_the_estimate() -> None:
    force, computed = moved(2400)
    deflection = servoed(computed) + K * force
    estimator = BendEstimator(COLUMN, FRAME_s)
    for f, c, d in zip(force[:1500], computed, deflection, strict=False):
        estimator.update(float(f), float(c), float(d))
    before = estimator.now
    for _ in range(500):  # the loader is lost: its last sample is repeated
        estimator.update(float(f), float(c), float(d), fresh=False)
    assert estimator.now.bend == before.bend
    assert estimator.now.frozen
    for f, c, d in zip(force[2000:], computed[2000:], deflection[2000:], strict=True):
        estimator.update(float(f), float(c), float(d))
    assert not estimator.now.frozen
    assert estimator.now.bend == pytest.approx(K, rel=2e-3)


def test_lost_samples_leave_k_without_bias() -> None:
    force, computed = moved(2400)
    deflection = servoed(computed) + K * force
    lost = np.random.default_rng(3).random(2400) < 0.05
    estimator, held = BendEstimator(COLUMN, FRAME_s), (0.0, 0.0, 0.0)
    for missing, *sample in zip(lost, force, computed, deflection, strict=True):
        held = held if missing else (float(sample[0]), float(sample[1]), float(sample[2]))
        estimator.update(*held, fresh=not missing)
    assert estimator.now.bend == pytest.approx(K, rel=2e-3)


def test_adaptation_is_slow_and_bounded_and_needs_a_small_error() -> None:
    sure = ServiceBend(3.0 * K, 0.01 * K, 20.0, frozen=False, alarm=True)
    adaptation, used = Adaptation(K, 2189.0), K
    for k in range(60 * 120):
        found = adaptation.update(k * FRAME_s, sure)
        if found is not None:
            assert abs(found - used) <= 0.05 * 0.25 * K * (1.0 + 1e-9)
            used = found
    assert used == pytest.approx(2.0 * K)  # its bound
    unsure = ServiceBend(3.0 * K, 0.5 * K, 20.0, frozen=False, alarm=True)
    idle = ServiceBend(3.0 * K, 0.01 * K, 20.0, frozen=True, alarm=True)
    assert Adaptation(K, 2189.0).update(0.0, unsure) is None
    assert Adaptation(K, 2189.0).update(0.0, idle) is None
    stiff = Adaptation(K, 0.5 / K)  # K̂·G_T stays below 0.8
    for k in range(60 * 120):
        stiff.update(k * FRAME_s, sure)
    assert stiff.assumed == pytest.approx(1.6 * K)


@pytest.mark.slow
def test_adapted_compensation_keeps_the_authority_that_a_fixed_one_loses() -> None:
    fixed, adapted = softened(adapt=False), softened(adapt=True)
    softer = (TIMES - 1.0) * K * 2189.1  # of G_T·δ that the host does not know of
    expected = softer / (1.0 + softer)
    for record in (fixed, adapted):
        time, lost = lost_share(record, "column")
        before = (time > 12.0) & (time < SOFTENS_s - 3.0)  # the sweep is there in full
        assert abs(lost[before]).max() < 0.004
        (alarm,) = record.manifest["live"]["alarms"]
        assert SOFTENS_s < alarm[0] < SOFTENS_s + 15.0
    late_fixed, late_adapted = (
        lost[(time > 65.0) & (time < 82.0)]
        for time, lost in (lost_share(r, "column") for r in (fixed, adapted))
    )
    assert late_fixed.mean() == pytest.approx(expected, rel=0.05)
    assert abs(late_adapted).max() < 0.006
    found = adapted.manifest["live"]["bend_in_service"]["column"]
    assert found["low"] < TIMES * K < found["high"] or abs(found["bend"] / K - TIMES) < 0.005
