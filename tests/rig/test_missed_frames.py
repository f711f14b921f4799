"""A host that misses frames: how many, and what it holds over them, flown and replayed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.rig.compensation import SEED, misses
from coupled.rig.hosted import NO_INPUTS, Feel, Hosted, held_over
from coupled.rig.packing import pack
from coupled.rig.replay import (
    drive_loader,
    replay_compensation,
    replay_product,
    replay_schedule,
)
from coupled.rig.rig import Rig
from coupled.rig.standalone import History, nodes_of, run_control
from tests.support.rigs import bench

FRAMES = 4000
SHARE = 0.2
HOST = "controls.column.compensation"


def rig_with(share: float, **changes: Any) -> Rig:
    return bench({f"{HOST}.missed_share": share, **changes})


def run(rig: Rig) -> tuple[History, np.ndarray[Any, np.dtype[np.float64]]]:
    """Return a rig's history under a swinging force and q̄, and that q̄."""
    nodes = 60.0 * np.sin(9.0 * nodes_of(rig, FRAMES))
    pressure = 1500.0 + 700.0 * np.sin(np.arange(FRAMES) / rig.frame_rate)
    return run_control(rig, "column", nodes, pressure), pressure


def test_so_many_frames_are_missed_each_by_chance() -> None:
    found, _ = run(rig_with(SHARE))
    held = np.diff(found.estimate) == 0.0
    three_sigma = 3.0 * np.sqrt(SHARE * (1.0 - SHARE) / FRAMES)
    assert np.mean(held) == pytest.approx(SHARE, abs=three_sigma)
    np.testing.assert_array_equal(held, np.diff(found.gradient) == 0.0)
    # Geometric runs: after a missed frame the next is missed as often as any.
    assert np.mean(held[1:][held[:-1]]) == pytest.approx(SHARE, abs=0.05)


def test_the_numbers_are_those_of_park_and_miller() -> None:
    """From 1 the ten-thousandth is 399268537, as ISO C++ prints it for `minstd_rand`."""
    control = pack(rig_with(SHARE))[0]
    state = control["state"]["compensation"]
    state["drawn"] = 1
    for _ in range(10_000):
        misses(control["parameters"]["compensation"], state)
    assert state["drawn"] == 399268537


def test_a_frame_is_missed_where_the_next_number_is_under_the_share() -> None:
    found, _ = run(rig_with(SHARE))
    number, missed = SEED * 48271 % (2**31 - 1), [False]  # of the first frame, never missed
    for _ in range(FRAMES - 1):
        number = number * 48271 % (2**31 - 1)
        missed.append(number < SHARE * (2**31 - 1))
    np.testing.assert_array_equal(np.diff(found.estimate) == 0.0, missed[1:])


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_a_missed_frame_holds_what_the_host_puts_out(multiplier: str) -> None:
    rig = rig_with(SHARE, multiplier=multiplier)
    found, pressure = run(rig)
    missed = np.concatenate(([False], np.diff(found.estimate) == 0.0))
    bend = rig.controls["column"].compensation.bend
    fresh = found.computed + bend * found.force
    np.testing.assert_allclose(found.estimate, held_over(fresh, missed), rtol=0, atol=1e-15)
    made = replay_schedule(rig, "column", pressure, missed=missed)
    np.testing.assert_allclose(found.gradient, made, rtol=1e-12)
    again = replay_compensation(rig, "column", found.computed, found.force, None, missed)
    np.testing.assert_allclose(found.estimate, again, rtol=0, atol=1e-15)
    product = replay_product(rig, "column", found.computed, Feel(found.gradient), missed)
    np.testing.assert_allclose(found.modifying, product, rtol=0, atol=1e-9)
    nodes = 60.0 * np.sin(9.0 * nodes_of(rig, FRAMES))
    still = np.zeros(FRAMES)
    driven = (nodes, Feel(found.gradient), still, NO_INPUTS, None, Hosted(missed=missed))
    moved, _ = drive_loader(rig, "column", *driven)
    np.testing.assert_allclose(moved, found.computed, rtol=0, atol=1e-12)


def test_a_lag_of_the_pressure_waits_while_frames_are_missed() -> None:
    rig = rig_with(0.0, **{"controls.column.schedule.pressure_lag_s": 0.3})
    lagging = rig.changed({f"{HOST}.missed_share": SHARE})
    found, pressure = run(lagging)
    missed = np.concatenate(([False], np.diff(found.estimate) == 0.0))
    made = replay_schedule(lagging, "column", pressure, missed=missed)
    np.testing.assert_allclose(found.gradient, made, rtol=1e-12)


def test_a_host_that_misses_none_is_as_it_was() -> None:
    plain, _ = run(bench())
    same, _ = run(rig_with(0.0))
    for name in ("estimate", "gradient", "modifying", "computed"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(same, name))
