"""Filters as banded systems, and a residual's loudest frequency, against scipy.signal."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import bilinear, lfilter, welch

from coupled.gap.findings.where import _peak
from coupled.gap.noise.noise import Noise, filtered, of_second_order
from coupled.gap.thresholds import SHORTEST_RECORD_s

RATE_Hz = 120.0


@given(share=st.floats(1e-3, 1.0), columns=st.integers(1, 3))
def test_a_lag_is_the_recursion(share: float, columns: int) -> None:
    signal = np.random.default_rng(3).normal(size=(200, columns))
    expected = lfilter([share], [1.0, share - 1.0], signal, axis=0)
    assert filtered([share], [1.0, share - 1.0], signal) == pytest.approx(expected, abs=1e-12)
    assert filtered([share], [1.0, share - 1.0], signal[:, 0]) == pytest.approx(
        expected[:, 0], abs=1e-12
    )


@given(
    mass=st.floats(0.5, 20.0),
    damping=st.floats(5.0, 500.0),
    stiffness=st.floats(50.0, 2e4),
)
def test_a_loader_answers_as_tustins_rule_has_it(
    mass: float, damping: float, stiffness: float
) -> None:
    expected = bilinear([1.0], [mass, damping, stiffness], RATE_Hz)
    found = of_second_order(mass, damping, stiffness, RATE_Hz)
    for one, other in zip(found, expected, strict=True):
        assert one == pytest.approx(other, rel=1e-9)
    force = np.random.default_rng(4).normal(size=500)
    answer = lfilter(*expected, force)
    assert filtered(*found, force) == pytest.approx(answer, abs=1e-9 * np.max(np.abs(answer)))
    still = filtered(*found, np.ones(20_000))
    assert still[-1] == pytest.approx(1.0 / stiffness, rel=1e-3)


@pytest.mark.parametrize(("frames", "memory"), [(400, 0.0), (1000, 0.9), (1201, 0.5)])
def test_the_loudest_frequency_is_that_of_welchs_spectrum(frames: int, memory: float) -> None:
    left = Noise(1.0, memory).sample(frames, np.random.default_rng(frames))
    left += 0.2 * np.sin(2.0 * np.pi * 3.3 * np.arange(frames) / RATE_Hz) + 0.5
    frequency, density = welch(
        left, RATE_Hz, nperseg=min(frames, round(SHORTEST_RECORD_s * RATE_Hz))
    )
    assert _peak(left, RATE_Hz) == pytest.approx(frequency[1:][np.argmax(density[1:])])


def test_coloured_noise_is_in_its_steady_state_from_the_first_frame() -> None:
    noise, rng = Noise(2.0, 0.95), np.random.default_rng(5)
    samples = np.array([noise.sample(60, rng) for _ in range(4000)])
    assert np.std(samples, axis=0) == pytest.approx(np.full(60, 2.0), rel=0.06)
    correlation = np.mean(samples[:, 1:] * samples[:, :-1]) / np.mean(samples**2)
    assert correlation == pytest.approx(0.95, abs=5e-3)


def test_a_diagnosis_starts_without_scipy_signal() -> None:
    """It and the statistics that it loads took 0.7 of 2.4 s of the start, and 24 MB."""
    said = "import sys, coupled.gap.diagnose; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", said], capture_output=True, text=True, check=True)
    loaded = set(ran.stdout.split())
    assert "coupled.gap.diagnose" in loaded
    assert not loaded & {"scipy.signal", "scipy.stats"}
