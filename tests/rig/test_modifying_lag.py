"""F_mod through a first-order lag: closed forms, the order of the steps, and none at zero."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from coupled.rig.hosted import Feel
from coupled.rig.packing import pack
from coupled.rig.replay import drive_loader
from coupled.rig.rig import Rig
from tests.support.rigs import bench

Floats = NDArray[np.float64]
M, C, G_B, G_T = 4.0, 75.0, 560.0, 2189.0
STEP_N, LAG_s = 30.0, 0.05
# Rigid: ΔG = G_T − G_B, without the host's correction for bend.
RIGID = {"bend_m_per_N": 0.0, "controls.column.compensation.gradient": False}


def stepped(rig: Rig, seconds: float = 1.0) -> tuple[Floats, Floats]:
    """Return δc and F_mod at the frames after a step of force, G_T held."""
    frames = round(seconds * rig.frame_rate)
    nodes = np.full((frames - 1) * rig.substeps + 1, STEP_N)
    flat = np.full(frames, G_T)
    return drive_loader(rig, "column", nodes, Feel(flat), np.zeros(frames))


def exact(times_s: Floats) -> Floats:
    """Return δc by the matrix exponential of m·x'' + c·x' + G_B·x + y = F, τ·y' = ΔG·x − y."""
    motion = [-G_B / M, -C / M, -1.0 / M]
    a = np.array([[0.0, 1.0, 0.0], motion, [(G_T - G_B) / LAG_s, 0.0, -1.0 / LAG_s]])
    rest = np.linalg.solve(a, np.array([0.0, -STEP_N / M, 0.0]))
    return np.array([(rest - expm(a * t) @ rest)[0] for t in times_s])


@pytest.mark.parametrize("loader_rate_Hz", [2000.0, 4000.0])
def test_the_step_response_is_that_of_the_linear_equations(loader_rate_Hz: float) -> None:
    rig = bench({**RIGID, "modifying_lag_s": LAG_s}).changed({"loader_rate_Hz": loader_rate_Hz})
    computed, product = stepped(rig)
    times_s = np.arange(len(computed)) / rig.frame_rate
    off = np.max(np.abs(computed - exact(times_s))) / np.max(np.abs(computed))
    assert off < 1.5e-5 * (2000.0 / loader_rate_Hz) ** 2  # second order
    # The record holds it as commanded.
    assert product == pytest.approx((G_T - G_B) * computed, rel=1e-12)


def test_at_rest_a_lag_changes_nothing() -> None:
    computed, _ = stepped(bench({**RIGID, "modifying_lag_s": LAG_s}), 6.0)
    assert computed[-1] == pytest.approx(STEP_N / G_T, rel=1e-6)


def test_a_held_product_reaches_the_loader_exponentially() -> None:
    """A digital F_mod steps once: what the loader lacks of it fades as e^(−t/τ)."""
    digital = {**RIGID, "multiplier": "digital", "damping_N_s_per_m": 0.0, "mass_kg": 1e6}
    rig = bench({**digital, "modifying_lag_s": LAG_s})
    # So heavy that δc stays: the host misreads δc by a constant, and F_mod is a step of force.
    frames, read = round(0.4 * rig.frame_rate), 0.01
    still = np.zeros((frames - 1) * rig.substeps + 1)
    flat = np.full(frames, G_T)
    moved, product = drive_loader(rig, "column", still, Feel(flat), np.full(frames, read))
    assert product == pytest.approx((G_T - G_B) * read, rel=1e-4)
    t = np.arange(frames) / rig.frame_rate
    twice = 0.5 * t**2 - LAG_s * t + LAG_s**2 * (1.0 - np.exp(-t / LAG_s))  # ∬(1 − e^(−t/τ))
    wanted = -(G_T - G_B) * read / 1e6 * twice
    np.testing.assert_allclose(moved, wanted, rtol=2e-4, atol=1e-5 * abs(wanted[-1]))


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_without_a_lag_the_loader_steps_as_it_did(multiplier: str) -> None:
    plain = bench({"breakout_N": 3.0, "friction_N": 1.0, "multiplier": multiplier})
    packed = pack(plain)[0]["parameters"]["loader"]
    assert packed["lag_gain"] == 0.0
    assert bool(packed["held"]) is (multiplier == "digital")
    # One that is far shorter than a substep holds F_mod for as long as that, and no longer.
    least = stepped(plain.changed({"controls.column.loader.modifying_lag_s": 1e-6}))[0]
    np.testing.assert_allclose(least, stepped(plain)[0], atol=4e-3 * STEP_N / G_T)
