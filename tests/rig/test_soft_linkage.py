"""A play whose contact yields, and a structure with mass: closed forms, and none at neutral."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.rig.linkage import CONTACT_s
from coupled.rig.packing import pack
from coupled.rig.replay import drive_linkage
from coupled.rig.rig import Rig
from coupled.rig.standalone import run_control
from tests.support.rigs import K_REPORT, bench

Floats = NDArray[np.float64]
RATE_Hz = 1000.0
PLAY_m, CONTACT, PULL_N = 2e-3, 5e4, 20.0
SOFT = {"play_m": PLAY_m, "play_stiffness_N_per_m": CONTACT, "bend_m_per_N": 0.0}
FREQUENCY_Hz, ZETA = 9.0, 0.06
MODE = {"bend_frequency_Hz": FREQUENCY_Hz, "bend_damping_ratio": ZETA}


def gripped(rig: Rig, force: Floats) -> Floats:
    """Return δ at 1 kHz under a force at the grip, the servo holding still at neutral."""
    fine = rig.changed({"frame_rate_Hz": RATE_Hz})
    return drive_linkage(fine, "column", np.zeros((len(force) - 1) * fine.substeps + 1), force)


def test_the_grip_passes_its_play_against_the_damper_and_rests_on_the_contact() -> None:
    """From neutral it goes at F/(k·τ), to the end of its half; then to play/2 + F/k within τ."""
    delta = gripped(bench(SOFT), np.full(400, PULL_N))
    t = np.arange(400) / RATE_Hz
    met = 0.5 * PLAY_m * CONTACT * CONTACT_s / PULL_N
    inside = t < met
    assert np.count_nonzero(inside) > 4
    np.testing.assert_allclose(delta[inside], PULL_N / (CONTACT * CONTACT_s) * t[inside], rtol=1e-9)
    beyond = t > met + 1.0 / RATE_Hz
    wanted = 0.5 * PLAY_m + PULL_N / CONTACT * (1.0 - np.exp(-(t[beyond] - met) / CONTACT_s))
    np.testing.assert_allclose(delta[beyond], wanted, atol=0.1 * PULL_N / CONTACT)
    for side in (1.0, -1.0):
        rests = gripped(bench(SOFT), np.full(400, side * PULL_N))[-1]
        assert rests == pytest.approx(side * (0.5 * PLAY_m + PULL_N / CONTACT), rel=1e-9)


def test_in_its_play_without_a_force_the_grip_stays() -> None:
    force = np.where(np.arange(600) < 5, PULL_N, 0.0)
    delta = gripped(bench(SOFT), force)
    assert 0.0 < delta[10] < 0.5 * PLAY_m
    assert delta[-1] == delta[10]


def test_a_structure_with_mass_swings_as_a_damped_oscillator() -> None:
    force = np.concatenate((np.zeros(2), np.full(998, PULL_N)))
    delta = gripped(bench(MODE), force)
    t = np.maximum((np.arange(1000) - 1.5) / RATE_Hz, 0.0)  # the force rises within a frame
    omega = 2.0 * np.pi * FREQUENCY_Hz
    damped = omega * np.sqrt(1.0 - ZETA**2)
    swing = np.cos(damped * t) + ZETA * omega / damped * np.sin(damped * t)
    wanted = K_REPORT * PULL_N * (1.0 - np.exp(-ZETA * omega * t) * swing)
    assert np.max(np.abs(delta - wanted)) < 2e-3 * K_REPORT * PULL_N
    assert delta.max() > 1.7 * K_REPORT * PULL_N


def test_what_swings_follows_the_hysteresis_of_the_bend() -> None:
    """Slow beside its own period a structure with mass bends as one without."""
    lossy = {"bend_hysteresis_share": 0.4, "bend_hysteresis_width_N": 10.0}
    force = 30.0 * np.sin(2.0 * np.pi * np.arange(4000) / 4000.0)
    still = gripped(bench(lossy), force)
    heavy = gripped(bench({**lossy, "bend_frequency_Hz": 80.0, "bend_damping_ratio": 0.7}), force)
    np.testing.assert_allclose(heavy, still, atol=0.02 * K_REPORT * 30.0)
    assert np.ptp(still - K_REPORT * force) > 0.1 * K_REPORT * 30.0


def test_a_flight_and_a_replay_of_it_are_one() -> None:
    rig = bench({**SOFT, **MODE, "bend_m_per_N": K_REPORT}).changed({"frame_rate_Hz": 200.0})
    frames = 600
    nodes_s = np.arange(frames * rig.substeps + 1) / (200.0 * rig.substeps)
    pull = 25.0 * np.sin(2.0 * np.pi * 0.7 * nodes_s)
    flown = run_control(rig, "column", pull, np.full(frames, 2000.0))
    again = drive_linkage(
        rig,
        "column",
        np.interp(nodes_s[: (frames - 1) * rig.substeps + 1], flown.time_s, flown.computed),
        flown.force,
    )
    off = np.abs(again - flown.deflection)
    assert np.max(off) < 0.02 * np.ptp(flown.deflection)


def test_neutral_values_carry_nothing() -> None:
    assert pack(bench())[0]["parameters"]["linkage"]["carries"] == 0
    assert pack(bench({"bend_damping_ratio": 0.5}))[0]["parameters"]["linkage"]["carries"] == 0
