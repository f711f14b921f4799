"""The log-likelihood of a residual, known below the noise floor and estimated above."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.gap.search.gain import misfit


def filled(size: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.full(100, size)


def test_a_misfit_is_that_of_a_noise_known_beneath_the_floor_and_estimated_above() -> None:
    assert misfit(filled(1.0)) == 0.0
    assert misfit(filled(3.0)) == pytest.approx(np.log(9.0))
    assert misfit(filled(0.5)) == pytest.approx(-0.75)


@given(st.floats(0.05, 20.0), st.floats(1.0001, 1.5))
def test_a_misfit_grows_with_what_is_left_and_without_a_jump(size: float, times: float) -> None:
    more = misfit(filled(times * size)) - misfit(filled(size))
    assert 0.0 < more <= times**2 - 1.0 + 1e-9
