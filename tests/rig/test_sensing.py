"""Sensing: converters and scales."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.rig import sensing
from coupled.rig.packing import pack
from coupled.rig.standalone import run_control
from tests.support.rigs import BENCH, bench

SCHEDULE = "controls.column.schedule"


@given(value=st.floats(-0.2, 0.2), bits=st.integers(6, 16))
def test_a_converter_is_within_half_a_step(value: float, bits: int) -> None:
    step = 2 * 0.2 / 2**bits
    got = sensing.converted(value, step, 0.2)
    assert abs(got - value) <= (0.5 if value < 0.2 - step else 1.0) * step + 1e-15
    assert sensing.converted(got, step, 0.2) == pytest.approx(got, abs=1e-15)


def test_a_converter_rounds_to_the_nearest_of_its_steps_and_holds_at_its_ends() -> None:
    """Of 2ᴺ steps from −full scale on, the last is one step under full scale."""
    found = [sensing.converted(0.1 * steps, 0.1, 0.8) for steps in (0.49, 0.51, -0.49, -0.51, 2.5)]
    assert found == pytest.approx([0.0, 0.1, 0.0, -0.1, 0.3], abs=1e-15)
    assert sensing.converted(5.0, 0.1, 0.8) == pytest.approx(0.7)
    assert sensing.converted(-5.0, 0.1, 0.8) == pytest.approx(-0.8)
    assert sensing.converted(0.123, 0.0, 0.0) == 0.123


def test_what_is_read_is_the_scale_times_the_quantity_and_the_noise_on_it() -> None:
    prefix = "controls.column.sensing"
    rig = bench({f"{prefix}.deflection_scale": 1.1, f"{prefix}.force_scale": 0.9})
    p = pack(rig)[0]["parameters"]["sensing"]
    assert sensing.read_computed(p, 0.05, 0, 1e-3) == pytest.approx(0.056, rel=1e-12)
    assert sensing.read_force(p, -40.0, 0.5) == pytest.approx(-35.5, rel=1e-12)


def test_zeros_and_a_scale_that_drifts_are_in_what_is_read_and_recorded() -> None:
    prefix = "controls.column.sensing"
    rig = bench(
        {
            f"{prefix}.deflection_scale": 1.1,
            f"{prefix}.scale_drift_per_s": 2e-3,
            f"{prefix}.force_scale": 0.9,
            f"{prefix}.force_zero_N": -3.0,
            f"{prefix}.deflection_zero_m": 2e-3,
        }
    )
    p = pack(rig)[0]["parameters"]["sensing"]
    frame = round(40.0 * rig.frame_rate)
    assert sensing.read_computed(p, 0.05, frame, 1e-3) == pytest.approx(0.055 * 1.08 + 1e-3)
    assert sensing.read_force(p, -40.0, 0.5) == pytest.approx(-38.5, rel=1e-12)
    flat = np.full(1000, 1000.0)
    pull = np.full(len(flat) * rig.substeps + 1, 30.0)
    amiss = run_control(rig, "column", pull, flat)
    steady = run_control(rig.changed({f"{prefix}.scale_drift_per_s": 0.0}), "column", pull, flat)
    level = run_control(rig.changed({f"{prefix}.deflection_zero_m": 0.0}), "column", pull, flat)
    np.testing.assert_allclose(amiss.force, 0.9 * 30.0 - 3.0, rtol=1e-12)
    np.testing.assert_allclose(amiss.deflection - level.deflection, 2e-3, rtol=1e-9)
    grown = amiss.computed[1:] / steady.computed[1:]
    np.testing.assert_allclose(grown, 1.0 + 2e-3 * steady.time_s[1:], rtol=1e-9)


def test_a_hum_is_a_tone_in_what_host_and_recorder_read_and_nowhere_else() -> None:
    prefix = "controls.column.sensing"
    hum = {f"{prefix}.hum_m": 3e-4, f"{prefix}.hum_frequency_Hz": 50.0}
    rig = bench(hum | {f"{prefix}.hum_phase_rad": 0.7})
    flat = np.full(600, 1000.0)
    pull = np.full(len(flat) * rig.substeps + 1, 30.0)
    amiss = run_control(rig, "column", pull, flat)
    still = run_control(bench(), "column", pull, flat)
    tone = 3e-4 * np.sin(2.0 * np.pi * 50.0 * still.time_s + 0.7)
    np.testing.assert_allclose(amiss.computed - still.computed, tone, rtol=0, atol=1e-14)
    np.testing.assert_allclose(amiss.estimate - still.estimate, tone, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(amiss.deflection, still.deflection)
    # Sampled at 100 Hz, 60 Hz is the same record as 40 Hz run backwards.
    at = {f"{prefix}.hum_m": 3e-4}
    two = [
        run_control(
            bench(
                at | {f"{prefix}.hum_frequency_Hz": f, f"{prefix}.hum_phase_rad": phase},
                {**BENCH, "frame_rate_Hz": 100.0},
            ),
            *("column", pull, flat),
        ).computed
        for f, phase in ((60.0, 0.4), (40.0, np.pi - 0.4))
    ]
    np.testing.assert_allclose(two[0], two[1], rtol=0, atol=1e-14)


def test_scales_and_word_length_set_the_steps() -> None:
    prefix = "controls.column.sensing"
    rig = bench(
        {
            f"{prefix}.word_length_bits": 12,
            f"{prefix}.s1_V_per_m": 500.0,
            f"{prefix}.s2_V_per_N": 0.2,
            f"{prefix}.s3_V_per_N": 0.25,
        }
    )
    p = pack(rig)[0]["parameters"]["sensing"]
    assert p["computed_step"] == pytest.approx(200.0 / 4096 / 500.0)
    assert p["force_step"] == pytest.approx(200.0 / 4096 / 0.25)
    assert p["product_step"] == pytest.approx(200.0 / 4096 / 0.2)
    assert p["gradient_range"] == pytest.approx(500.0 / 0.2)
    assert p["gradient_step"] == pytest.approx(2.0 * 500.0 / 0.2 / 4096)
    for of, full in (("computed", 100.0 / 500.0), ("force", 100.0 / 0.25), ("product", 500.0)):
        assert p[f"{of}_range"] == pytest.approx(full)
