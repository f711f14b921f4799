"""What the servo is given of δc: late, in set points, and with the command's rate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from coupled.errors import InputError
from coupled.gap.findings.flown import fly_force
from coupled.rig.replay import drive_linkage, replay_linkage
from coupled.rig.rig import Rig
from tests.support.rigs import bench

RATE_Hz = 100.0
OMEGA, ZETA = 2.0 * np.pi * 3.0, 0.6
SERVO = {"servo_frequency_Hz": 3.0, "servo_damping_ratio": ZETA, "bend_m_per_N": 0.0}
FRAMES = 200


def linkage(rig: Rig, nodes: np.ndarray) -> np.ndarray:
    return drive_linkage(rig, "column", nodes, np.zeros((len(nodes) - 1) // rig.substeps + 1))


def test_a_dead_time_shifts_the_answer_and_nothing_else() -> None:
    rig = bench(SERVO)
    late = rig.changed({"controls.column.loader.servo_delay_s": 0.07})
    nodes = np.zeros(FRAMES * rig.substeps + 1)
    times = np.arange(len(nodes)) / (RATE_Hz * rig.substeps)
    nodes = 0.02 + 0.01 * np.sin(9.0 * np.clip(times - 0.1, 0.0, None))  # from where it stood
    plain, shifted = linkage(rig, nodes), linkage(late, nodes)
    assert shifted[7:] == pytest.approx(plain[:-7], abs=1e-12)
    assert shifted[:7] == pytest.approx(np.full(7, 0.02), abs=1e-12)


def test_set_points_are_held_over_a_frame() -> None:
    """Against the zero-order hold of the same transfer function (scipy)."""
    rig = bench({**SERVO, "controls.column.drive": "setpoint"})
    points = np.repeat(np.random.default_rng(1).normal(0.0, 0.02, 40), 5)
    points[:5] = 0.0
    turn, drive = [[0.0, 1.0], [-(OMEGA**2), -2 * ZETA * OMEGA]], [[0.0], [OMEGA**2]]
    matrices = [np.array(one) for one in (turn, drive, [[1.0, 0.0]], [[0.0]])]
    held = cont2discrete(tuple(matrices), 1.0 / RATE_Hz)
    wanted = np.asarray(dlsim(held, points)[1])[:, 0]
    found = replay_linkage(rig, "column", points, np.zeros(len(points)))
    # A new set point is reached over the first of 20 substeps, so half of one late.
    assert np.max(np.abs(found - wanted)) < 0.015 * np.ptp(wanted)
    wavy = replay_linkage(bench(SERVO), "column", points, np.zeros(len(points)))
    assert np.max(np.abs(wavy - wanted)) > 0.05 * np.ptp(wanted)


@pytest.mark.parametrize(("share", "lag_s"), [(0.0, 2 * ZETA / OMEGA), (1.0, 0.0)])
def test_behind_a_ramp_a_pi_servo_has_no_lag(share: float, lag_s: float) -> None:
    rig = bench({**SERVO, "servo_rate_share": share})
    times = np.arange(FRAMES * rig.substeps + 1) / (RATE_Hz * rig.substeps)
    found = linkage(rig, 0.05 * times)
    assert 0.05 * times[-1] - found[-1] == pytest.approx(0.05 * lag_s, abs=1e-8)


def test_a_proportional_servo_is_one_far_overdamped() -> None:
    gain, ratio = 8.0, 400.0
    rig = bench({**SERVO, "servo_damping_ratio": ratio, "servo_frequency_Hz": gain * ratio / np.pi})
    times = np.arange(FRAMES * rig.substeps + 1) / (RATE_Hz * rig.substeps)
    found = linkage(rig, 0.01 * (times > 0.0))
    frames = np.arange(FRAMES + 1) / RATE_Hz
    assert found == pytest.approx(0.01 * (1.0 - np.exp(-gain * frames)), abs=5e-5)


def test_what_flies_late_and_in_set_points_is_what_is_replayed() -> None:
    loader = {**SERVO, "servo_delay_s": 0.033, "servo_rate_share": 0.4}
    rig = bench({**loader, "controls.column.drive": "setpoint"})
    time = np.arange(FRAMES) / RATE_Hz
    force = 20.0 * np.sin(5.0 * time) * np.minimum(time, 1.0)
    flown = fly_force(rig, {"column": force}, np.full(FRAMES, 500.0))
    again = replay_linkage(rig, "column", flown["column_computed_m"], flown["column_force_N"])
    assert again == pytest.approx(flown["column_deflection_m"], abs=1e-12)


def test_a_dead_time_longer_than_is_kept_is_refused() -> None:
    with pytest.raises(InputError, match="too long"):
        bench({"servo_delay_s": 0.5}).changed({"loader_rate_Hz": 4000.0})
