"""The fit: closed forms, the printed normal equations, and errors in all variables."""

from __future__ import annotations

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
from tests.calibration.made import S1, K, grid, readings, with_errors

USUAL = usual_instruments("column")
COARSE = Instruments(2.5e-3, 3.0, 0.3, 0.0, 0.0, 0.0, 0.0)


def test_two_exact_readings_solve_for_two_unknowns() -> None:
    """v₁ = 2·δ − 0.5·F, by hand."""
    a, b = normal_equations(np.array([1.0, 1.0]), np.array([2.0, 4.0]), np.array([1.0, 0.0]))
    assert (a, b) == (pytest.approx(2.0), pytest.approx(-0.5))


def test_without_errors_every_way_gives_s1_and_k() -> None:
    r = readings(*grid())
    a, b = normal_equations(r.deflection, r.force, r.v1)
    assert a == pytest.approx(S1, rel=1e-12)
    assert -b / a == pytest.approx(K, rel=1e-11)
    for fit in (
        ordinary(r.deflection, r.force, r.v1, perfect_instruments()),
        errors_in_variables(r.deflection, r.force, r.v1, perfect_instruments()),
        errors_in_variables(r.deflection, r.force, r.v1, USUAL),
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
    fit = ordinary(d, r.force, r.v1, USUAL)
    assert condition(d, r.force) < 6.0
    assert fit.s1.value == pytest.approx(a, rel=1e-12)
    assert fit.bend.value == pytest.approx(-b / a, rel=1e-10)


def test_ordinary_errors_are_those_of_a_textbook_where_errors_are_even() -> None:
    """HC3 and σ²·(XᵀX)⁻¹ meet for many readings with the meter alone at fault."""
    rng = np.random.default_rng(5)
    d, f = (np.tile(x, 200) for x in grid())
    v = S1 * (d - K * f) + 0.2 * rng.standard_normal(len(d))
    fit = ordinary(d, f, v, USUAL)
    design = np.column_stack((d, f))
    classic = 0.2 * np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert fit.s1.error == pytest.approx(classic[0], rel=0.03)


@pytest.mark.parametrize("seed", range(3))
def test_errors_in_variables_is_the_fit_with_every_true_value_unknown(seed: int) -> None:
    """The same minimum as by brute force over a, b and the 50 true δ and F (what ODR does)."""
    r = with_errors(*grid(), USUAL, np.random.default_rng(seed))
    fit = errors_in_variables(r.deflection, r.force, r.v1, USUAL)
    n = len(r.v1)
    sd, sf = (
        np.sqrt(USUAL.deflection_variance(r.deflection)),
        np.sqrt(USUAL.force_variance(r.force)),
    )
    sv = np.sqrt(USUAL.voltage_variance(r.v1))

    def off(x: np.ndarray) -> np.ndarray:
        a, b = S1 * x[0], -0.05 * x[1]
        d, f = r.deflection + sd * x[2 : n + 2], r.force + sf * x[n + 2 :]
        return np.concatenate(((a * d + b * f - r.v1) / sv, x[2:]))

    start = np.concatenate(([1.0, 1.0], np.zeros(2 * n)))
    found = least_squares(off, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    a, b = S1 * found.x[0], -0.05 * found.x[1]
    assert fit.s1.value == pytest.approx(a, rel=1e-8)
    assert fit.bend.value == pytest.approx(-b / a, rel=1e-6)
    assert fit.excess == pytest.approx(np.sqrt(2.0 * found.cost / (n - 2)), rel=1e-6)


def test_coarse_instruments_bias_the_ordinary_fit_and_not_the_other() -> None:
    rng = np.random.default_rng(7)
    pairs = []
    for _ in range(400):
        r = with_errors(*grid(), COARSE, rng)
        pairs.append(
            [
                fit(r.deflection, r.force, r.v1, COARSE).bend.value / K - 1.0
                for fit in (ordinary, errors_in_variables)
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
    one = errors_in_variables(r.deflection, r.force, r.v1, COARSE)
    two = errors_in_variables(metres * r.deflection, newtons * r.force, volts * r.v1, scaled)
    for here, there, unit in (
        (one.s1, two.s1, volts / metres),
        (one.bend, two.bend, metres / newtons),
    ):
        assert there.value == pytest.approx(unit * here.value, rel=1e-7)
        assert there.error == pytest.approx(unit * here.error, rel=1e-6)


def test_the_standard_errors_are_the_scatter() -> None:
    rng = np.random.default_rng(9)
    fits = []
    for _ in range(500):
        r = with_errors(*grid(), USUAL, rng)
        fits.append(errors_in_variables(r.deflection, r.force, r.v1, USUAL))
    for name in ("s1", "bend"):
        values = [getattr(fit, name).value for fit in fits]
        errors = [getattr(fit, name).error for fit in fits]
        assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.std(values), rel=0.2)
    assert np.mean([fit.excess for fit in fits]) == pytest.approx(1.0, abs=0.05)
