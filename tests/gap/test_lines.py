"""Lines of the spectrum: a tone is found as it is, nothing else is, and no smoother eats it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.blind.twin.setting import coloured
from coupled.gap.diagnose import diagnose
from coupled.gap.noise.lines import lines_in, seen_as, tone_of
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.output import white
from coupled.record.record import Record
from tests.support.gaps import made, nominal_rig

RATE_Hz, FRAMES, NOISE_m = 120.0, 3600, 2e-5
T_s = np.arange(FRAMES) / RATE_Hz
Floats = NDArray[np.float64]


def swing(seed: int) -> Floats:
    """Return a slow motion with white noise, m."""
    hiss = np.random.default_rng(seed).normal(0.0, NOISE_m, FRAMES)
    return 0.05 * np.sin(2.4 * T_s) + 0.01 * np.sin(9.0 * T_s) + hiss


@pytest.mark.parametrize(("tone_Hz", "seen_Hz"), [(50.0, 50.0), (49.87, 49.87), (80.0, 40.0)])
@pytest.mark.parametrize("amplitude_m", [1.5e-5, 3e-4])
def test_a_tone_in_noise_is_found_at_its_frequency_and_size(
    tone_Hz: float, seen_Hz: float, amplitude_m: float
) -> None:
    """Within five standard errors: σ·√(2/N) of an amplitude, √6·σ/(π·A·T·√N) of a frequency."""
    tone = amplitude_m * np.sin(2.0 * np.pi * tone_Hz * T_s + 0.7)
    (line,) = lines_in(swing(3) + tone)
    root = np.sqrt(FRAMES)
    assert line.amplitude == pytest.approx(amplitude_m, abs=5.0 * NOISE_m * 2.0**0.5 / root)
    sure_Hz = 6.0**0.5 * NOISE_m / (np.pi * amplitude_m * T_s[-1] * root)
    assert seen_as(line, RATE_Hz).seen_Hz == pytest.approx(seen_Hz, abs=5.0 * sure_Hz)
    np.testing.assert_allclose(line.over(FRAMES), tone, rtol=0, atol=15.0 * NOISE_m / root)


def test_noise_of_any_colour_and_a_sweep_have_no_line() -> None:
    rng = np.random.default_rng(5)
    for k in range(40):
        hiss = rng.normal(0.0, NOISE_m, FRAMES)
        assert not lines_in(hiss)
        assert not lines_in(swing(k) + coloured(hiss, rng.uniform(8.0, 40.0), RATE_Hz))
    assert not lines_in(swing(1) + 3e-4 * np.sin(2.0 * np.pi * (30.0 + 0.4 * T_s) * T_s))


def test_what_sampling_folds_is_said_to_be_of_the_mains() -> None:
    assert tone_of(40.0, 100.0) == pytest.approx(60.0)
    assert tone_of(10.0, 60.0) == pytest.approx(50.0)
    assert tone_of(39.0, 120.0) == pytest.approx(399.0)  # 400 Hz is seen at 40
    assert tone_of(50.1, 120.0) == pytest.approx(50.1)
    assert tone_of(33.0, 120.0) == pytest.approx(33.0)


def test_a_smoother_leaves_a_tone_and_takes_the_noise() -> None:
    tone = 3e-4 * np.sin(2.0 * np.pi * 50.0 * T_s)
    plain, hummed = smoothed(swing(7)), smoothed(swing(7) + tone)
    np.testing.assert_allclose(hummed - plain, tone, rtol=0, atol=3e-6)
    assert white(swing(7) + tone) == pytest.approx(NOISE_m, rel=0.1)


@pytest.mark.slow
def test_a_hum_is_a_finding_of_sensing_with_its_line(tmp_path: Path) -> None:
    """0.3 mm at 50 Hz on a deflection sampled at 120 Hz was once taken for noise."""
    nominal = nominal_rig(False)
    hum = {"amplitude_{d}": 3e-4, "frequency_Hz": 50.0, "phase_rad": 0.4}
    found = diagnose(nominal, {"r.csv": made(tmp_path, nominal, {"mains_hum": hum}, 4)})
    assert found.verdict == "effect"
    assert found.guilty == ("sensing",)
    (effect,) = found.effects
    got: dict[str, Any] = {p.name: p for p in effect.parameters}
    assert got["amplitude_m"].low < 3e-4 < got["amplitude_m"].high
    assert got["frequency_Hz"].low < 50.0 < got["frequency_Hz"].high
    assert got["frequency_Hz"].high - got["frequency_Hz"].low < 0.01
    where = found.stage("sensing").where
    assert where is not None and where.line is not None
    assert where.line.seen_Hz == pytest.approx(50.0, abs=0.01)
    assert not where.line.folded
    assert "is at 50 Hz in column_computed_m" in found.summary
    said = json.loads(json.dumps(found.as_dict(), allow_nan=False))
    line = said["stages"]["sensing"]["where"]["line"]
    assert line["amplitude"] == pytest.approx(3e-4, rel=0.02)


@pytest.mark.slow
def test_records_of_one_hum_have_phases_of_their_own(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    records: dict[str, Record] = {}
    for k in range(2):
        hum = {"amplitude_{d}": 2e-4, "frequency_Hz": 50.1, "phase_rad": 0.4 + 1.5 * k}
        records[f"{k}.csv"] = made(tmp_path, nominal, {"mains_hum": hum}, 4 + k)
    found = diagnose(nominal, records)
    assert [effect.name for effect in found.effects] == ["mains_hum"]
    assert found.verdict == "effect"
    assert found.effects[0].value == pytest.approx(2e-4, rel=0.03)
