"""Limits of size and rate on every order, and the plausibility of measurements."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import lsim

from coupled.api.rigs import load_rig
from coupled.live.link import Measured, Order
from coupled.live.safety import Fade, Limiter, Limits, Plausibility
from coupled.live.servo import Servo

FRAME_s, TRAVEL = 1.0 / 120.0, 0.18
LIMITS = Limits(force_N=200.0, rate_N_per_s=2000.0, fade_s=0.5)
Floats = NDArray[np.float64]
COLUMN = load_rig("report-column").controls["column"]
K = COLUMN.loader.bend
ANY = st.floats(allow_nan=True, allow_infinity=True)
ORDERS = st.lists(st.builds(Order, ANY, ANY, ANY, ANY, ANY, ANY, ANY), min_size=1, max_size=30)


@given(ORDERS, st.floats(0.0, 1.0))
def test_any_order_is_limited_in_size_and_rate(asked: list[Order], share: float) -> None:
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
        assert most(sent) <= 200.0 * (1.0 + 1e-9)
        last = sent


def most(order: Order, own: float = 0.0) -> float:
    """Return the largest force that an order makes within the travel, by trying places, N."""
    if 0.0 < order.break_at < TRAVEL:
        ends = np.array([0.0, order.break_at, TRAVEL])
        slopes = np.array([own + order.gradient, own + order.second])
        force = np.concatenate(([0.0], np.cumsum(slopes * np.diff(ends))))
    else:
        force = np.array([0.0, TRAVEL * (own + order.gradient)])
    return float(np.abs(order.breakout + force).max())


@given(ORDERS)
def test_the_loader_s_own_spring_counts_where_the_host_orders_it(asked: list[Order]) -> None:
    own = 900.0  # N/m: 162 N at the end of the travel
    limiter = Limiter(LIMITS, TRAVEL, FRAME_s, own)
    for order in asked:
        assert most(limiter.order(order, 1.0), own) <= 200.0 * (1.0 + 1e-9)


def test_parts_that_exceed_a_limit_together_are_reduced_in_proportion() -> None:
    limiter, asked = Limiter(LIMITS, TRAVEL, FRAME_s), Order(1000.0, 1000.0, 0, 120.0, 0, 1560.0, 0)
    for _ in range(200):
        sent = limiter.order(asked, 1.0)
    share = 200.0 / (1000.0 * TRAVEL + 120.0)
    assert sent.gradient == pytest.approx(share * 1000.0)
    assert sent.breakout == pytest.approx(share * 120.0)


def watched(force: Floats, computed: Floats, more: Floats, gauge: bool = True) -> list[str]:
    """Return the fault found at each sample of a control; δ is the true one plus `more`."""
    plausible = Plausibility(COLUMN, FRAME_s, gauge)
    servo = Servo(COLUMN, FRAME_s)
    places = [servo.move(float(one)) for one in computed]
    samples = zip(force, computed, places + K * force + more, strict=True)
    return [plausible.update(Measured(*map(float, sample))) for sample in samples]


def hand(seconds: float, noise: float = 0.05) -> tuple[Floats, Floats]:
    """Return the force in N of a hand that moves a control by 30 N, and δc in m."""
    time = np.arange(0.0, seconds, FRAME_s)
    force = 30.0 * np.sin(2.0 * np.pi * 0.5 * time)
    return force + noise * np.random.default_rng(1).standard_normal(len(time)), force / 1200.0


def test_measurements_of_a_healthy_control_are_plausible() -> None:
    force, computed = hand(20.0)
    for more in (0.0 * force, 0.9 * K * force, 2e-3 * np.sign(force)):  # softened, with play
        assert set(watched(force, computed, more)) == {""}
    held = np.where(np.arange(len(force)) < 240, 0.0, 30.0)  # a force that is held, without noise
    answer = lsim(([1.0], [4.0, 75.0, 1200.0]), held, FRAME_s * np.arange(len(held)))[1]
    assert set(watched(held, np.asarray(answer), 0.0 * held)) == {""}


@pytest.mark.parametrize("stuck", [0.0, 17.5, 2000.0])
def test_a_gauge_that_is_lost_is_found_while_the_control_moves(stuck: float) -> None:
    force, computed = hand(20.0)
    begun, ended = round(5.0 / FRAME_s), round(12.0 / FRAME_s)
    read = force.copy()
    read[begun:ended] = stuck
    said = watched(read, computed, K * (force - read))
    assert set(said[:begun]) == {""}
    assert all("force gauge" in one for one in said[begun + round(2.1 / FRAME_s) : ended])
    assert "force gauge" in said[ended + round(0.9 / FRAME_s)]  # until it has been well for 1 s
    assert set(said[ended + round(1.1 / FRAME_s) :]) == {""}
    assert set(watched(read, computed, K * (force - read), gauge=False)[:begun]) == {""}


def test_a_transducer_that_does_not_agree_is_found() -> None:
    force, computed = hand(10.0)
    begun = round(5.0 / FRAME_s)
    more = np.where(np.arange(len(force)) < begun, 0.0, 0.05)
    said = watched(force, computed, more)
    assert set(said[: begun + round(0.2 / FRAME_s)]) == {""}
    assert all("δ does not agree" in one for one in said[begun + round(0.25 / FRAME_s) :])


def test_an_order_within_the_limits_passes_as_it_is() -> None:
    limiter = Limiter(LIMITS, TRAVEL, FRAME_s)
    asked = Order(50.0, 60.0, 0.1, 3.0, 9.0, 610.0, 0.0)
    assert limiter.order(asked, 1.0) == asked
    assert limiter.limited == 0
    assert limiter.order(asked._replace(force=400.0), 1.0).force == 9.0 + 2000.0 * FRAME_s
    assert limiter.limited == 1


def test_an_order_that_is_not_a_number_repeats_the_last_one() -> None:
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
