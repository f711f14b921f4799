"""What lies between the hand and the host's numbers: closed forms of gauge, converter and skew."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.rig.gauge import move_gauge
from coupled.rig.packing import pack
from coupled.rig.rig import Rig
from coupled.rig.standalone import History, nodes_of, run_control
from tests.support.rigs import bench

Floats = NDArray[np.float64]
SENSING = "controls.column.sensing"
STEP_N, STEP_s = 20.0, 0.05


def answer(rig: Rig, force: Floats | float, seconds: float = 0.5) -> History:
    """Return what a fine bench does under a force: on its nodes, or stepped to at `STEP_s`."""
    frames = round(seconds * rig.frame_rate)
    times = nodes_of(rig, frames)
    nodes = np.where(times >= STEP_s, force, 0.0) if isinstance(force, float) else force
    return run_control(rig, "column", nodes, np.zeros(frames))


def fine(changes: dict[str, object]) -> Rig:
    """Return a bench read at every step of its loader, which is 2000 a second."""
    return bench({f"{SENSING}.{key}": value for key, value in changes.items()}).changed(
        {"frame_rate_Hz": 2000.0}
    )


def test_a_second_order_amplifier_answers_a_step_by_its_closed_form() -> None:
    w, z = 2.0 * math.pi * 30.0, 0.5
    found = answer(fine({"gauge_frequency_Hz": 30.0, "gauge_damping_ratio": z}), STEP_N)
    # The step rises over the substep before its node: half a substep earlier, on the mean.
    t = np.maximum(found.time_s - STEP_s + 0.5 / 2000.0, 0.0)
    turn = w * math.sqrt(1.0 - z * z)
    fades = np.exp(-z * w * t) * (np.cos(turn * t) + z * w / turn * np.sin(turn * t))
    assert found.force == pytest.approx(STEP_N * (1.0 - fades), abs=0.005 * STEP_N)
    assert found.force.max() == pytest.approx(
        STEP_N * (1.0 + math.exp(-math.pi * z / math.sqrt(1.0 - z * z))), rel=1e-3
    )


def test_a_first_order_amplifier_answers_a_step_exponentially() -> None:
    found = answer(fine({"gauge_frequency_Hz": 5.0, "gauge_order": "first"}), STEP_N)
    t = np.maximum(found.time_s - STEP_s + 0.5 / 2000.0, 0.0)
    expected = STEP_N * -np.expm1(-2.0 * math.pi * 5.0 * t)
    assert found.force == pytest.approx(expected, abs=0.005 * STEP_N)


def test_a_gauges_delay_is_late_for_host_and_loader() -> None:
    prompt, late = answer(fine({}), STEP_N), answer(fine({"gauge_delay_s": 0.02}), STEP_N)
    rows = round(0.02 * 2000.0)
    assert late.force[rows:] == pytest.approx(prompt.force[:-rows], abs=1e-12)
    assert late.computed[rows:] == pytest.approx(prompt.computed[:-rows], abs=1e-12)
    assert not late.force[:rows].any()


def test_a_delay_of_part_of_a_step_lies_straight_between() -> None:
    rig = fine({"gauge_delay_s": 10.25 / 2000.0})
    ramp = 100.0 * nodes_of(rig, 400)
    found = answer(rig, ramp, 0.2)
    assert found.force[20:] == pytest.approx(ramp[20:400] - 100.0 * 10.25 / 2000.0, abs=1e-9)


def test_a_sampling_converter_holds_between_its_samples() -> None:
    rig = fine({"gauge_sampling_Hz": 250.0})  # every eighth step
    ramp = 100.0 * nodes_of(rig, 400)
    found = answer(rig, ramp, 0.2)
    steps = np.arange(400)
    assert found.force == pytest.approx(ramp[steps // 8 * 8], abs=1e-9)
    # and so it is late by half a sample on the mean, less half a step
    assert np.mean(ramp[:400] - found.force) == pytest.approx(100.0 * 3.5 / 2000.0)


def test_a_gauge_lacks_the_force_that_moves_the_mass_beyond_it() -> None:
    """A driven mass: what the loader does with m and m_g is what it does with m + m_g alone.

    Through a servo so fast that the grip follows the loader.
    """
    extra, rate = 2.0, 12.0
    with_mass, heavier = (
        bench(
            {"mass_kg": mass, "servo_frequency_Hz": 150.0, f"{SENSING}.gauge_mass_kg": beyond}
        ).changed({"loader_rate_Hz": 50_000.0, "frame_rate_Hz": 1000.0})
        for mass, beyond in ((4.0, extra), (4.0 + extra, 0.0))
    )
    nodes = 30.0 * np.sin(rate * nodes_of(with_mass, 4000))
    found, wanted = (answer(rig, nodes, 4.0) for rig in (with_mass, heavier))
    late = found.time_s > 2.0
    size = np.max(np.abs(wanted.computed[late]))
    assert np.max(np.abs(found.computed - wanted.computed)[late]) < 0.01 * size
    # The gauge says the hand's force less m_g·x'', and x is δc.
    moved = np.gradient(np.gradient(found.computed, found.time_s), found.time_s)
    hand = 30.0 * np.sin(rate * found.time_s)
    lacks = (hand - found.force)[late][5:-5]
    assert np.max(np.abs(lacks)) > 1.0
    assert lacks == pytest.approx(extra * moved[late][5:-5], abs=0.05 * np.max(np.abs(lacks)))


def test_the_bend_is_that_of_the_hands_force_not_the_gauges() -> None:
    slow = fine({"gauge_frequency_Hz": 1.0, "gauge_order": "first"})
    found = answer(slow, STEP_N)
    at = round(STEP_s * 2000.0) + 1
    bend = slow.controls["column"].loader.bend
    assert found.deflection[at] == pytest.approx(bend * STEP_N, rel=0.01)
    assert found.force[at] < 0.02 * STEP_N


@pytest.mark.parametrize("attribute", ["computed", "force"])
def test_a_skewed_channel_is_what_stood_there_before(attribute: str) -> None:
    """At 100 Hz, 20 steps a frame: a skew of 7.5 steps is what a fine rig has between two."""
    skew_s = 7.5 / 2000.0
    rig = bench({f"{SENSING}.{attribute}_skew_s": skew_s})
    nodes = 30.0 * np.sin(9.0 * nodes_of(rig, 100))
    found = answer(rig, nodes, 1.0)
    exact = answer(fine({}), nodes, 1.0)
    values = getattr(exact, attribute)
    before = np.interp(found.time_s - skew_s, exact.time_s, values)
    assert getattr(found, attribute)[1:] == pytest.approx(before[1:], abs=1e-12)
    other = "force" if attribute == "computed" else "computed"
    assert getattr(found, other) == pytest.approx(getattr(exact, other)[::20], abs=1e-12)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.75])
def test_a_late_gradient_leaves_the_last_one_standing(share: float) -> None:
    """A product held over a frame comes a share of the frame late: until then the old one acts."""
    mass, frame_s = 1e6, 0.01
    base = {"multiplier": "digital", "mass_kg": mass, "damping_N_s_per_m": 0.0}
    rig = bench(base | {"controls.column.compensation.gradient": False}).changed(
        {"controls.column.schedule.total_gradient_N_per_m": [1560.0, 1560.0]}
    )
    late = rig.changed({f"{SENSING}.gradient_skew_s": share * frame_s})
    frames = 3
    # A heavy loader under a great force: δc is ½·a·t², and F_mod small beside it.
    nodes = np.full(frames * rig.substeps + 1, 1e6)
    prompt_x, late_x = (run_control(r, "column", nodes, np.zeros(frames)) for r in (rig, late))
    # F_mod of frame 1 is ΔG·½·a·T². Where it comes late, that of frame 0, nothing, acts first.
    force = 1000.0 * 0.5 * frame_s**2
    spared = 0.5 * force / mass * frame_s**2 * (1.0 - (1.0 - share) ** 2)
    gained = late_x.computed[2] - prompt_x.computed[2]
    assert gained == pytest.approx(spared, rel=1e-3, abs=0.0)  # some 1e-12 m


def test_a_multipliers_offset_is_a_constant_force_and_its_drift_one_linear_in_time() -> None:
    offset, drift, seconds = 6.0, 0.5, 20.0
    rest = bench({"multiplier_offset_N": offset})
    gradient = 560.0 / (1.0 - rest.controls["column"].loader.bend * 560.0)
    zero = np.zeros(round(seconds * rest.frame_rate) * rest.substeps + 1)
    at_rest = answer(rest, zero, seconds)
    assert at_rest.computed[-1] == pytest.approx(-offset / gradient, rel=1e-6)
    assert at_rest.modifying[0] == offset
    # As a force of the loader's own, the other way round, but for F_mod as it is recorded.
    as_force = answer(bench({"offset_N": -offset}), zero, seconds)
    assert at_rest.computed[-1] == pytest.approx(as_force.computed[-1], rel=1e-9)
    drifting = answer(bench({"multiplier_drift_N_per_s": drift}), zero, seconds)
    t, late = drifting.time_s, drifting.time_s > 5.0
    slope, _ = np.polyfit(t[late], drifting.computed[late], 1)
    assert slope == pytest.approx(-drift / gradient, rel=1e-6)
    delta = gradient - 560.0
    assert drifting.modifying - delta * drifting.computed == pytest.approx(drift * t, abs=1e-9)
    digital = answer(bench({"multiplier_offset_N": offset, "multiplier": "digital"}), zero, 1.0)
    assert not digital.computed.any()


def test_neutral_numbers_change_no_byte() -> None:
    """A converter that samples at every step changes the rounding of a difference at most."""
    nodes = 25.0 * np.sin(7.0 * nodes_of(bench(), 200))
    plain = answer(bench(), nodes, 2.0)
    assert not pack(bench())["parameters"]["gauge"]["present"].any()
    spelled = bench({f"{SENSING}.gauge_damping_ratio": 0.3, f"{SENSING}.gauge_order": "first"})
    every = answer(bench({f"{SENSING}.gauge_sampling_Hz": 4000.0}), nodes, 2.0)
    for name, values in vars(answer(spelled, nodes, 2.0)).items():
        assert values.tobytes() == getattr(plain, name).tobytes()
        np.testing.assert_allclose(getattr(every, name), values, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"gauge_delay_s": 0.11}, "gauge_delay_s: input should be less than or equal to 0.1"),
        ({"computed_skew_s": 0.011}, "computed_skew_s: must lie within the frame of 0.01 s"),
        ({"gradient_skew_s": 0.02}, "gradient_skew_s: must lie within the frame"),
        ({"gauge_order": "third"}, "gauge_order"),
    ],
)
def test_what_no_gauge_can_be_is_refused(changes: dict[str, object], says: str) -> None:
    with pytest.raises(InputError, match=says):
        bench({f"{SENSING}.{key}": value for key, value in changes.items()})
    slow = {**{f"{SENSING}.gauge_delay_s": 0.1}, "loader_rate_Hz": 20_000.0}
    with pytest.raises(InputError, match="too long for this loader_rate_Hz"):
        bench().changed(slow)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_servo_at_its_rate_limit_does_not_accelerate_the_mass_on_either_side(side: float) -> None:
    """At the rate limit x'' is 0 while the servo is commanded faster; it brakes by its equation."""
    packed = pack(
        bench({"servo_rate_limit_m_per_s": 0.2, "controls.column.sensing.gauge_mass_kg": 1.0})
    )
    p, s = packed["parameters"][0], packed["state"][0]
    s["linkage"]["rate"] = side * 0.2
    move_gauge(p["gauge"], s["gauge"], p["linkage"], s["linkage"], side * 0.1)
    assert s["gauge"]["acceleration"] == 0.0
    move_gauge(p["gauge"], s["gauge"], p["linkage"], s["linkage"], side * -0.1)
    w = 2.0 * math.pi * 18.0
    wanted = side * (-0.1 * w * w - 2.0 * 0.7 * w * 0.2)
    assert s["gauge"]["acceleration"] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_mass_is_accelerated_by_no_more_than_the_servos_limit(side: float) -> None:
    limit = "servo_acceleration_limit_m_per_s2"
    packed = pack(bench({limit: 3.0, "controls.column.sensing.gauge_mass_kg": 1.0}))
    p, s = packed["parameters"][0], packed["state"][0]
    move_gauge(p["gauge"], s["gauge"], p["linkage"], s["linkage"], side * 0.1)
    assert s["gauge"]["acceleration"] == side * 3.0
    move_gauge(p["gauge"], s["gauge"], p["linkage"], s["linkage"], side * 1e-5)
    wanted = side * 1e-5 * (2.0 * math.pi * 18.0) ** 2
    assert s["gauge"]["acceleration"] == pytest.approx(wanted, rel=1e-12)
