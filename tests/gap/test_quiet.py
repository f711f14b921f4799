"""The noise of a residual and of a force, where what the rig does would pass for colour."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise, noise_of, noise_of_input, quiet_noise
from coupled.gap.signals.floors import left_noise
from coupled.gap.signals.output import rounding

FRAMES, RATE_Hz = 4800, 120.0
TIME = np.arange(FRAMES) / RATE_Hz


def sticking() -> NDArray[np.float64]:
    """Return a motion that stops dead every second, as dry friction stops it."""
    return 0.02 * np.abs(np.sin(np.pi * TIME)) * np.sign(np.sin(0.6 * TIME))


@pytest.mark.parametrize("memory", [0.0, 0.55])
def test_what_happens_now_and_then_is_no_noise(memory: float) -> None:
    rng = np.random.default_rng(3)
    noise = Noise(2e-5, memory)
    # What a stage leaves of it: a knock of 30 floors at each stop.
    knocks = 6e-4 * np.exp(-30.0 * (TIME % 2.5)) + 3e-4 * np.sin(0.7 * TIME)
    residual = knocks + noise.sample(FRAMES, rng)
    found = quiet_noise(residual)
    assert found is not None
    assert found.rms == pytest.approx(noise.rms, rel=0.15)
    assert found.memory == pytest.approx(memory, abs=0.12)
    plain = noise_of(sticking() + noise.sample(FRAMES, rng))
    assert abs(math.log(plain.rms / noise.rms)) > 0.2  # by the motion itself


@pytest.mark.parametrize("seed", [23, 48, 83])
def test_colour_that_looks_white_far_above_its_corner_is_estimated_in_full(seed: int) -> None:
    """Of 120 samples with a corner at 20 Hz three were estimated at 0.74 to 0.78 of their rms."""
    noise = Noise(1.0, math.exp(-2.0 * math.pi * 20.0 / RATE_Hz))
    found = quiet_noise(noise.sample(FRAMES, np.random.default_rng([20, seed])))
    assert found is not None
    assert found.rms == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("memory", [0.0, 0.3, 0.6])
def test_a_forces_colour_is_told_from_the_force(memory: float) -> None:
    rng = np.random.default_rng(4)
    noise = Noise(0.15, memory)
    starts = np.arange(1.0, 38.0, 1.7)
    rises = np.clip((TIME[:, None] - starts) / 0.25, 0.0, 1.0)
    force = (0.5 * (1.0 - np.cos(np.pi * rises))) @ rng.uniform(-40.0, 40.0, len(starts))
    found = noise_of_input(force + noise.sample(FRAMES, rng))
    assert found is not None

    def slow(one: Noise) -> float:
        """Return its rms at low frequencies, by which a loader is shaken."""
        return one.rms * math.sqrt((1.0 + one.memory) / (1.0 - one.memory))

    assert 0.75 < slow(found) / slow(noise) < 1.35


def test_a_line_and_a_short_or_silent_signal() -> None:
    rng = np.random.default_rng(5)
    white = Noise(1.0).sample(FRAMES, rng)
    for found in (quiet_noise(white + 3.0 * np.sin(2 * np.pi * 50.0 * TIME)), quiet_noise(white)):
        assert found is not None
        assert found.rms == pytest.approx(1.0, rel=0.08)
        assert found.memory == 0.0
    assert quiet_noise(white[:200]) is None
    assert quiet_noise(np.zeros(FRAMES)) is None
    assert noise_of_input(np.zeros(FRAMES)) is None


@pytest.mark.parametrize("share", [0.2, 0.4, 0.7])
def test_frames_that_are_not_judged_do_not_lower_the_noise(share: float) -> None:
    """Half seconds here and there have no residual: noise alone leaves a gap of one floor."""
    rng = np.random.default_rng(6)
    judged = np.repeat(rng.random(FRAMES // 60) >= share, 60)
    left = np.where(judged, Noise(0.05).sample(FRAMES, rng), 0.0)
    found = left_noise(Noise(0.1), 20.0 * sticking(), left, judged)
    assert np.sqrt(np.mean(left**2)) / found.rms == pytest.approx(1.0, abs=0.06)
    assert found.memory == 0.0
    nowhere = np.zeros(FRAMES, dtype=bool)
    assert left_noise(Noise(0.1), sticking(), 0.0 * left, nowhere) == Noise(0.1)


def test_a_signal_that_decays_to_nothing_is_not_counted_in_its_last_steps() -> None:
    decaying = 0.1 * np.exp(-np.arange(600.0))
    assert rounding(decaying, math.inf) == 0.0
    counted = np.round(decaying, 3)
    assert rounding(counted, math.inf) == pytest.approx(1e-3 / math.sqrt(12.0))
