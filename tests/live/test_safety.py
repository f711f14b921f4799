"""No order goes beyond the limits of size and rate, whatever is asked for."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.live.link import Order
from coupled.live.safety import Fade, Limiter, Limits

FRAME_s, TRAVEL = 1.0 / 120.0, 0.18
LIMITS = Limits(force_N=200.0, rate_N_per_s=2000.0, fade_s=0.5)
ANY = st.floats(allow_nan=True, allow_infinity=True)
ORDERS = st.lists(st.builds(Order, ANY, ANY, ANY, ANY, ANY, ANY, ANY), min_size=1, max_size=30)


@given(ORDERS, st.floats(0.0, 1.0))
def test_whatever_is_asked_size_and_rate_stay_within(asked: list[Order], share: float) -> None:
    limiter, step = Limiter(LIMITS, TRAVEL, FRAME_s), 2000.0 * FRAME_s * (1.0 + 1e-12)
    last = Order(*[0.0] * 7)
    for order in asked:
        sent = limiter.order(order, share)
        for name, scale in {
            "gradient": TRAVEL,
            "second": TRAVEL,
            "breakout": 1,
            "force": 1,
        }.items():
            now, before = getattr(sent, name) * scale, getattr(last, name) * scale
            assert abs(now) <= 200.0 * (1.0 + 1e-12)
            assert abs(now - before) <= step
        last = sent


def test_an_order_within_the_limits_passes_as_it_is() -> None:
    limiter = Limiter(LIMITS, TRAVEL, FRAME_s)
    asked = Order(50.0, 60.0, 0.1, 3.0, 9.0, 610.0, 0.0)
    assert limiter.order(asked, 1.0) == asked
    assert limiter.limited == 0
    assert limiter.order(asked._replace(force=400.0), 1.0).force == 9.0 + 2000.0 * FRAME_s
    assert limiter.limited == 1


def test_what_is_no_number_leaves_the_last_order() -> None:
    limiter = Limiter(LIMITS, TRAVEL, FRAME_s)
    limiter.order(Order(50.0, 50.0, 0.0, 3.0, 9.0, 610.0, 0.0), 1.0)
    sent = limiter.order(Order(math.nan, math.nan, 0.0, math.nan, math.nan, 610.0, 0.0), 1.0)
    assert (sent.gradient, sent.breakout, sent.force) == (50.0, 3.0, 9.0)


def test_a_fade_takes_its_time_both_ways() -> None:
    fade = Fade(0.5, FRAME_s)
    shares = [fade.move(on=True) for _ in range(70)]
    assert shares[29] == pytest.approx(0.5)
    assert shares[59] == pytest.approx(1.0)
    assert shares[60:] == [1.0] * 10
    assert [fade.move(on=False) for _ in range(61)][-1] == 0.0
