"""Friction by direction is even friction with an offset: the reading given, and its numbers."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.search.twolaws import UNEVEN, even_reading, plain_reading
from coupled.gap.thresholds import MODEL_ERROR
from tests.support.rigs import bench

[UNEVEN_LAW] = [effect for effect in BY_NAME.values() if effect.even is not None]
PULL, PUSH = (UNEVEN_LAW.value_key(number) for number in UNEVEN_LAW.free)


@given(st.floats(0.1, 50.0), st.floats(1.04, 1.99), st.booleans())
def test_the_even_reading_has_the_same_force_in_each_direction(
    less_N: float, ratio: float, turned: bool
) -> None:
    pull, push = (less_N, ratio * less_N)[:: -1 if turned else 1]
    read = even_reading((UNEVEN_LAW,), {PULL: pull, PUSH: push})
    assert read is not None
    (even, offset), values = read
    friction, force = (values[one.value_key(one.free[0])] for one in (even, offset))
    assert friction - force == pytest.approx(pull)
    assert friction + force == pytest.approx(push)
    assert set(values) == {even.value_key(even.free[0]), offset.value_key(offset.free[0])}


@given(st.floats(0.1, 5.0), st.floats(1.0, 1.5), st.floats(0.0, 20.0))
def test_an_offset_that_is_less_than_friction_is_known_by_is_none(
    less_N: float, ratio: float, filed_N: float
) -> None:
    read = even_reading((UNEVEN_LAW,), {PULL: less_N, PUSH: ratio * less_N}, filed_N)
    assert read is not None
    offset_N, mean_N = 0.5 * (ratio - 1.0) * less_N, 0.5 * (ratio + 1.0) * less_N
    assert len(read[0]) == (1 if offset_N < MODEL_ERROR * (mean_N + filed_N) else 2)
    assert UNEVEN_LAW.even is not None
    even = BY_NAME[UNEVEN_LAW.even[0]]
    assert read[1][even.value_key(even.free[0])] == pytest.approx(mean_N)


def test_uneven_friction_and_a_friction_named_already_stay() -> None:
    assert even_reading((UNEVEN_LAW,), {PULL: 1.0, PUSH: UNEVEN}) is None
    assert UNEVEN_LAW.even is not None
    even = BY_NAME[UNEVEN_LAW.even[0]]
    assert even_reading((even, UNEVEN_LAW), {PULL: 1.0, PUSH: 1.2}) is None
    assert even_reading((even,), {}) is None


def test_a_force_that_is_felt_late_is_named_before_one_that_is_stamped_early() -> None:
    fitted = Fit((), {}, {}, {}, (), bench(), 1.0)
    [late] = [effect for effect in BY_NAME.values() if effect.swallows]
    stamped = Candidate(100.0, BY_NAME[late.swallows[0]], fitted)
    near, far = (Candidate(gain, late, fitted) for gain in (99.9, 90.0))
    other = Candidate(99.95, BY_NAME["inertia"], fitted)
    assert plain_reading(stamped, [stamped, other, near]) is near
    assert plain_reading(stamped, [stamped, far]) is stamped
    assert plain_reading(near, [stamped, near]) is near
