"""The loader against closed forms, then its order, then what must hold everywhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coupled.rig.friction import running_friction
from coupled.rig.hosted import Feel, OtherInputs
from coupled.rig.packing import pack
from coupled.rig.replay import drive_loader
from tests.support.rigs import amounts, bench, push

M, C, K = 4.0, 75.0, 560.0
PLAIN = {"bend_m_per_N": 0.0, "controls.column.compensation.bend_m_per_N": 0.0}
RATE = 2000.0


def times(x: np.ndarray, rate: float = RATE) -> np.ndarray:
    return np.arange(len(x)) / rate


def test_static_deflection_is_force_over_gradient() -> None:
    x = push(bench(PLAIN), 30.0, 8.0)
    assert x[-1] == pytest.approx(30.0 / K, rel=1e-9)


@pytest.mark.parametrize("damping", [10.0, 2 * math.sqrt(M * K), 300.0])
def test_a_step_response_is_that_of_mass_spring_and_damper(damping: float) -> None:
    x = push(bench({**PLAIN, "damping_N_s_per_m": damping}), 30.0, 2.0)
    t = times(x)
    poles = np.roots([M, damping, K]).astype(complex)
    if abs(poles[0] - poles[1]) < 1e-3:
        exact = 1 - (1 - poles[0].real * t) * np.exp(poles[0].real * t)
    else:
        a, b = poles
        exact = (1 + (b * np.exp(a * t) - a * np.exp(b * t)) / (a - b)).real
    assert np.max(np.abs(x / (30.0 / K) - exact)) < 1e-4


def test_bob_weight_offset_and_cubic_stand_in_the_balance() -> None:
    rig = bench({**PLAIN, "bob_weight_N_per_g": 12.0, "offset_N": 3.0, "cubic_N_per_m3": 4.0e4})
    frames = 1000
    nodes = np.full(frames * rig.substeps + 1, 40.0)
    load = np.full(frames, 2.5)
    flat = np.full(frames, K)
    x, _ = drive_loader(rig, "column", nodes, Feel(flat), np.zeros(frames), OtherInputs(load))
    assert K * x[-1] + 4.0e4 * x[-1] ** 3 == pytest.approx(40.0 + 3.0 - 12.0 * 1.5, rel=1e-9)


def test_a_softening_spring_yields_and_runs_to_its_stop_beyond_its_greatest_force() -> None:
    """K·x + k₃·x³ is greatest at x² = K/(3·|k₃|), within the travel, with two thirds of K·x."""
    at, travel = 0.08, 0.1778
    rig = bench({**PLAIN, "cubic_N_per_m3": -K / (3.0 * at**2)})
    x = push(rig, lambda t: (2.0 / 3.0) * K * at * np.clip(t / 10.0, 0.0, 1.0) * 0.9, 20.0)
    assert K * x[-1] * (1.0 - x[-1] ** 2 / (3.0 * at**2)) == pytest.approx(0.6 * K * at, rel=1e-6)
    assert x[-1] < at
    over = push(rig, lambda t: (2.0 / 3.0) * K * at * np.clip(t / 10.0, 0.0, 1.0) * 1.1, 20.0)
    assert over[-1] == pytest.approx(travel)


def test_a_control_released_inside_the_friction_band_does_not_creep() -> None:
    rig = bench({**PLAIN, "friction_N": 10.0})
    x = push(rig, lambda t: np.where(t < 30.0, np.minimum(25.0, t), 15.0), 90.0)
    held = x[int(30.0 * RATE) :]
    assert np.all(held == held[0])
    assert held[0] == pytest.approx(15.0 / K, rel=1e-3)  # 25 N less 10 N of friction


def test_friction_band_is_twice_the_friction_wide() -> None:
    slow = 40.0
    rig = bench({**PLAIN, "friction_N": 10.0, "damping_N_s_per_m": 0.0})
    x = push(rig, lambda t: 40.0 * np.sin(2 * np.pi * t / slow), 1.25 * slow)
    t = times(x)
    force = 40.0 * np.sin(2 * np.pi * t / slow)
    up = (t > slow * 0.76) & (np.abs(x) < 0.02)
    down = (t > slow * 0.26) & (t < slow * 0.74) & (np.abs(x) < 0.02)
    loop = np.mean(force[up] - K * x[up]) - np.mean(force[down] - K * x[down])
    assert loop == pytest.approx(20.0, rel=1e-3)


def test_coulomb_friction_takes_the_same_amplitude_from_every_half_swing() -> None:
    friction, pull = 2.0, 60.0
    rig = bench({**PLAIN, "friction_N": friction, "damping_N_s_per_m": 0.0})
    x = push(rig, lambda t: np.where(t < 1.0, pull, 0.0), 6.0)
    free = x[int(1.0 * RATE) + 1 :]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(free))) != 0) + 1
    peaks = np.abs(free[turns])
    peaks = peaks[peaks > 6 * friction / K][:5]
    assert np.diff(peaks) == pytest.approx(-2 * friction / K, rel=1e-3)
    swings = (turns[4] - turns[0]) / 4 / RATE
    assert swings == pytest.approx(math.pi * math.sqrt(M / K), rel=1e-3)


def test_a_loader_breaks_away_at_breakaway_and_moves_at_running_friction() -> None:
    rig = bench({**PLAIN, "friction_N": 6.0, "breakaway_N": 14.0})
    x = push(rig, lambda t: 2.0 * t, 12.0)
    moved = int(np.argmax(x > 0.0))
    assert 2.0 * moved / RATE == pytest.approx(14.0, abs=2.0 / RATE * 2)
    flown = push(rig, 60.0, 10.0)
    plain = push(bench({**PLAIN, "friction_N": 6.0}), 60.0, 10.0)
    assert np.max(flown) == pytest.approx(np.max(plain), rel=5e-3)


def test_breakaway_fades_with_the_square_of_the_speed() -> None:
    """F_c + (F_s − F_c)·exp(−(v/v_s)²), here 6 + 8·exp(−(v/v_s)²)."""
    rig = bench({**PLAIN, "friction_N": 6.0, "breakaway_N": 14.0, "stribeck_rate_m_per_s": 0.004})
    p = pack(rig)[0]["parameters"]["friction"]
    for share in (0.0, 0.5, 1.0, 2.0, -2.0):
        expected = 6.0 + 8.0 * math.exp(-(share**2))
        assert running_friction(p, share * 0.004) == pytest.approx(expected, rel=1e-12)


def test_breakout_holds_at_neutral_and_then_adds_to_the_gradient() -> None:
    rig = bench({**PLAIN, "breakout_N": 9.0})
    x = push(rig, lambda t: 3.0 * t, 12.0)
    t = times(x)
    assert np.all(x[t < 2.999] == 0.0)
    assert push(rig, 30.0, 10.0)[-1] == pytest.approx((30.0 - 9.0) / K, rel=1e-9)
    released = push(rig, lambda t: np.where(t < 2.0, 30.0, 0.0), 20.0)
    assert released[-1] == 0.0


def test_free_mass_meets_the_stop_in_time_and_stays_there() -> None:
    rig = bench({**PLAIN, "damping_N_s_per_m": 0.0, "basic_gradient_N_per_m": 0.0})
    x = push(rig, lambda t: np.where(t < 1.5, 8.0, -8.0), 2.2, gradient=0.0)
    t = times(x)
    at = math.sqrt(2 * 0.1778 * M / 8.0)
    free = t < at
    assert x[free] == pytest.approx(8.0 / M * t[free] ** 2 / 2, abs=1e-12)
    assert t[np.argmax(x >= 0.1778)] == pytest.approx(at, abs=1.0 / RATE)
    assert np.all(x[(t > at + 1e-3) & (t < 1.5)] == 0.1778)
    left = t > 1.501
    back = 0.1778 - 8.0 / M * (t[left] - 1.5) ** 2 / 2
    assert x[left] == pytest.approx(np.maximum(back, -0.1778), abs=1e-3)


def test_a_delay_shifts_the_response() -> None:
    late = 0.0603  # not a whole number of substeps

    def force(t: np.ndarray) -> np.ndarray:
        return 30.0 * np.sin(3.0 * t) ** 2

    plain = push(bench(PLAIN), force, 3.0)
    delayed = push(bench({**PLAIN, "delay_s": late}), force, 3.0)
    t = times(plain)
    assert np.interp(t - late, t, plain) == pytest.approx(delayed, abs=1e-7)


SMOOTH = {"cubic_N_per_m3": 3e4}
ROUGH = {"friction_N": 4.0, "breakout_N": 5.0, "cubic_N_per_m3": 3e4}
STRIBECK = {"friction_N": 4.0, "breakaway_N": 7.0, "stribeck_rate_m_per_s": 0.05}


@pytest.mark.parametrize(
    ("settings_", "least"), [(SMOOTH, 1.95), (ROUGH, 1.8), (STRIBECK, 1.8)], ids=str
)
def test_the_integration_is_of_second_order_through_stick_slip_and_neutral(
    settings_: dict[str, float], least: float
) -> None:
    errors = []
    reference = None
    for rate in (96_000.0, 16_000.0, 8_000.0, 4_000.0):
        rig = bench({**PLAIN, **settings_, "damping_N_s_per_m": 20.0})
        rig = rig.changed({"loader_rate_Hz": rate})
        x = push(rig, lambda t: 45.0 * np.sin(4.0 * t) + 10.0 * t, 3.0)
        x = x[::2]
        if reference is None:
            reference = x
        else:
            errors.append(np.sqrt(np.mean((x - reference) ** 2)))
    order = np.log2(errors[2] / errors[0]) / 2
    assert order > least, errors


def test_the_integration_is_stable_where_an_explicit_scheme_is_not() -> None:
    rig = bench({**PLAIN, "mass_kg": 1e-4, "damping_N_s_per_m": 500.0})
    x = push(rig, 30.0, 20.0)
    assert x[-1] == pytest.approx(30.0 / K, rel=1e-6)
    assert np.max(x) < 1.01 * 30.0 / K


@settings(max_examples=60, deadline=None)
@given(
    mass=st.floats(0.2, 20.0),
    damping=amounts(200.0),
    friction=amounts(20.0),
    breakaway=amounts(10.0),
    breakout=amounts(20.0),
    cubic=amounts(1e5),
    force=st.floats(-400.0, 400.0),
)
def test_released_it_never_gains_energy_nor_leaves_its_stops(
    mass: float,
    damping: float,
    friction: float,
    breakaway: float,
    breakout: float,
    cubic: float,
    force: float,
) -> None:
    rig = bench(
        {
            **PLAIN,
            "mass_kg": mass,
            "damping_N_s_per_m": damping,
            "friction_N": friction,
            "breakaway_N": friction + breakaway,
            "breakout_N": breakout,
            "cubic_N_per_m3": cubic,
        }
    )
    x = push(rig, lambda t: np.where(t < 0.5, force, 0.0), 2.0)
    assert np.all(np.isfinite(x))
    assert np.max(np.abs(x)) <= 0.1778
    free = x[int(0.5 * RATE) + 2 :]
    rate = np.diff(free) * RATE
    middle = 0.5 * (free[1:] + free[:-1])
    energy = (
        0.5 * mass * rate**2
        + 0.5 * K * middle**2
        + 0.25 * cubic * middle**4
        + breakout * np.abs(middle)
    )
    peak = np.maximum.accumulate(energy[::-1])[::-1]
    assert peak[0] <= energy[0] * (1 + 2e-2) + 1e-6


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_control_comes_to_rest_at_neutral_where_the_breakout_holds_it(side: float) -> None:
    """On its way back it has bent a relaxing spring, which takes part of the 8 N that pull on.

    The breakout of 10 N holds the rest. Added to the pull, the spring's 9 N were more than that.
    """
    spring = {"relaxing_stiffness_N_per_m": 200.0, "relaxing_time_s": 1.0}
    rig = bench({**PLAIN, "breakout_N": 10.0, "damping_N_s_per_m": 300.0, **spring})
    x = side * push(rig, lambda t: side * np.where(t < 3.0, 38.0, -8.0), 5.0)
    assert x[5999] > 0.04
    reached = int(np.argmax(x[6000:] <= 0.0)) + 6000
    assert reached < 8000
    assert np.all(x[reached + 400 :] == 0.0)
