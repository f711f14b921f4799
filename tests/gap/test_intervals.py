"""How well a fit's numbers are known, by draws whose numbers are known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student

from coupled.gap.search.descent import End
from coupled.gap.search.intervals import cut, half_width, open_above
from coupled.gap.thresholds import LEAST_MEMORIES

FRAMES = 2400
NONE = np.zeros((0, FRAMES))  # samples of the input's error


@pytest.mark.parametrize("spread", [0.05, 0.3])
def test_an_interval_counts_what_is_known_of_a_setting(spread: float) -> None:
    """Two numbers that do the same: one is known as well as the other was beforehand."""
    rng = np.random.default_rng(2)
    left = rng.normal(size=FRAMES)
    same = np.ones((FRAMES, 2))
    found = End(np.zeros(2), 0.0, left - left.mean(), same)
    groups = np.arange(FRAMES) // 300
    half = half_width(found, [FRAMES], groups, np.array([0.0, 1.0 / spread**2]), NONE)
    wanted = student.ppf(0.975, 6) * np.hypot(spread, 1.0 / np.sqrt(FRAMES))
    assert half[0] == pytest.approx(wanted, rel=0.15)
    alone = half_width(
        replace(found, fun=left, jac=same[:, :1]), [FRAMES], groups, np.zeros(1), NONE
    )
    assert alone[0] < half[0]


def test_numbers_that_are_known_beforehand_take_no_degree_of_freedom() -> None:
    """Five stretches; one number that the data determine, and six that only their priors do."""
    rng = np.random.default_rng(3)
    left = np.convolve(rng.normal(size=FRAMES), np.ones(30), "same")  # too smooth for more
    groups = np.arange(FRAMES) // (FRAMES // 5)
    slopes = np.column_stack((np.ones(FRAMES), 1e-3 * rng.normal(size=(FRAMES, 6))))
    found = End(np.zeros(7), 0.0, left - left.mean(), slopes)
    priors = np.array([0.0, *np.ones(6)])
    half = half_width(found, [FRAMES], groups, priors, NONE)
    alone = half_width(replace(found, jac=slopes[:, :1]), [FRAMES], groups, np.zeros(1), NONE)
    assert half[0] < 3.0 * alone[0]


def test_an_error_of_the_input_that_lasts_widens_an_interval_as_it_moves_the_estimate() -> None:
    """Three samples e of an error along J move the estimate by their sizes: Student's t."""
    rng = np.random.default_rng(5)
    shape, sizes = np.sin(np.arange(FRAMES) / 40.0)[:, None], np.array([0.3, -0.2, 0.1])
    noise = rng.normal(size=FRAMES)
    found = End(np.zeros(1), 0.0, noise, shape)
    given_error = np.outer(sizes, shape[:, 0]) + rng.normal(size=(3, FRAMES))
    groups = np.arange(FRAMES) // 300
    half = half_width(found, [FRAMES], groups, np.zeros(1), given_error)
    assert half_width(found, [FRAMES], groups, np.zeros(1), NONE)[0] < 0.15
    wanted = student.ppf(0.975, 3) * np.sqrt(np.mean(sizes**2))
    assert half[0] == pytest.approx(wanted, rel=0.15)


@given(
    stretches=st.integers(3, 20),
    frames=st.integers(30, 300),
    numbers=st.integers(1, 12),
    memories=st.floats(1.0, 40.0),
    outputs=st.integers(1, 3),
)
def test_stretches_are_cut_alike_in_every_output_and_no_shorter_than_the_memory_lets_them(
    stretches: int, frames: int, numbers: int, memories: float, outputs: int
) -> None:
    one = np.repeat(2 * np.arange(stretches), frames)
    parts = cut(np.tile(one, outputs), numbers, memories).reshape(outputs, -1)
    assert (parts == parts[0]).all()
    names, counts = np.unique(parts[0], return_counts=True)
    if len(names) == stretches:
        assert np.array_equal(np.unique(parts[0], return_inverse=True)[1] * 2, one)
        enough = stretches >= 2 * numbers
        assert enough or frames < 2 * LEAST_MEMORIES * memories
    else:
        assert counts.min() >= np.floor(LEAST_MEMORIES * memories)
        within = np.repeat(one, 1)[np.flatnonzero(np.diff(parts[0], prepend=-1))]
        assert set(within) == set(one)  # every stretch, and none across two


@pytest.mark.parametrize("numbers", [2, 8])
def test_intervals_of_a_short_record_hold_and_say_something(numbers: int) -> None:
    """Five stretches for eight numbers left one degree of freedom: 12.7 for 2 deviations."""
    rng = np.random.default_rng(numbers)
    groups = 2 * np.repeat(np.arange(5), 300)
    held, widths = 0, []
    for _ in range(200):
        shapes = rng.normal(size=(len(groups), numbers))
        noise = rng.normal(size=len(groups))
        found = np.asarray(np.linalg.lstsq(shapes, noise, rcond=None)[0], np.float64)
        end = End(found, 0.0, noise - shapes @ found, shapes)
        half = half_width(end, [len(groups)], groups, np.zeros(numbers), NONE)
        held += abs(found[0]) < half[0]
        widths.append(half[0] * np.sqrt(len(groups)))
    assert held >= 184  # of 190 on the mean
    assert np.median(widths) < 3.5


@pytest.mark.parametrize("found", [0.99, 1.0, 1.7])
@pytest.mark.parametrize("worth", [1.0, 4.0])
def test_where_any_larger_number_does_as_well_the_least_is_named(
    found: float, worth: float
) -> None:
    """It costs 100·(1 − x)² up to 1, and nothing from there on."""
    open_one = open_above(lambda x: 100.0 * max(0.0, 1.0 - x) ** 2, found, (0.0, 4.0), worth)
    assert open_one is not None
    value, low = open_one
    assert value == pytest.approx(min(found, 1.0), abs=1e-6)
    assert low == pytest.approx(
        1.0 - np.sqrt(1.92 * worth + 100.0 * (1.0 - value) ** 2) / 10.0, abs=2e-3
    )


@pytest.mark.parametrize("cost", [lambda x: 100.0 * (1.0 - x) ** 2, lambda x: 7.0 + 0.0 * x])
def test_a_number_that_is_known_or_says_nothing_is_not_open_above(
    cost: Callable[[float], float],
) -> None:
    assert open_above(cost, 1.0, (0.0, 4.0), 1.0) is None
