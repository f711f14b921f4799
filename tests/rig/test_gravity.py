"""Gravity on a joint: its closed forms, in the loader's steps, at rest and under imposed motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.rig.hosted import Feel
from coupled.rig.imposed import answer_to
from coupled.rig.nodes import on_nodes
from coupled.rig.replay import drive_loader
from coupled.rig.rigfile import read_rig
from coupled.rig.statics import static_line
from tests.support.pendulum import DAMPING, WEIGHT_N, ANGLE_rad, pendulum_rig, swing
from tests.support.rigs import bench


def test_a_link_swings_as_a_pendulum_and_the_steps_are_of_second_order() -> None:
    frame_Hz = 100.0
    times = np.arange(301) / frame_Hz
    exact, zeros, off = swing(times), np.zeros(len(times)), list[float]()
    assert np.ptp(exact) > 1.0  # sin is far from a line
    for rate_Hz in (2000.0, 8000.0):
        rig = pendulum_rig({"loader_rate_Hz": rate_Hz})
        steps = np.arange(len(times) * rig.substeps + 1)
        nodes = 9.0 * np.sin(4.0 * steps / (frame_Hz * rig.substeps))
        found = drive_loader(rig, "wheel", nodes, Feel(zeros), zeros)[0]
        off.append(float(np.max(np.abs(found - exact))))
    assert off[0] < 1e-4 * np.ptp(exact)
    assert np.log2(off[0] / off[1]) / 2.0 > 1.7


def test_at_rest_and_under_imposed_motion_the_force_is_that_of_the_weight() -> None:
    at = np.linspace(0.05, 1.2, 24)
    line = static_line(pendulum_rig(), "wheel", 1000.0, at)
    np.testing.assert_allclose(line.force, WEIGHT_N * np.sin(at + ANGLE_rad), rtol=1e-12)
    rig = pendulum_rig({"controls.wheel.drive": "displacement"})
    place = np.cumsum(np.full(400, 2e-3))
    answer = answer_to(rig, "wheel", on_nodes(rig, place), Feel(np.zeros(400))).force[50:-50]
    wanted = WEIGHT_N * np.sin(place[50:-50] + ANGLE_rad) + DAMPING * 2e-3 * rig.frame_rate
    np.testing.assert_allclose(answer, wanted, rtol=1e-3)


def test_a_control_that_moves_along_a_line_has_none() -> None:
    with pytest.raises(InputError, match=r"gravity_N: acts on an axis that turns"):
        bench({"gravity_N": 3.0})


def test_an_angle_without_a_weight_is_refused_in_a_file(tmp_path: Path) -> None:
    text = pendulum_rig().to_toml()
    assert text.count("\ngravity_N = ") == 1
    lines = [line for line in text.splitlines() if not line.startswith("gravity_N")]
    (tmp_path / "rig.toml").write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=r"angle_rad: has no effect without gravity_N"):
        read_rig(tmp_path / "rig.toml")


@pytest.mark.parametrize("frame_Hz", [25.0, 10_000.0])
def test_logs_of_slow_and_of_fast_machines_are_replayed(frame_Hz: float) -> None:
    """At 10 kHz the loader takes one step a frame, at 25 Hz eighty."""
    times = np.arange(round(1.2 * frame_Hz)) / frame_Hz
    rig, zeros = pendulum_rig({"frame_rate_Hz": frame_Hz}), np.zeros(len(times))
    assert rig.substeps == (1 if frame_Hz > 2000.0 else 80)
    steps = np.arange(len(times) * rig.substeps + 1)
    nodes = 9.0 * np.sin(4.0 * steps / (frame_Hz * rig.substeps))
    found = drive_loader(rig, "wheel", nodes, Feel(zeros), zeros)[0]
    assert np.max(np.abs(found - swing(times))) < 1e-5
