"""One control's bend: by side, with hysteresis, and held by a clamp."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.errors import InputError
from coupled.rig import linkage
from coupled.rig.declaration import Hand
from coupled.rig.frame import CHANNELS_PER_CONTROL, step_frame
from coupled.rig.packing import pack
from coupled.rig.replay import replay_linkage
from coupled.rig.rig import Rig
from coupled.rig.standalone import nodes_of, run_control
from tests.support.rigs import G_STIFF, K_REPORT, amounts, bench

HOST = "controls.column.compensation"

Floats = np.ndarray


def bent(changes: dict[str, Any], force: Floats) -> Floats:
    """Return what the grip shows with the loader at neutral, d."""
    rig = bench({"bend_m_per_N": 1e-4, **changes})
    return replay_linkage(rig, "column", np.zeros_like(force), force)


def test_a_bend_may_differ_for_pull_and_push_and_is_continuous_between() -> None:
    force = np.array([-200.0, -100.0, -1e-9, 0.0, 1e-9, 100.0, 200.0])
    seen = bent({"bend_push_m_per_N": 3e-5}, force)
    assert seen == pytest.approx(np.where(force > 0.0, 1e-4, 3e-5) * force, rel=1e-12)
    stiffening = bent({"bend_push_m_per_N": 3e-5, "bend_limit_m": 0.01}, force)
    small = np.where(force > 0.0, 1e-4, 3e-5) * force / 0.01
    assert stiffening == pytest.approx(0.01 * np.tanh(small), rel=1e-12)


@pytest.mark.parametrize("limit", [0.0, 0.02])
def test_the_slope_is_that_of_the_side(limit: float) -> None:
    rig = bench({"bend_m_per_N": 1e-4, "bend_push_m_per_N": 3e-5, "bend_limit_m": limit})
    p = pack(rig)[0]["parameters"]["linkage"]
    for force in (-150.0, 150.0):
        ahead = (linkage.bend(p, force + 0.01) - linkage.bend(p, force - 0.01)) / 0.02
        assert linkage.bend_slope(p, force) == pytest.approx(ahead, rel=1e-6)


def test_a_push_bend_that_no_gradient_allows_is_refused() -> None:
    with pytest.raises(InputError, match=r"loader\.bend_push_m_per_N: K·G_T"):
        bench({f"{HOST}.bend_m_per_N": 0.0, "bend_push_m_per_N": 1.01 / G_STIFF})


@given(
    share=st.floats(0.05, 0.95),
    width=st.floats(1.0, 40.0),
    amplitude=st.floats(25.0, 300.0),
)
def test_the_work_that_hysteresis_takes_in_a_cycle(
    share: float, width: float, amplitude: float
) -> None:
    """∮F·dδ = s·K·w·(2A − w): P follows F ± w/2, a parallelogram w wide and 2A − w high."""
    phase = np.linspace(0.0, 4.0 * np.pi, 4001)
    force = amplitude * np.sin(phase)
    changes = {"bend_hysteresis_share": share, "bend_hysteresis_width_N": width}
    seen = bent(changes, force)[2000:]
    held = force[2000:]
    work = float(np.sum(0.5 * (held[1:] + held[:-1]) * np.diff(seen)))
    assert work == pytest.approx(share * 1e-4 * width * (2.0 * amplitude - width), rel=2e-3)


def test_a_flown_force_takes_the_bends_hysteresis_along() -> None:
    """Pulled to 60 N and let go to 40 N, the grip's bend is that of its two shares: the path's."""
    share, width = 0.4, 10.0
    rig = bench({"bend_hysteresis_share": share, "bend_hysteresis_width_N": width})
    frames = 700
    times = nodes_of(rig, frames)
    nodes = np.interp(times, [0.0, 1.0, 3.5, 4.5], [0.0, 60.0, 60.0, 40.0])
    found = run_control(rig, "column", nodes, np.zeros(frames))
    shown = found.deflection - found.computed  # at rest the servo stands at δc
    for at_s, force, carried in ((3.49, 60.0, 55.0), (6.99, 40.0, 45.0)):
        bend = K_REPORT * ((1.0 - share) * force + share * carried)
        assert shown[round(at_s * rig.frame_rate)] == pytest.approx(bend, rel=1e-3)


def test_hysteresis_within_its_width_bends_less_and_takes_no_work() -> None:
    force = 4.9 * np.sin(np.linspace(0.0, 20.0, 2001))
    seen = bent({"bend_hysteresis_share": 0.4, "bend_hysteresis_width_N": 10.0}, force)
    assert seen == pytest.approx(0.6 * 1e-4 * force, abs=1e-12)


@given(share=amounts(0.95), width=amounts(50.0))
def test_hysteresis_stays_within_its_band_and_never_jumps(share: float, width: float) -> None:
    rng = np.random.default_rng(3)
    force = np.cumsum(rng.normal(0.0, 5.0, 500))
    seen = bent({"bend_hysteresis_share": share, "bend_hysteresis_width_N": width}, force)
    assert np.all(np.abs(seen - 1e-4 * force) <= 0.5 * share * 1e-4 * width + 1e-12)
    assert np.all(np.abs(np.diff(seen)) <= 1e-4 * np.abs(np.diff(force)) + 1e-9)


def held_by(rig: Rig, target: float, hand: Hand, seconds: float = 1.0) -> Floats:
    """Return the record of a clamp that takes the grip to ±target, two frames a row."""
    packed = pack(rig, {"column": hand})
    frames = round(seconds * rig.frame_rate)
    nodes = np.arange(frames * rig.substeps + 1) / (frames * rig.substeps)
    script = np.zeros((1, 2, len(nodes)))
    script[0, 1] = target * np.sin(2.0 * np.pi * nodes)
    record = np.zeros((frames, 2 + CHANNELS_PER_CONTROL))
    for k in range(frames):
        step_frame(packed, script, record, k, (0.0,), 1.0)
    asked = script[0, 1, :: rig.substeps][:frames]
    return np.column_stack((asked, record[:, 3], record[:, 1]))


STILL = {"mass_kg": 1e12, "damping_N_s_per_m": 1e12}  # a loader that no force moves


@pytest.mark.parametrize("stiffness", [1e4, 1e6, 1e9])
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"bend_push_m_per_N": 2e-5},
        {"bend_push_m_per_N": 4e-4},
        {"bend_hysteresis_share": 0.5, "bend_hysteresis_width_N": 8.0},
        {"bend_hysteresis_share": 0.9, "bend_hysteresis_width_N": 2.0, "bend_push_m_per_N": 3e-5},
    ],
)
def test_a_stiff_clamp_bends_the_structure_without_chatter(
    changes: dict[str, Any], stiffness: float
) -> None:
    """The loader stands still: the hand's implicit slope alone decides, at any stiffness."""
    rig = bench({"bend_m_per_N": 1e-4, **STILL, **changes})
    asked, seen, force = held_by(rig, 0.005, Hand(stiffness=stiffness), 4.0).T
    assert seen == pytest.approx(asked - force / stiffness, abs=1e-4)
    turns = np.count_nonzero(np.diff(np.sign(np.diff(force))))
    assert turns <= 4  # at the peaks of what is asked, and where the play takes hold


def test_a_clamp_on_a_moving_loader_is_as_stable_as_with_a_plain_bend() -> None:
    changes = {"bend_push_m_per_N": 5e-5, "bend_hysteresis_share": 0.5}
    changes |= {"bend_hysteresis_width_N": 8.0}
    plain, uneven = (
        held_by(
            bench({"bend_m_per_N": 1e-4, **more}), 0.05, Hand(stiffness=1e4, damping=200.0), 4.0
        )
        for more in ({}, changes)
    )
    off = [float(np.max(np.abs(one[20:, 1] - one[20:, 0]))) for one in (plain, uneven)]
    assert off[1] < 1.2 * off[0]


def test_a_plain_bend_is_the_same_to_the_last_bit() -> None:
    force = np.linspace(-300.0, 300.0, 301)
    plain = bent({}, force)
    same = {"bend_push_m_per_N": 1e-4, "bend_hysteresis_width_N": 10.0}
    assert np.array_equal(plain, bent(same, force))
    assert np.array_equal(plain, 1e-4 * force)
