"""A signal that rests within its noise is held: what remembers it is not walked by that noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import Rest, rest_of, smoothed
from coupled.gap.signals import floors
from coupled.gap.signals.floors import Drive
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.rig.rig import Rig
from tests.support import gaps
from tests.support.gaps import made, nominal_rig

Floats = NDArray[np.float64]
FRAMES = 1200
t = np.arange(FRAMES) / 120.0
NOISE = Noise(0.1)


def trembling(signal: Floats, seed: int = 1, noise: Noise = NOISE) -> Floats:
    return signal + noise.sample(len(signal), np.random.default_rng(seed))


PUSH = 20.0 * np.sin(2.0 * np.pi * t) * (t > 9.0)  # without one all may be noise


@pytest.mark.parametrize("noise", [NOISE, Noise(0.1, 0.6)], ids=["white", "coloured"])
def test_a_level_is_held_at_its_mean(noise: Noise) -> None:
    signal = trembling(np.full(FRAMES, 3.0) + PUSH, noise=noise)
    rest = rest_of(signal, noise)
    inner = rest.share[60:1000]
    assert np.mean(inner == 1.0) > 0.9
    assert np.allclose(rest.level[60:1000][inner == 1.0], 3.0, atol=0.05)
    smooth = smoothed(signal)
    assert np.std(rest.held(smooth)[60:1000]) < 0.5 * np.std(smooth[60:1000])
    assert not rest.share[1100:].any()


@pytest.mark.parametrize("noise", [NOISE, Noise(0.1, 0.6)], ids=["white", "coloured"])
def test_the_error_of_a_level_is_that_of_a_mean_of_its_noise(noise: Noise) -> None:
    off = []
    for seed in range(300):
        rest = rest_of(trembling(np.full(FRAMES, 3.0) + PUSH, seed, noise), noise)
        for (start, _), error in zip(rest.ends, rest.errors, strict=True):
            off.append((rest.level[start] - 3.0) / error)
    assert len(off) > 280  # nearly each of them is seen to rest
    assert np.std(off) == pytest.approx(1.0, abs=0.15)


def test_two_levels_are_two_rests_and_the_way_between_is_none() -> None:
    way = np.interp(t, [0.0, 4.0, 4.6, 10.0], [0.0, 0.0, 5.0, 5.0])
    rest = rest_of(trembling(way), NOISE)
    assert np.all(rest.share[490:545] == 0.0)
    assert rest.level[200] == pytest.approx(0.0, abs=0.02)
    assert rest.level[900] == pytest.approx(5.0, abs=0.02)
    assert np.all((rest.share >= 0.0) & (rest.share <= 1.0))


@pytest.mark.parametrize(
    "moving",
    [2.0 * t, 0.4 * np.sin(2.0 * np.pi * 0.5 * t), 0.3 * np.sin(2.0 * np.pi * 50.0 * t)],
    ids=["a ramp", "a swing of a few times the noise", "hum"],
)
def test_what_moves_does_not_rest(moving: Floats) -> None:
    assert np.mean(rest_of(trembling(moving + PUSH), NOISE).share[:1000]) < 0.02


def test_what_creeps_within_its_noise_is_not_one_level() -> None:
    """A quarter of the noise a second: no window shows it, the parts of all of it do."""
    for creeping in (0.1, 0.0):
        rest = rest_of(trembling(creeping * t + PUSH), NOISE).share[:1000]
        assert (np.mean(rest) > 0.5) == (creeping == 0.0)


def test_nothing_rests_where_noise_is_a_large_part_of_a_signal() -> None:
    """Half of a force was taken for noise, of an oscillator that it drove: that is no rest."""
    assert not rest_of(trembling(0.3 * np.sin(t)), NOISE).share.any()
    assert not rest_of(trembling(np.zeros(FRAMES)), NOISE).share.any()


@pytest.mark.parametrize(("frames", "rms"), [(50, 0.1), (FRAMES, 0.0)], ids=["short", "no noise"])
def test_nothing_rests_in_a_short_signal_or_without_noise(frames: int, rms: float) -> None:
    rest = rest_of(np.zeros(frames), Noise(rms))
    assert not rest.share.any()
    smooth = np.arange(frames, dtype=float)
    assert np.array_equal(rest.held(smooth), smooth)


@given(st.integers(0, 10_000), st.floats(-5.0, 5.0))
def test_noise_and_level_do_not_change_where_nothing_rests(seed: int, level: float) -> None:
    rest = Rest(np.zeros(FRAMES), np.full(FRAMES, level))
    error = np.random.default_rng(seed).normal(size=FRAMES)
    assert np.array_equal(rest.held(error), error)
    assert np.array_equal(rest.beside(error), error)
    still = Rest(np.ones(FRAMES), np.full(FRAMES, level))
    assert np.all(still.held(error) == level)
    assert not still.beside(error).any()


def test_a_drive_that_rests_has_the_error_of_its_level_there() -> None:
    """Without it a healthy rig of seed 2039 (r180) stood at 1.25 floors of 1.2, and at 1.09 so."""
    drive = Drive.of(trembling(np.interp(t, [0.0, 5.0, 10.0], [0.0, 0.0, 40.0])), NOISE)
    rests = drive.rest.share == 1.0
    assert np.mean(rests[: 5 * 120]) > 0.7
    [(start, end), *_] = drive.rest.ends
    inner = slice(start + 10, end - 10)
    errors = [(drive.with_error(k) - drive.smooth)[inner] for k in range(200)]
    assert all(np.ptp(error) < 1e-12 for error in errors)
    levels = [float(error[0]) for error in errors]
    assert np.std(levels) == pytest.approx(NOISE.rms / np.sqrt(end - start), rel=0.2)
    assert np.std((drive.with_error(0) - drive.smooth)[~rests]) > 0.01
    passed = drive.passed(np.random.default_rng(1))
    assert not passed[rests].any()
    assert np.std(passed[~rests]) > 0.01
    rough = drive.unsmoothed(NOISE)
    assert rough.smooth is drive.recorded
    assert not rough.rest.share.any()
    assert np.std(rough.with_error(0) - rough.smooth) == pytest.approx(0.1, rel=0.1)


def test_a_set_point_is_what_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    steps = np.repeat([0.0, 1.0, 0.0], 400)
    drive = Drive.of(steps, Noise(0.0))
    assert drive.smooth is steps
    assert np.array_equal(drive.with_error(3), steps)


@pytest.mark.parametrize(
    ("name", "values", "stage"),
    [
        (
            "presliding_friction",
            {"friction_N": 3.0, "stiffness_N_per_{d}": 8e3, "elastic_share": 0.3},
            "loader",
        ),
        ("soft_backlash", {"play_{d}": 1e-3, "stiffness_N_per_{d}": 4e4}, "linkage"),
    ],
)
def test_a_hand_that_rests_walks_neither_a_contact_nor_a_play(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    values: dict[str, float],
    stage: str,
) -> None:
    """A healthy rig of seed 2036 (r066) stood at 1.69 by its true contact, and stands at 1.09."""
    nominal = nominal_rig(False)
    time = np.arange(round(gaps.LONG_s * 120) + 1) / 120.0
    push = 12.0 * np.maximum(np.sin(2.0 * np.pi * time / 1.5), 0.0) * (time % 8.0 < 3.0)
    monkeypatch.setattr(gaps, "pushes", lambda *_: (time, push))
    record = made(tmp_path, nominal, {name: values}, 31)
    effect = BY_NAME[name]
    real = apply(nominal, "column", [effect], {f"{name}.{key}": v for key, v in values.items()})

    def left() -> float:
        outputs = Reader(nominal, record, "column", surface_points).outputs()
        return next(
            _missed(one.measured - one.predict(real)) for one in outputs if one.stage == stage
        )

    held = left()
    nowhere = Rest(np.zeros(len(record)), np.zeros(len(record)))
    monkeypatch.setattr(floors, "rest_of", lambda *_: nowhere)
    assert held < 0.9 * left()


def _missed(residual: Floats) -> float:
    return float(np.sqrt(np.mean(residual**2)))


def test_the_noise_of_what_drives_a_linkage_is_that_of_its_channel(tmp_path: Path) -> None:
    rig: Rig = nominal_rig(False)
    reader = Reader(rig, made(tmp_path, rig, {}, 31), "column", surface_points)
    assert reader.pulled().noise == reader.driving("force")
    assert reader.commanded().noise == reader.driving("computed")
