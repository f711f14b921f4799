"""The log evidence of a set: a closed form, and what it prefers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained, log_prior, misfit
from coupled.gap.search.problem import ModelError, Problem
from coupled.gap.signals.output import Output, lasting
from coupled.gap.thresholds import PRIOR_SPAN
from coupled.rig.rig import Rig
from tests.support.rigs import bench

FRAMES, RATE_Hz = 6000, 100.0
BEND = BY_NAME["bend"]
KEY = "bend.bend_{d}_per_N"
FORCE_N = 40.0 * np.sin(np.arange(FRAMES) * 0.037)
NO_ERROR = ModelError(np.zeros(1), np.ones(1))


def problem(bend_m_per_N: float, noise_m: float = 1e-4, seed: int = 0) -> Problem:
    """Return what is judged of a structure that bends so much, on white noise: δ − δc = K·F."""
    noise = noise_m * np.random.default_rng(seed).standard_normal(FRAMES)
    measured = bend_m_per_N * FORCE_N + noise

    def predict(rig: Rig) -> Any:
        return rig.controls["column"].loader.bend * FORCE_N

    output = Output("linkage", "column_deflection_m", measured, predict, noise_m, RATE_Hz)
    return Problem(Case(bench({"bend_m_per_N": 1e-4}), "column", [output]))


def test_the_misfit_takes_noise_as_known_from_below_and_estimates_it_from_above() -> None:
    square = np.array([0.5, 1.0, math.e])
    assert misfit(square) == pytest.approx([-0.5, 0.0, 1.0])


def test_residuals_below_a_smooth_model_error_differ_by_the_samples_of_the_gap() -> None:
    """L = −½·N·(q − 1)/τ_o with τ_o = (τ_n + e·τ_g)/(1 + e); above it noise's samples count."""
    e, frames, noise, gap = 9.0, 6000.0, 1.0, 200.0  # floors², frames
    error = ModelError(np.array([e]), np.array([frames / gap]))
    samples = np.array([frames / noise])
    both = (noise + e * gap) / (1.0 + e)

    def log(square: float) -> float:
        return Evidence(np.array([square]), samples, 0.0, error).log(samples)

    assert log(0.1) - log(0.4) == pytest.approx(0.5 * frames / both * 0.3)
    assert log(2.0) - log(3.0) == pytest.approx(0.5 * frames / noise * math.log(1.5))
    white = ModelError(np.array([e]), samples)
    assert white.smooth(samples) == pytest.approx([1.0])


def test_laplaces_term_of_a_linear_number_is_its_closed_form() -> None:
    """−½·ln(1 + s²·ΣF²/σ²), s = (K − K₀)·Λ/√(2π): white noise has one sample a frame."""
    one = problem(2e-4)
    fitted = one.fit((BEND,))
    rest = evidence(one, fitted, NO_ERROR).rest - log_prior(BEND)
    width = (fitted.values[KEY] - 1e-4) * PRIOR_SPAN / math.sqrt(2.0 * math.pi)
    information = float(FORCE_N @ FORCE_N) / 1e-4**2
    assert rest == pytest.approx(-0.5 * math.log(1.0 + width**2 * information), abs=0.1)


@pytest.mark.parametrize("seed", range(5))
def test_a_bend_is_preferred_where_it_is_there_and_only_there(seed: int) -> None:
    for bend, there in ((1e-4, False), (1.005e-4, False), (1.3e-4, True)):
        one = problem(bend, 1e-3, seed)
        pair = [evidence(one, one.fit(effects), NO_ERROR) for effects in ((), (BEND,))]
        counts = fewest_unexplained(pair)
        assert (pair[1].log(counts) > pair[0].log(counts)) == there


def test_the_evidence_is_the_same_in_any_unit() -> None:
    """Newtons or tens of newtons, metres or millimetres: the gain of a set does not change."""
    gains = []
    for scale in (1.0, 1e3):
        one = problem(1.5e-4 / scale, 1e-4 / scale)
        case = Case(bench({"bend_m_per_N": 1e-4 / scale}), "column", one.case.outputs)
        scaled = Problem(case)
        pair = [evidence(scaled, scaled.fit(effects), NO_ERROR) for effects in ((), (BEND,))]
        counts = fewest_unexplained(pair)
        gains.append(pair[1].log(counts) - pair[0].log(counts))
    assert gains[1] == pytest.approx(gains[0], abs=0.5)


def test_samples_are_counted_by_the_set_that_leaves_least_of_each_output() -> None:
    first = Evidence(np.array([4.0, 1.0]), np.array([10.0, 500.0]), 0.0, NO_ERROR)
    second = Evidence(np.array([1.0, 9.0]), np.array([400.0, 20.0]), 0.0, NO_ERROR)
    assert fewest_unexplained([first, second]) == pytest.approx([400.0, 500.0])


def test_a_slow_part_of_the_noise_counts_even_where_a_set_took_it_off() -> None:
    """The autocorrelation time of a mixture is the mean of its parts' times by their power."""
    kept, power, rng = 0.98, 0.06, np.random.default_rng(4)
    shocks = np.sqrt(power * (1.0 - kept**2)) * rng.standard_normal((3, FRAMES))
    slow = [lfilter([1.0], [1.0, -kept], one) for one in shocks]
    (plain,) = problem(0.0).outputs
    white = rng.standard_normal(FRAMES)
    assert plain.samples(white) > 0.9 * FRAMES
    known = replace(plain, lasts=lasting(slow, 1.0))
    wanted = FRAMES / (1.0 + power * ((1.0 + kept) / (1.0 - kept) - 1.0))
    assert known.samples(white) == pytest.approx(wanted, rel=0.25)
    longer = lfilter([1.0], [1.0, -0.999], white)
    assert known.samples(longer) == plain.samples(longer)


def test_a_fit_of_the_same_set_begins_at_the_given_start() -> None:
    """Not where its parent ended, which may be a local minimum that short replays lead out of."""
    one = problem(2e-4)
    parent = one.fit((BEND,))
    begun = one.fit((BEND,), {**parent.values, KEY: 5e-4}, parent, Descent("coarse", 1))
    assert begun.values[KEY] == pytest.approx(5e-4)


def test_a_residual_below_the_error_of_a_healthy_model_is_no_evidence() -> None:
    """The floor is then the model's misfit: a smaller residual is as well explained."""
    half = problem(1e-4, 1e-4)
    loud = [replace(output, floor=2.0 * output.floor) for output in half.case.outputs]
    for model_error_in_floors, square in ((False, 0.25), (True, 1.0)):
        one = Problem(replace(half.case, outputs=loud, model_error_in_floors=model_error_in_floors))
        found = evidence(one, one.fit(()), NO_ERROR)
        assert found.squares == pytest.approx([square], rel=0.1)


@pytest.mark.parametrize(("channel", "alike"), [("column_deflection_m", True), ("other", False)])
def test_records_of_one_channel_weigh_alike(channel: str, alike: bool) -> None:
    """Noise and misfit are of one machine; another channel weighs by its own misfit."""
    one, two = (problem(bend).case.outputs[0] for bend in (1.2e-4, 3e-4))
    outputs = [one, replace(two, channel=channel, record=1)]
    fitted = Problem(Case(bench({"bend_m_per_N": 1e-4}), "column", outputs)).fit((BEND,))
    assert (fitted.values[KEY] == pytest.approx(2.1e-4, rel=3e-3)) == alike
