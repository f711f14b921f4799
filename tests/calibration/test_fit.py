"""The fit: closed forms, the printed normal equations, and errors in all variables."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import (
    Instruments,
    perfect_instruments,
    usual_instruments,
)
from coupled.calibration.fit import condition, normal_equations, ordinary
from coupled.calibration.sandwich import sandwich
from tests.support.readings import S1, S3, K, grid, readings, with_errors

USUAL = usual_instruments("column")
COARSE = Instruments(2.5e-3, 3.0, 0.3, 0.0, 0.0, 0.0, 0.0)


def test_two_exact_readings_solve_for_two_unknowns() -> None:
    """v₁ = 2·δ − 0.5·F of eq. (4) by hand: appendix A."""
    a, b = normal_equations(np.array([1.0, 1.0]), np.array([2.0, 4.0]), np.array([1.0, 0.0]))
    assert a == pytest.approx(2.0)
    assert b == pytest.approx(-0.5)


def test_without_errors_every_way_gives_s1_and_k() -> None:
    """Eqs. (5a) and (5b), whatever way eq. (4) is fitted."""
    r = readings(*grid())
    a, b = normal_equations(r.deflection, r.force, r.v1)
    assert a == pytest.approx(S1, rel=1e-12)
    assert -b / a == pytest.approx(K, rel=1e-11)
    for fit in (
        ordinary(r, perfect_instruments()),
        errors_in_variables(r, perfect_instruments()).line,
        errors_in_variables(r, USUAL).line,
    ):
        assert fit.s1.value == pytest.approx(S1, rel=1e-12)
        assert fit.bend.value == pytest.approx(K, rel=1e-11)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.floats(1e-3, 1e3))
def test_normal_equations_and_qr_agree_to_rounding(seed: int, size: float) -> None:
    """The data allow cond² times the rounding, which the scaled columns keep small."""
    r = with_errors(*grid(), USUAL, np.random.default_rng(seed))
    d = size * r.deflection
    a, b = normal_equations(d, r.force, r.v1)
    fit = ordinary(replace(r, deflection=d), USUAL)
    assert condition(d, r.force) < 6.0
    assert fit.s1.value == pytest.approx(a, rel=1e-12)
    assert fit.bend.value == pytest.approx(-b / a, rel=1e-10)


def test_ordinary_errors_are_those_of_a_textbook_where_errors_are_even() -> None:
    """The sandwich and σ²·(XᵀX)⁻¹ meet for many readings with the meter alone at fault."""
    rng = np.random.default_rng(5)
    d, f = (np.tile(x, 200) for x in grid())
    v = S1 * (d - K * f) + 0.2 * rng.standard_normal(len(d))
    fit = ordinary(readings(d, f, v), USUAL)
    design = np.column_stack((d, f))
    classic = 0.2 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert fit.s1.error == pytest.approx(classic[0], rel=0.03)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("looks", [1, 2])
def test_errors_in_variables_is_the_fit_with_every_true_value_unknown(
    seed: int, looks: int
) -> None:
    """The same minimum as by brute force over a, b, S₃ and the 50 true δ and F (what ODR does)."""
    r = with_errors(*grid(), USUAL, np.random.default_rng(seed))
    if looks == 2:
        r = replace(r, deflection_rise=np.zeros(25), force_rise=np.zeros(25))
    fit = errors_in_variables(r, USUAL)
    n = len(r.v1)
    sd = np.sqrt(USUAL.deflection_variance(r.deflection) / looks)
    sf = np.sqrt(USUAL.force_variance(r.force) / looks)
    sv, s3 = np.sqrt(USUAL.voltage_variance(r.v1)), np.sqrt(USUAL.voltage_variance(r.v3))

    def off(x: np.ndarray) -> np.ndarray:
        a, b, c = S1 * x[0], -0.05 * x[1], S3 * x[2]
        d, f = r.deflection + sd * x[3 : n + 3], r.force + sf * x[n + 3 :]
        return np.concatenate(((a * d + b * f - r.v1) / sv, (c * f - r.v3) / s3, x[3:]))

    start = np.concatenate(([1.0, 1.0, 1.0], np.zeros(2 * n)))
    found = least_squares(off, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    a, b = S1 * found.x[0], -0.05 * found.x[1]
    assert fit.line.s1.value == pytest.approx(a, rel=1e-8)
    assert fit.line.bend.value == pytest.approx(-b / a, rel=1e-6)
    assert fit.s3.value == pytest.approx(S3 * found.x[2], rel=1e-8)


def test_coarse_instruments_bias_the_ordinary_fit_and_not_the_other() -> None:
    rng = np.random.default_rng(7)
    pairs = []
    for _ in range(400):
        r = with_errors(*grid(), COARSE, rng)
        pairs.append(
            [
                fit.bend.value / K - 1.0
                for fit in (ordinary(r, COARSE), errors_in_variables(r, COARSE).line)
            ]
        )
    (plain, all_errors), error = np.mean(pairs, axis=0), np.std(pairs, axis=0) / 20.0
    print(
        f"\nbias of K: ordinary {100 * plain:+.1f} %, errors in variables {100 * all_errors:+.1f} %"
    )
    assert plain < -3.0 * error[0]
    assert abs(all_errors) < 3.0 * error[1]


@settings(max_examples=25, deadline=None)
@given(metres=st.floats(1e-3, 1e3), newtons=st.floats(1e-3, 1e3), volts=st.floats(1e-3, 1e3))
def test_other_units_give_the_same_figures(metres: float, newtons: float, volts: float) -> None:
    r = with_errors(*grid(), COARSE, np.random.default_rng(2))
    scaled = Instruments(2.5e-3 * metres, 3.0 * newtons, 0.3 * volts, 0.0, 0.0, 0.0, 0.0)
    other = replace(
        r,
        deflection=metres * r.deflection,
        force=newtons * r.force,
        v1=volts * r.v1,
        v3=volts * r.v3,
    )
    one, two = errors_in_variables(r, COARSE).line, errors_in_variables(other, scaled).line
    for here, there, unit in (
        (one.s1, two.s1, volts / metres),
        (one.bend, two.bend, metres / newtons),
    ):
        assert there.value == pytest.approx(unit * here.value, rel=1e-7)
        assert there.error == pytest.approx(unit * here.error, rel=1e-6)


def test_the_standard_errors_are_the_scatter() -> None:
    rng = np.random.default_rng(9)
    fits = [errors_in_variables(with_errors(*grid(), USUAL, rng), USUAL) for _ in range(500)]
    for estimates in (
        [fit.line.s1 for fit in fits],
        [fit.line.bend for fit in fits],
        [fit.s3 for fit in fits],
    ):
        errors = [estimate.error for estimate in estimates]
        scatter = np.std([estimate.value for estimate in estimates])
        assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(scatter, rel=0.1)
    figures = np.array([[f.line.s1.value, f.line.bend.value, f.s3.value] for f in fits])
    together = np.corrcoef(figures.T)
    np.testing.assert_allclose(np.mean([f.correlation for f in fits], axis=0), together, atol=0.12)
    assert together[0, 1] > 0.8
    assert np.mean([fit.line.excess for fit in fits]) == pytest.approx(1.0, abs=0.05)


def test_v3_sharpens_the_force_and_so_k() -> None:
    """A spring scale of 6 N beside a gauge read to 10 mV: the joint fit hardly needs the scale."""
    rng = np.random.default_rng(3)
    coarse = replace(USUAL, scale=6.0, hand=0.0)
    found: dict[str, list[float]] = {"joint": [], "alone": []}
    for _ in range(200):
        r = with_errors(*grid(), coarse, rng)
        found["joint"].append(errors_in_variables(r, coarse).line.bend.value)
        blind = replace(r, v3=r.v3 * 1e-4)  # volts so small that the meter drowns them
        found["alone"].append(errors_in_variables(blind, coarse).line.bend.value)
    assert np.std(found["joint"]) < 0.85 * np.std(found["alone"])
    assert np.mean(found["joint"]) == pytest.approx(K, rel=0.006)


def test_degrees_of_freedom_in_closed_form() -> None:
    """Of a mean they are n − 1; of the difference of two means, Welch's for equal variances."""
    one = sandwich(np.ones((7, 1, 1)), np.zeros((7, 1)))
    assert one.freedom(np.array([1.0])) == pytest.approx(6.0)
    group = np.repeat([0.0, 1.0], [4, 9])
    two = sandwich(np.column_stack((1.0 - group, group))[:, None, :], np.zeros((13, 1)))
    welch = (1 / 4 + 1 / 9) ** 2 / ((1 / 4) ** 2 / 3 + (1 / 9) ** 2 / 8)
    assert two.freedom(np.array([-1.0, 1.0])) == pytest.approx(welch)


def test_the_sandwich_of_a_mean_is_its_standard_error() -> None:
    values = np.array([1.0, 4.0, 2.0, 7.0])
    errors = sandwich(np.ones((4, 1, 1)), (values - values.mean())[:, None])
    expected = np.std(values, ddof=1) / 2.0
    assert errors.estimate(3.5, np.array([1.0])).error == pytest.approx(expected)


def test_few_readings_at_two_corners_hold_19_times_in_20() -> None:
    """Where residuals weighed up by 1/(1 − h) and n − 2 degrees of freedom hold 97 %."""
    rng = np.random.default_rng(21)
    delta, force = np.repeat([0.169, 0.0685], 4), np.repeat([94.7, 150.0], 4)
    held = []
    for _ in range(800):
        bend = errors_in_variables(with_errors(delta, force, USUAL, rng), USUAL).line.bend
        held.append(bend.low <= K <= bend.high)
    print(f"\ntwo corners of four: {100 * np.mean(held):.1f} %")
    assert np.mean(held) == pytest.approx(0.95, abs=0.02)
