"""Damped steps: straight residuals in one step, bounds, hollows, and jumps that hide the rest."""

from __future__ import annotations

from zlib import crc32

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from coupled.gap.search.descent import descend

Floats = NDArray[np.float64]
RNG = np.random.default_rng(11)
WIDE = (np.full(2, -10.0), np.full(2, 10.0))


@given(st.integers(0, 10_000), st.integers(1, 5))
def test_of_a_straight_residual_the_least_between_the_bounds_is_reached(
    seed: int, numbers: int
) -> None:
    rng = np.random.default_rng(seed)
    law, said = rng.normal(size=(60, numbers)), rng.normal(size=60)
    ends = (np.full(numbers, -0.1), np.full(numbers, 0.1))
    found = descend(
        lambda x: law @ x - said,
        lambda x: law,
        np.zeros(numbers),
        ends,
        most=30,
        enough=lambda _: 1e-9,
    )
    least = lsq_linear(law, said, ends, tol=1e-12)
    assert found.cost == pytest.approx(least.cost, rel=1e-6)
    assert np.all(ends[0] <= found.x)
    assert np.all(found.x <= ends[1])


def test_a_curved_valley_is_followed_to_its_end() -> None:
    """Rosenbrock's, Comput. J. 3, 1960: its least, none, is at (1, 1)."""

    def residual(x: Floats) -> Floats:
        return np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])

    def slopes(x: Floats) -> Floats:
        return np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])

    found = descend(residual, slopes, np.array([-1.2, 1.0]), WIDE, most=60, enough=lambda _: 1e-9)
    assert found.x == pytest.approx([1.0, 1.0], abs=1e-3)


def test_the_slopes_at_the_end_are_those_of_the_end() -> None:
    found = descend(
        lambda x: np.array([x[0] ** 2 - 2.0, 0.1 * x[1]]),
        lambda x: np.array([[2.0 * x[0], 0.0], [0.0, 0.1]]),
        np.array([3.0, 4.0]),
        WIDE,
        most=30,
        enough=lambda _: 1e-9,
    )
    assert found.jac[0, 0] == pytest.approx(2.0 * found.x[0])
    assert found.fun == pytest.approx([found.x[0] ** 2 - 2.0, 0.1 * found.x[1]])


@pytest.mark.parametrize("jump", [0.0, 0.02])
def test_among_jumps_a_fit_ends_after_few_steps_that_bring_nothing(jump: float) -> None:
    """What jumps by more than a step foretells has no lower place that slopes lead to."""
    law, noise, asked = RNG.normal(size=(500, 2)), RNG.normal(size=500), []

    def residual(x: Floats) -> Floats:
        asked.append(x)
        shaken = np.random.default_rng(crc32(x.tobytes())).normal(size=500)
        return np.asarray(law @ x - noise + jump * shaken)

    found = descend(
        residual, lambda x: law, np.array([5.0, -5.0]), WIDE, most=40, enough=lambda _: 1e-8
    )
    least = np.linalg.lstsq(law, noise, rcond=None)[0]
    assert found.x == pytest.approx(least, abs=0.03)
    assert found.evaluations == len(asked) <= 9


def test_where_each_place_nearby_is_worse_three_steps_end_a_fit() -> None:
    """A little is foretold, and none of it comes: what stands there is held by a jump."""
    law, first = RNG.normal(size=(500, 2)), np.array([0.02, 0.01])
    noise = RNG.normal(size=500)

    def residual(x: Floats) -> Floats:
        return np.append(law @ x - noise, 0.0 if np.array_equal(x, first) else 9.0)

    found = descend(
        residual, lambda x: np.vstack((law, [0.0, 0.0])), first, WIDE, 40, lambda _: 1e-12
    )
    assert found.rejected
    assert np.array_equal(found.x, first)
    assert found.evaluations == 1 + 3


@pytest.mark.parametrize("start", [0.3, 3.0])
def test_a_limit_is_found_from_where_it_does_too_much_and_from_where_it_does_little(
    start: float,
) -> None:
    """What stiffens goes by 1/limit²: slopes at a small one lead far beyond where it matters."""
    shape = np.random.default_rng(3).normal(size=400)
    ends = (np.array([0.01]), np.array([50.0]))
    found = descend(
        lambda x: 20.0 * (x[0] ** -2.0 - 1.0) * shape,
        lambda x: (-40.0 * x[0] ** -3.0 * shape)[:, None],
        np.array([start]),
        ends,
        most=40,
        enough=lambda _: 1e-6,
    )
    assert found.x[0] == pytest.approx(1.0, rel=1e-2)


def test_no_more_is_asked_than_allowed() -> None:
    found = descend(
        lambda x: np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]]),
        lambda x: np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]]),
        np.array([-1.2, 1.0]),
        WIDE,
        most=4,
        enough=lambda _: 1e-9,
    )
    assert found.evaluations == 4


def test_a_number_that_does_nothing_stays_where_it_is() -> None:
    found = descend(
        lambda x: np.array([x[0] - 1.0, 0.5]),
        lambda x: np.array([[1.0, 0.0], [0.0, 0.0]]),
        np.array([4.0, 3.0]),
        WIDE,
        most=30,
        enough=lambda _: 1e-9,
    )
    assert found.x == pytest.approx([1.0, 3.0])
