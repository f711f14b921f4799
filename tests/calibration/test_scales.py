"""S₃ by eq. (13), S₂ by eq. (14) and from the gains, and arcs by eqs. (15) to (17)."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.calibration import arc, scales
from coupled.calibration.estimate import Estimate, mean_of, product, total
from coupled.rig.parameters import Gains
from coupled.units import DEGREE_rad


def test_eq_13_is_the_mean_of_the_ratios() -> None:
    found = scales.s3_by_ratios(np.array([10.0, 20.0, 40.0]), np.array([2.4, 5.0, 10.4]))
    assert found.value == pytest.approx(0.25)
    assert found.error == pytest.approx(0.01 / np.sqrt(3.0))
    assert found.half_width == pytest.approx(4.302653 * found.error, rel=1e-6)


def test_eq_14_is_the_ratio_of_the_null_times_s3() -> None:
    s3 = Estimate(0.25, 0.0, 24.0)
    found = scales.s2_by_null(np.array([12.0, 18.0]), np.array([12.5, 18.75]), np.ones(2), s3)
    assert found.value == pytest.approx(0.24)


def test_the_gains_give_s2_by_simple_ratios() -> None:
    s1, s3 = Estimate(500.0, 5.0, 20.0), Estimate(0.25, 0.001, 20.0)
    found = scales.s2_from_gains(s1, s3, Gains(s1_over_s2=2000.0, s3_over_s2=0.5))
    values = [(estimate.value, estimate.error) for estimate in found.values()]
    assert values == [(0.25, 0.0025), (0.5, 0.002)]
    assert scales.s2_from_gains(s1, s3, Gains()) == {}


def test_a_product_adds_relative_variances() -> None:
    found = product(Estimate(2.0, 0.02, 10.0), Estimate(3.0, 0.03, 10.0))
    assert found.value == 6.0
    assert found.error == pytest.approx(6.0 * np.sqrt(2e-4))
    assert found.freedom == pytest.approx(20.0)
    exact = product(Estimate(2.0, 0.0, 10.0), Estimate(3.0, 0.0, 7.0))
    summed = total(Estimate(2.0, 0.03, 10.0), Estimate(3.0, 0.04, 1e9))
    assert summed.value == 5.0
    assert summed.error == pytest.approx(0.05)
    assert summed.freedom == pytest.approx(0.0025**2 / (0.0009**2 / 10.0), rel=1e-6)
    assert (exact.error, exact.low, exact.high) == (0.0, 6.0, 6.0)


def test_nulls_from_both_sides_are_free_of_what_friction_does() -> None:
    """Each side off by 1 % the other way: the centre, and an error that the gap does not widen."""
    s3 = Estimate(0.25, 0.0, 24.0)
    side = np.array([1.0, -1.0, 1.0, -1.0, 1.0])
    v3 = np.full(5, 20.0)
    noise = np.array([1e-3, -2e-3, -1e-3, 2e-3, 0.0])
    found = scales.s2_by_null(v3 * (0.96 + 0.0096 * side + noise), v3, side, s3)
    plain = scales.s2_by_null(v3 * (0.96 + noise), v3, side, s3)
    assert found.value == pytest.approx(0.24, rel=1e-3)
    assert found.error == pytest.approx(plain.error, rel=1e-9)
    assert found.freedom == pytest.approx(3.0)


def test_nulls_from_one_side_are_widened_by_an_even_distribution() -> None:
    s3 = Estimate(0.25, 0.0, 24.0)
    v3, side = np.array([12.0, 20.0]), np.ones(2)
    exact = scales.s2_by_null(0.96 * v3, v3, side, s3)
    assert exact.error == 0.0
    wide = scales.s2_by_null(0.96 * v3, v3, side, s3, 0.009)
    assert wide.error == pytest.approx(0.009 * 0.24 / np.sqrt(3.0))


def test_intervals_of_a_mean_hold_19_times_in_20() -> None:
    rng = np.random.default_rng(4)
    held = 0
    for _ in range(2000):
        found = mean_of(1.0 + rng.standard_normal(5))
        held += found.low <= 1.0 <= found.high
    assert held / 2000 == pytest.approx(0.95, abs=0.015)


def test_the_arc_correction_is_that_of_eqs_15_to_17() -> None:
    """1 % at 14.0° and 2 % at 19.8°, and the correction is exact."""
    assert arc.shortfall(np.array([14.04 * DEGREE_rad]))[0] == pytest.approx(0.01, abs=1e-4)
    assert arc.shortfall(np.array([19.8 * DEGREE_rad]))[0] == pytest.approx(0.02, abs=1e-4)
    theta = np.linspace(-1.2, 1.2, 25)
    level = 0.9 * np.sin(theta)  # eq. (15)
    np.testing.assert_allclose(arc.along_arc(level, 0.9), 0.9 * theta, rtol=1e-12)  # eq. (16)
    np.testing.assert_allclose(arc.angle(level, 0.9), theta, rtol=1e-12)
    small = np.array([0.1])  # eq. (17), to the next power
    assert 1.0 - np.sin(small)[0] / small[0] == pytest.approx(arc.shortfall(small)[0], rel=1e-3)
