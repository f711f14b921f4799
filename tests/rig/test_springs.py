"""Springs that relax, ripple, and an actuator's limit: closed forms, and the order of the steps."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from coupled.rig.statics import static_line
from tests.support.rigs import bench, push

Floats = NDArray[np.float64]
M, C, K = 4.0, 75.0, 560.0
PLAIN = {"bend_m_per_N": 0.0, "controls.column.compensation.gradient": False}
STEP_N, SOFT, TIME_s = 30.0, 400.0, 0.15
RIPPLE: dict[str, Any] = {"ripple_N": 3.0, "ripple_period_m": 8e-3, "ripple_phase_rad": 0.4}


def maxwell(times_s: Floats) -> Floats:
    """Return δc after a step of force: m·x'' + c·x' + K·x + y = F, y' = k·x' − y/τ, exactly."""
    a = np.array([[0.0, 1.0, 0.0], [-K / M, -C / M, -1.0 / M], [0.0, SOFT, -1.0 / TIME_s]])
    rest = np.linalg.solve(a, np.array([0.0, -STEP_N / M, 0.0]))
    return np.array([(rest - expm(a * t) @ rest)[0] for t in times_s])


@pytest.mark.parametrize("loader_rate_Hz", [2000.0, 4000.0])
def test_a_relaxing_spring_answers_a_step_as_the_linear_equations_do(loader_rate_Hz: float) -> None:
    relaxing = {**PLAIN, "relaxing_stiffness_N_per_m": SOFT, "relaxing_time_s": TIME_s}
    rig = bench(relaxing).changed({"loader_rate_Hz": loader_rate_Hz})
    moved = push(rig, STEP_N, 1.0, K)[::20]
    wanted = maxwell(0.01 * np.arange(len(moved), dtype=np.float64))
    off = np.max(np.abs(moved - wanted)) / np.max(wanted)
    assert off < 1e-5 * (2000.0 / loader_rate_Hz) ** 2  # second order
    plain = push(bench(PLAIN), STEP_N, 1.0, K)[::20]
    assert np.max(np.abs(plain - wanted)) > 0.1 * np.max(wanted)


def test_friction_and_a_spring_that_relaxes_creep_together() -> None:
    """Damped so that it never turns back, it is the linear motion under the force less friction."""
    changes = {"friction_N": 5.0, "relaxing_stiffness_N_per_m": SOFT, "relaxing_time_s": TIME_s}
    damped = {"damping_N_s_per_m": 600.0}
    rubbing = push(bench({**PLAIN, **changes, **damped}), STEP_N, 3.0, K)
    free = push(bench({**PLAIN, **changes, **damped, "friction_N": 0.0}), STEP_N - 5.0, 3.0, K)
    np.testing.assert_allclose(rubbing, free, rtol=1e-9, atol=1e-12)
    assert np.all(np.diff(rubbing) > 0.0)


def test_a_control_held_by_friction_lets_go_as_the_spring_relaxes() -> None:
    """At rest y = y₀·e^(−t/τ): it slides when F − K·x − y₀·e^(−t/τ) has grown to the friction."""
    friction, soft, fade_s = 4.0, 3000.0, 2.0
    changes = {"friction_N": friction, "relaxing_stiffness_N_per_m": soft}
    rig = bench({**PLAIN, **changes, "relaxing_time_s": fade_s})
    moved = push(rig, lambda t: np.where(t < 0.3, 40.0, 30.0), 4.0, K)
    still = np.flatnonzero(np.diff(moved[700:]) == 0.0) + 700
    stuck, at = int(still[0]), moved[still[0]]
    freed = int(still[-1])
    # y at rest, by its own equation along the way that was gone
    y = 0.0
    for way in np.diff(moved[: stuck + 1]).tolist():
        y += soft * way - y * 5e-4 / fade_s
    waited = fade_s * np.log(y / (30.0 - K * at - friction))
    assert waited > 0.1
    assert (freed - stuck) * 5e-4 == pytest.approx(waited, rel=0.02)


def test_a_ripple_is_that_of_the_equation_and_its_steps_are_of_second_order() -> None:
    def force(t: Any) -> Any:
        return 30.0 * np.sin(2.0 * np.pi * (0.3 + 0.1 * t) * t)

    def motion(t: float, state: Floats) -> list[float]:
        x, v = state
        cog = 3.0 * math.sin(2.0 * math.pi * x / 8e-3 + 0.4)
        return [v, (float(force(t)) - C * v - K * x - cog) / M]

    times = np.linspace(0.0, 3.0, 6001)
    exact = solve_ivp(motion, (0.0, 3.0), [0.0, 0.0], t_eval=times, rtol=1e-10, atol=1e-12).y[0]
    rig = bench({**PLAIN, **RIPPLE})
    off = [
        float(np.max(np.abs(push(rig.changed({"loader_rate_Hz": f}), force, 3.0, K) - exact)))
        for f in (2000.0, 8000.0)
    ]
    assert off[0] < 2e-4 * np.max(np.abs(exact))
    assert np.log2(off[0] / off[1]) / 2.0 > 1.7
    assert np.max(np.abs(push(bench(PLAIN), force, 3.0, K) - exact)) > 50.0 * off[0]


def test_the_static_line_has_the_ripple_and_the_limit() -> None:
    at = np.linspace(0.002, 0.15, 75)
    rig = bench({**PLAIN, **RIPPLE, "force_limit_N": 40.0})
    line, plain = (static_line(r, "column", 3000.0, at) for r in (rig, bench(PLAIN)))
    modifying = plain.force - K * at
    wanted = K * at + 3.0 * np.sin(2.0 * np.pi * at / 8e-3 + 0.4) + np.minimum(modifying, 40.0)
    np.testing.assert_allclose(line.force, wanted, rtol=1e-12)
    assert np.max(modifying) > 80.0


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_an_actuator_gives_no_more_than_its_limit(multiplier: str) -> None:
    """Beyond it a control rests where G_B and the limit hold it; a lag does not change that."""
    g = 2189.0
    rig = bench({**PLAIN, "force_limit_N": 10.0, "multiplier": multiplier})
    for lag_s in (0.0, 0.02):
        lagged = rig.changed({"controls.column.loader.modifying_lag_s": lag_s})
        for force in (40.0, -40.0):
            rests = push(lagged, force, 6.0, g)[-1]
            assert rests == pytest.approx(math.copysign((40.0 - 10.0) / K, force), rel=1e-5)
        assert push(lagged, 5.0, 6.0, g)[-1] == pytest.approx(5.0 / g, rel=1e-5)


def test_neutral_values_leave_the_loader_as_it_was() -> None:
    def force(t: Floats) -> Floats:
        return 30.0 * np.sin(3.0 * t * t)

    plain = bench({**PLAIN, "friction_N": 2.0, "breakout_N": 1.0})
    named = {"ripple_period_m": 0.03, "ripple_phase_rad": 1.0, "relaxing_time_s": 0.3}
    same = bench({**PLAIN, "friction_N": 2.0, "breakout_N": 1.0, **named})
    assert np.array_equal(push(plain, force, 2.0, K), push(same, force, 2.0, K))
