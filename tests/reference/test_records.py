"""Records reproduced stage by stage, each stage driven by its measured input.

Two were made by the twin (make_records.py); three by another program from the same
description (they lie beside the project, where it was founded); one is flown here, with
noise. What a stage leaves must be the channel's noise and no more: at most
1.1 times it, where the noise of a channel is that of its own fourth differences, and the
noise of a stage's input is carried through the stage.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.loop import fly
from coupled.flight.runfile import read_run
from coupled.record.record import Record
from coupled.rig.hosted import Feel
from coupled.rig.nodes import on_nodes
from coupled.rig.replay import (
    drive_loader,
    replay_compensation,
    replay_linkage,
    replay_schedule,
    replay_surface,
)
from coupled.rig.rig import Rig
from tests.support.make_records import make, rigs
from tests.support.records import NOISE, OWN, available, reference

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    rig: Rig
    record: Record

    def __getitem__(self, channel: str) -> Floats:
        return self.record[channel]


@pytest.fixture(scope="module", params=available())
def case(request: pytest.FixtureRequest) -> Case:
    name = request.param
    if name != OWN:
        return Case(*reference(name))
    [scenario] = read_run("sweep")
    noisy = scenario.rig.changed({"noise": NOISE})
    return Case(noisy, fly(replace(scenario, rig=noisy)))


def white(signal: Floats) -> float:
    """Return the white noise in a smooth signal: fourth differences, gain √70."""
    return float(np.sqrt(np.mean(np.diff(signal, 4) ** 2) / 70.0))


def rms(signal: Floats) -> float:
    return float(np.sqrt(np.mean(signal**2)))


def carried(stage: Callable[[Floats], Floats], signal: Floats, level: float) -> float:
    """Return how much of a noise of `level` on its input a stage passes on, by ten tries."""
    rng = np.random.default_rng(20)
    base = stage(signal)
    tries = [stage(signal + rng.normal(0.0, level, len(signal))) - base for _ in range(10)]
    return float(np.sqrt(np.mean(np.square(tries))))


def test_the_schedule_reproduces_the_record_to_its_noise(case: Case) -> None:
    q = case["dynamic_pressure_Pa"]

    def stage(pressure: Floats) -> Floats:
        return replay_schedule(case.rig, "column", pressure)

    left = rms(case["column_gradient_N_per_m"] - stage(q))
    assert left <= 1.1 * carried(stage, q, NOISE["dynamic_pressure_Pa"]) + 1e-3


def test_the_loader_reproduces_the_record_to_its_noise(case: Case) -> None:
    force, computed = case["column_force_N"], case["column_computed_m"]
    gradient, none = case["column_gradient_N_per_m"], np.zeros_like(computed)

    def stage(f: Floats) -> Floats:
        return drive_loader(case.rig, "column", on_nodes(case.rig, f), Feel(gradient), none)[0]

    floor = np.hypot(white(computed), carried(stage, force, white(force)))
    assert rms(computed - stage(force)) <= 1.1 * floor


def test_the_modifying_force_reproduces_the_record_to_its_noise(case: Case) -> None:
    computed, product = case["column_computed_m"], case["column_modifying_force_N"]
    gradient = case["column_gradient_N_per_m"]
    host = case.rig.controls["column"].compensation
    bend = host.bend if host.gradient else 0.0
    added = gradient / (1.0 - bend * gradient)
    added -= case.rig.controls["column"].loader.basic_gradient
    floor = np.hypot(white(product), rms(added) * white(computed))
    assert rms(product - added * computed) <= 1.1 * floor


def test_the_linkage_reproduces_the_record_to_its_noise(case: Case) -> None:
    computed, force = case["column_computed_m"], case["column_force_N"]

    def stage(c: Floats) -> Floats:
        return replay_linkage(case.rig, "column", c, force)

    bend = case.rig.controls["column"].loader.bend
    noise = np.hypot(white(case["column_deflection_m"]), bend * white(force))
    floor = np.hypot(noise, carried(stage, computed, white(computed)))
    assert rms(case["column_deflection_m"] - stage(computed)) <= 1.1 * floor


def test_the_compensation_reproduces_the_record_exactly(case: Case) -> None:
    left = case["column_estimate_m"] - replay_compensation(
        case.rig, "column", case["column_computed_m"], case["column_force_N"]
    )
    assert np.max(np.abs(left)) < 2e-7  # the records' last digit


def test_surface_and_airframe_reproduce_the_record_to_its_noise(case: Case) -> None:
    """The aircraft flown by the record's own δ̂: nothing is left but white noise."""
    if case.rig.flight is None:
        assert "elevator_rad" not in case.record
        return
    frame_s = 1.0 / case.rig.frame_rate
    commands = replay_surface(
        case.rig, "column", case["column_estimate_m"], case["dynamic_pressure_Pa"]
    )
    airframe = JSBSimAirframe(case.rig.flight, frame_s, ["column"])
    flown = []
    for command in commands:
        flown.append(airframe.motion())
        airframe.step((command, 0.0, 0.0))
    motion = np.array(flown)
    names = ["dynamic_pressure_Pa", "load_factor", "elevator_rad", "pitch_rate_rad_per_s"]
    names += ["alpha_rad", "pitch_rad", "true_airspeed_m_per_s", "altitude_m"]
    for i, name in enumerate(names):
        left = case[name] - motion[:, i]
        assert rms(left) <= 1.1 * white(left), name
        assert rms(left) == pytest.approx(NOISE[name], rel=0.1), name


@pytest.mark.slow
def test_the_twin_makes_the_kept_records_again() -> None:
    """The twin of today makes the record that is kept."""
    _, level_N = rigs()["twin-bench"]
    rig, kept = reference("twin-bench")
    again = make(rig, level_N, 1)
    assert again.channels == kept.channels
    assert again["column_computed_m"] == pytest.approx(kept["column_computed_m"], abs=1.01e-7)
    assert np.max(np.abs(again.data - kept.data)) < 1.01e-2  # a last digit, that of q̄
