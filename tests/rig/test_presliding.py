"""Friction whose contact yields before it slips: its closed forms, its limit, its order."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from coupled.rig.friction import (
    FADED,
    SLIPS_ALL,
    added_friction,
    presliding_speed,
    reached,
    running_friction,
    stribeck_factor,
    yielded,
)
from coupled.rig.packing import pack
from coupled.rig.rig import Rig
from tests.support.rigs import bench, push

Floats = NDArray[np.float64]
K = 560.0  # N/m of the spring
FRICTION_N, STIFFNESS = 6.0, 3e4
ELASTIC_SHARE = 0.3  # where a rig file gives none
TRAVEL_m = FRICTION_N / STIFFNESS  # 0.2 mm
PLAIN = {"bend_m_per_N": 0.0, "controls.column.compensation.gradient": False}
YIELDS = {**PLAIN, "friction_N": FRICTION_N, "friction_stiffness_N_per_m": STIFFNESS}


def along(ways: Floats) -> Floats:
    """Return the bristles' bend after each of some ways, d."""
    p = pack(bench(YIELDS))[0]["parameters"]["friction"]
    found, bent = [], 0.0
    for way in ways.tolist():
        bent, _ = yielded(p, FRICTION_N, bent, way)
        found.append(bent)
    return np.array(found)


def test_presliding_friction_starts_as_a_spring_and_ends_at_the_coulomb_force() -> None:
    elastic = ELASTIC_SHARE * TRAVEL_m
    assert along(np.array([elastic]))[0] == pytest.approx(elastic, rel=1e-12)
    assert along(np.array([40.0 * TRAVEL_m]))[0] == pytest.approx(TRAVEL_m, rel=1e-12)
    # Between the two, z_c − z fades over the way as an exponential.
    soft = (1.0 - ELASTIC_SHARE) * TRAVEL_m
    assert along(np.array([elastic + soft]))[0] == pytest.approx(TRAVEL_m - soft / math.e)


def test_a_motion_in_two_parts_ends_as_the_whole_motion() -> None:
    whole = along(np.array([3.0 * TRAVEL_m, -1.7 * TRAVEL_m]))[-1]
    parts = [np.full(30, 0.1 * TRAVEL_m), np.full(17, -0.1 * TRAVEL_m)]
    assert along(np.concatenate(parts))[-1] == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("amplitude", [0.2, 0.6, 1.0, 3.0, 200.0])
def test_a_closed_loop_loses_what_its_branches_enclose(amplitude: float) -> None:
    """Masing's loop: both branches are one curve, turned about; its tips are where they meet.

    The tip z_t solves z_c − z_t = soft·exp(−(2A − z_t − share·z_c)/soft); the area between the
    branches is the loss of a cycle. Below the elastic share it is none.
    """
    a, zc = amplitude * TRAVEL_m, TRAVEL_m
    elastic, soft = ELASTIC_SHARE * zc, (1.0 - ELASTIC_SHARE) * zc
    steps = 4000
    cycle = np.concatenate([np.full(steps, -2.0 * a / steps), np.full(steps, 2.0 * a / steps)])
    bent = np.concatenate(([0.0], along(np.concatenate(([a], np.tile(cycle, 30))))))
    last = bent[-2 * steps - 1 :]
    way = np.concatenate(([0.0], np.cumsum(cycle)))
    loss = STIFFNESS * float(np.sum(0.5 * (last[1:] + last[:-1]) * np.diff(way)))
    tip = last[0]
    if a <= elastic:
        assert loss == pytest.approx(0.0, abs=1e-12)
        return
    slipped = 2.0 * a - tip - elastic  # the way on a branch beyond its straight part
    assert zc - tip == pytest.approx(soft * math.exp(-slipped / soft), rel=1e-3)
    straight = 0.5 * (elastic**2 - tip**2)  # ∫z over the rising branch's straight part
    curved = zc * slipped - soft**2 * -math.expm1(-slipped / soft)
    assert loss == pytest.approx(2.0 * STIFFNESS * (straight + curved), rel=1e-4)
    if amplitude >= 200.0:  # Coulomb's loop, but for what the contact gives back
        assert loss == pytest.approx(4.0 * FRICTION_N * a, rel=0.01)


@given(
    st.floats(-1.0, 1.0),
    st.floats(-0.3, 0.3),
    st.floats(-300.0, 300.0),
    st.sampled_from([5e-4, 1e-3]),
    st.sampled_from([0.0, 3.0]),
    st.sampled_from([0.0, 20.0]),
)
@example(1.0, 0.2, 30.0, 5e-4, 0.0, 0.0)  # all of it slips, and goes on
@example(1.0 - 0.5 * SLIPS_ALL, 0.2, 30.0, 5e-4, 3.0, 0.0)
@example(-1.0, 0.01, -10.0, 1e-3, 3.0, 0.0)  # turned about
@example(1.0, 0.0, 53.0, 5e-4, 3.0, 0.0)  # from its breakaway
@example(-1.0, 1e-4, -60.0, 1e-3, 0.0, 20.0)  # turned about twice, more friction one way
def test_a_steps_speed_balances_its_forces(
    bent: float, rate: float, push_N: float, span: float, more_N: float, forward_N: float
) -> None:
    """inertia·(u − v) and the contact's mean force over the way make up the push, at any speed."""
    levels = {"breakaway_N": FRICTION_N + more_N} if more_N else {}
    p = pack(bench({**YIELDS, **levels, "friction_push_N": forward_N}))[0]["parameters"]["friction"]
    inertia = 2.0 * 4.0 / span

    def level(rate: float, way: float) -> float:
        return float(running_friction(p, rate) + added_friction(p, 0.0, way))

    start = bent * level(rate, bent) / STIFFNESS
    u, after = presliding_speed(p, start, rate, push_N, inertia, span, 0.0)
    ends, mean = yielded(p, level(u, u), start, u * span)
    fading = math.exp(-((u / p["stribeck_rate"]) ** 2))
    force = STIFFNESS * mean + p["contact_damping"] * fading * (ends - start) / span
    speeds = abs(u) + abs(rate)
    assert inertia * (u - rate) + force == pytest.approx(push_N, abs=1e-6 * inertia * speeds + 1e-9)
    assert after == pytest.approx(ends, abs=1e-6 * TRAVEL_m)


@given(st.floats(0.0, 800.0))
@example(0.1)
@example(math.nextafter(0.1, 1.0))
@example(1e-300)
def test_the_exponential_is_accurate_to_thirteen_digits(x: float) -> None:
    assert float(reached(x)) == pytest.approx(-math.expm1(-x), rel=1e-13)


def test_the_stribeck_part_vanishes_at_high_speed() -> None:
    p = pack(bench(YIELDS))[0]["parameters"]["friction"]
    for ratio in (0.0, 0.7, -2.0, 5.9):
        rate = ratio * float(p["stribeck_rate"])
        assert float(stribeck_factor(p, rate)) == pytest.approx(math.exp(-(ratio**2)), rel=1e-12)
    assert stribeck_factor(p, 1.01 * FADED * float(p["stribeck_rate"])) == 0.0


def test_a_small_force_is_held_by_spring_and_contact_together() -> None:
    pull = 0.25 * FRICTION_N
    held = push(bench(YIELDS), lambda t: pull * np.minimum(t, 1.0), 3.0, K)
    assert held[-1] == pytest.approx(pull / (K + STIFFNESS), rel=1e-6)


def test_nothing_creeps_under_a_force_below_breakaway() -> None:
    steady = push(bench(YIELDS), 0.8 * FRICTION_N, 12.0, K)
    assert abs(steady[-1] - steady[len(steady) // 2]) < 1e-12

    def swinging(t: Floats) -> Floats:
        """Return a force that swings within the elastic share about a constant one."""
        return FRICTION_N * (0.15 + 0.1 * np.sin(40.0 * t)) * np.minimum(1.0, t)

    swung = push(bench(YIELDS), swinging, 12.0, K)
    turns = round(2.0 * np.pi / 40.0 * 2000.0) * 12  # of 12 swings, to a fraction of a step
    assert abs(np.mean(swung[-turns:]) - np.mean(swung[8000 : 8000 + turns])) < 1e-3 * TRAVEL_m


def sweep(t: Floats) -> Floats:
    return 45.0 * np.sin(2.0 * np.pi * (0.3 + 0.2 * t) * t)


def moved(rig: Rig) -> Floats:
    return push(rig, sweep, 4.0, K)


def test_the_stiffer_the_contact_the_nearer_is_coulomb() -> None:
    rigid = moved(bench({**PLAIN, "friction_N": FRICTION_N}))
    off = [
        float(np.max(np.abs(moved(bench({**YIELDS, "friction_stiffness_N_per_m": k})) - rigid)))
        for k in (1e5, 1e6, 1e7)
    ]
    # What is left is where in its friction band a control comes to rest.
    assert off[2] < 1e-3 * float(np.max(np.abs(rigid)))
    assert off[2] < 0.4 * off[1] < 0.4 * 0.4 * off[0]


def test_presliding_steps_are_of_second_order() -> None:
    def at(rate_Hz: float) -> Floats:
        return moved(bench({**YIELDS, "breakout_N": 3.0}).changed({"loader_rate_Hz": rate_Hz}))

    fine = at(32000.0)
    off = [float(np.sqrt(np.mean((at(rate) - fine) ** 2))) for rate in (2000.0, 4000.0, 8000.0)]
    assert off[0] < 1e-3 * float(np.max(np.abs(fine)))
    order = np.log2(off[0] / off[2]) / 2.0
    assert order > 1.7, off


def test_a_rigid_contact_is_as_it_was() -> None:
    """Without friction or contact stiffness the loader is unchanged."""
    p = pack(bench({**PLAIN, "friction_stiffness_N_per_m": STIFFNESS}))[0]["parameters"]
    assert p["friction"]["stiffness"] == 0.0
    free = moved(bench({**PLAIN, "friction_stiffness_N_per_m": STIFFNESS}))
    assert np.array_equal(free, moved(bench(PLAIN)))


def test_a_breakaway_yields_too() -> None:
    """From rest the contact carries the breakaway; sliding fast, the running friction."""
    rig = bench({**YIELDS, "breakaway_N": 2.0 * FRICTION_N, "stribeck_rate_m_per_s": 0.01})
    held = push(rig, lambda t: 1.9 * FRICTION_N * np.minimum(0.1 * t, 1.0), 12.0, K)
    assert held[-1] < 10.0 * TRAVEL_m
    gone = push(rig, lambda t: 2.5 * FRICTION_N * np.minimum(0.1 * t, 1.0), 12.0, K)
    assert gone[-1] > FRICTION_N / K
