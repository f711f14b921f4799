"""The force that answers an imposed motion: the loader's laws, solved for the force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.rig.hosted import Feel
from coupled.rig.imposed import answer_to
from coupled.rig.nodes import on_nodes
from tests.support.rigs import BENCH, K_REPORT, bench, push

RATE_Hz, FRAMES, G = 100.0, 400, 560.0
TIME = np.arange(FRAMES) / RATE_Hz
TURN, SIZE = 2.0 * np.pi * 1.3, 0.05
WAY = SIZE * np.sin(TURN * TIME)
SPEED, ACCELERATION = TURN * SIZE * np.cos(TURN * TIME), -(TURN**2) * WAY
MIDDLE = slice(5, -5)  # the acceleration's mean has one side alone at the ends


def answered(changes: dict[str, float], way: np.ndarray = WAY) -> np.ndarray:
    rig = bench(changes)
    return answer_to(rig, "column", on_nodes(rig, way), Feel(np.full(len(way), G))).force


def test_mass_spring_and_damper_answer_as_their_equation_says() -> None:
    stiffness = G / (1.0 - K_REPORT * G)  # eq. (12)
    wanted = 4.0 * ACCELERATION + 75.0 * SPEED + stiffness * WAY + 1e5 * WAY**3
    found = answered({"cubic_N_per_m3": 1e5})
    assert found[MIDDLE] == pytest.approx(wanted[MIDDLE], abs=2e-3 * np.ptp(wanted))


@pytest.mark.parametrize("rate_Hz", [25.0, 250.0, 2000.0])
def test_a_spring_or_a_mass_alone_answers_without_damping(rate_Hz: float) -> None:
    """Of 2 Hz at 25 rows a second, and of a spring whose force is far above that of a damper."""
    time, turn = np.arange(round(6.0 * rate_Hz)) / rate_Hz, 4.0 * np.pi
    way = SIZE * np.sin(turn * time)
    for numbers in ({"mass_kg": 1e-6, "basic_gradient_N_per_m": 6e3}, {"mass_kg": 8.0}):
        usual = {"basic_gradient_N_per_m": 0.0, "damping_N_s_per_m": 1e-3}
        rig = bench({**usual, **numbers}, {**BENCH, "frame_rate_Hz": rate_Hz})
        loader = rig.controls["column"].loader
        rigid = rig.changed({"controls.column.compensation.gradient": False})
        total = np.full(len(way), loader.basic_gradient)
        found = answer_to(rigid, "column", on_nodes(rigid, way), Feel(total)).force[8:-8]
        wanted = ((loader.basic_gradient - loader.mass * turn**2) * way)[8:-8]
        assert found == pytest.approx(wanted, abs=1e-3 * np.ptp(wanted))


@pytest.mark.parametrize("curve", [False, True])
def test_beyond_the_break_the_second_gradient_answers(curve: bool) -> None:
    first, second, at = G, 300.0, 0.02
    schedule = "controls.column.schedule"
    table: dict[str, Any] = {f"{schedule}.second_gradient_N_per_m": [second, second]}
    table |= {f"{schedule}.break_deflection_m": at}
    if curve:
        deflection = {f"{schedule}.deflection_m": [0.0, at, 0.1]}
        force = {f"{schedule}.force_N": [[0.0, first * at, first * at + second * (0.1 - at)]] * 2}
        table = deflection | force | {f"{schedule}.total_gradient_N_per_m": []}
    rig = bench({"mass_kg": 1e-6, "damping_N_s_per_m": 0.0, **table})
    each = np.ones(FRAMES)
    feel = Feel(first * each, second * each, 1000.0 * each)
    found = answer_to(rig, "column", on_nodes(rig, WAY), feel).force
    bend = K_REPORT * first * at  # at the break
    size = np.abs(WAY)
    wanted = first / (1.0 - K_REPORT * first) * np.minimum(size, at - bend)
    wanted += second / (1.0 - K_REPORT * second) * np.maximum(size - at + bend, 0.0)
    wanted = np.sign(WAY) * wanted
    assert found[MIDDLE] == pytest.approx(wanted[MIDDLE], abs=2e-3 * np.ptp(wanted))


def test_friction_goes_with_the_side_of_the_motion_and_an_offset_stays() -> None:
    more = answered({"friction_N": 6.0, "offset_N": 2.0}) - answered({})
    moving = np.abs(SPEED) > 0.1 * SPEED.max()
    assert more[moving] == pytest.approx(6.0 * np.sign(SPEED[moving]) - 2.0, abs=1e-6)


def test_in_its_play_a_damper_is_not_felt() -> None:
    """By hand: after each turn the imposed end goes the whole play before the loader follows."""
    play = 0.02
    damper = {"mass_kg": 1e-3, "basic_gradient_N_per_m": 0.0, "play_m": play}
    rig = bench({**damper, "controls.column.schedule.total_gradient_N_per_m": [0.0, 0.0]})
    found = answer_to(rig, "column", on_nodes(rig, WAY), Feel(np.zeros(FRAMES))).force
    turned = np.maximum.accumulate(np.where(np.abs(np.diff(np.sign(SPEED), prepend=1)) > 1, 1, 0))
    after_top = (0.25 * 2 * np.pi / TURN < TIME) & (0.75 * 2 * np.pi / TURN > TIME)
    taken_up = SIZE - play > WAY
    free, held = after_top & ~taken_up, after_top & taken_up
    assert turned.any() and free.sum() > 5 and held.sum() > 20
    assert found[free][1:-1] == pytest.approx(0.0, abs=1e-9)
    assert found[held][1:-1] == pytest.approx(75.0 * SPEED[held][1:-1], rel=2e-3, abs=0.05)


def test_the_force_of_an_imposed_motion_is_the_force_that_made_it() -> None:
    rig = bench({"friction_N": 3.0, "friction_stiffness_N_per_m": 3e4, "breakout_N": 0.0})

    def pull(t: np.ndarray) -> np.ndarray:
        return np.asarray(25.0 * np.sin(4.0 * t) * np.minimum(t, 1.0) + 8.0 * np.sin(11.0 * t))

    fine = push(rig, pull, 4.0)  # δc at 2 kHz
    nodes = fine[: (FRAMES - 1) * rig.substeps + 1]
    found = answer_to(rig, "column", nodes, Feel(np.full(FRAMES, G))).force
    assert found[MIDDLE] == pytest.approx(pull(TIME)[MIDDLE], abs=0.8)
    assert np.std(found[MIDDLE] - pull(TIME)[MIDDLE]) < 0.2


def test_at_rest_friction_holds_any_force_up_to_its_level() -> None:
    """Two seconds of a sine, then a rest at its end: there the force lies within ±6 N of 0."""
    stop = FRAMES // 2
    way = np.concatenate((WAY[:stop], np.full(FRAMES - stop, WAY[stop])))
    rig = bench({"friction_N": 6.0, "mass_kg": 1e-3, "basic_gradient_N_per_m": 0.0})
    answer = answer_to(rig, "column", on_nodes(rig, way), Feel(np.zeros(FRAMES)))
    rest, moving = slice(stop + 20, -5), np.abs(SPEED[: stop - 5]) > 0.3 * SPEED.max()
    assert answer.least[rest] == pytest.approx(-6.0, abs=1e-6)
    assert answer.most[rest] == pytest.approx(6.0, abs=1e-6)
    least, most = answer.least[: stop - 5], answer.most[: stop - 5]
    assert moving.sum() > 150
    assert most[moving] - least[moving] == pytest.approx(0.0, abs=1e-9)
    turning = np.flatnonzero(np.diff(np.sign(SPEED[: stop - 5])))
    assert most[turning] - least[turning] == pytest.approx(12.0, abs=1e-6)


@pytest.mark.parametrize("frame_rate_Hz", [250.0, 500.0, 1000.0, 2000.0])
def test_a_motion_is_answered_at_any_number_of_steps_a_frame(frame_rate_Hz: float) -> None:
    time = np.arange(round(2.0 * frame_rate_Hz)) / frame_rate_Hz
    way = SIZE * np.sin(TURN * time)
    numbers = {"mass_kg": 4.0, "basic_gradient_N_per_m": 0.0}
    rig = bench(numbers, {**BENCH, "frame_rate_Hz": frame_rate_Hz})
    found = answer_to(rig, "column", on_nodes(rig, way), Feel(np.zeros(len(way)))).force
    wanted = -4.0 * TURN**2 * way + 75.0 * TURN * SIZE * np.cos(TURN * time)
    assert np.isfinite(found).all()
    assert found[9:-9] == pytest.approx(wanted[9:-9], abs=0.02 * np.ptp(wanted))


@pytest.mark.parametrize("stiffness", [2e3, 1e5])
def test_a_spring_before_a_damper_answers_as_maxwells_element(stiffness: float) -> None:
    """F = Re c·jω/(1 + jω·c/k)·X for a sine once it is settled; the mass is nearly none."""
    damping = 300.0
    numbers = {"mass_kg": 1e-4, "damping_N_s_per_m": damping, "basic_gradient_N_per_m": 0.0}
    rig = bench({**numbers, "play_stiffness_N_per_m": stiffness})
    found = answer_to(rig, "column", on_nodes(rig, WAY), Feel(np.zeros(FRAMES)))
    passed = damping * 1j * TURN / (1.0 + 1j * TURN * damping / stiffness)
    wanted = np.imag(passed * SIZE * np.exp(1j * TURN * TIME))
    settled = slice(200, -5)
    assert found.force[settled] == pytest.approx(wanted[settled], abs=2e-3 * np.ptp(wanted))
    assert (found.most == found.least)[settled].all()


def test_behind_a_contact_that_yields_friction_is_reached_along_its_spring() -> None:
    """By hand: after a turn F falls from +F_c to −F_c over 2·F_c/k of motion."""
    stiffness, friction_N = 2e3, 6.0
    numbers = {"mass_kg": 1e-3, "damping_N_s_per_m": 0.0, "basic_gradient_N_per_m": 0.0}
    numbers |= {"friction_N": friction_N, "play_stiffness_N_per_m": stiffness}
    rig = bench(numbers)
    found = answer_to(rig, "column", on_nodes(rig, WAY), Feel(np.zeros(FRAMES))).force
    top = 0.25 * 2.0 * np.pi / TURN
    after = (top < TIME) & (0.95 * 3.0 * top > TIME)
    wanted = np.maximum(friction_N - stiffness * (SIZE - WAY), -friction_N)
    assert found[after] == pytest.approx(wanted[after], abs=0.05 * friction_N)


def test_a_soft_stop_is_felt_under_an_imposed_motion() -> None:
    begins, stiffness = 0.02, 4000.0
    stop = {"soft_stop_m": begins, "soft_stop_stiffness_N_per_m": stiffness}
    rig = bench({f"controls.column.services.{key}": value for key, value in stop.items()})
    nodes = on_nodes(rig, WAY)
    found = answer_to(rig, "column", nodes, Feel(np.full(FRAMES, G))).force - answered({})
    wanted = stiffness * np.sign(WAY) * np.maximum(np.abs(WAY) - begins, 0.0)
    assert found[MIDDLE] == pytest.approx(wanted[MIDDLE], abs=0.02 * np.ptp(wanted))
