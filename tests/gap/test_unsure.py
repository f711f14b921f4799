"""What is not known of the colour of a force's noise: how wide a gap it may make, and no wider."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.noise.noise import Noise, noise_of_input
from coupled.record.record import Record
from tests.support import gaps, records

FORCE = "column_force_N"
FRAMES = 2700  # 22 s: a colour is not well known by so few


def force(rng: np.random.Generator) -> np.ndarray:
    """Return a pilot's force that moves to another level every 1.7 s, N."""
    time = np.arange(FRAMES) / 120.0
    starts = np.arange(1.0, FRAMES / 120.0 - 1.5, 1.7)
    rises = np.clip((time[:, None] - starts) / 0.25, 0.0, 1.0)
    return np.asarray((0.5 * (1.0 - np.cos(np.pi * rises))) @ rng.uniform(-40.0, 40.0, len(starts)))


@cache
def estimated_power(memory: float) -> list[tuple[float, float]]:
    """Return of 40 samples the estimated power at low frequencies, over the true, and how
    much more there may be."""
    true, found = Noise(0.15, memory), []
    for seed in range(40):
        rng = np.random.default_rng([8, seed])
        noise = noise_of_input(force(rng) + true.sample(FRAMES, rng))
        assert noise is not None
        found.append((slow(noise) / slow(true), noise.unsure))
    return found


def slow(noise: Noise) -> float:
    """Return the power of a noise at low frequencies, by which a loader is shaken."""
    return noise.rms**2 * (1.0 + noise.memory) / (1.0 - noise.memory)


@pytest.mark.parametrize("memory", [0.0, 0.25, 0.4, 0.6])
def test_the_true_power_is_within_what_may_be(memory: float) -> None:
    assert min(share * (1.0 + unsure) for share, unsure in estimated_power(memory)) > 0.85
    if memory:
        assert min(share for share, _ in estimated_power(memory)) < 0.8  # the estimate alone


def test_of_white_noise_little_is_unsure() -> None:
    assert np.median([unsure for _, unsure in estimated_power(0.0)]) < 0.05


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Record]:
    """Return records without noise of the force: of a healthy bench, and of one that rubs."""
    each: dict[str, dict[str, dict[str, float]]] = {
        "healthy": {},
        "rubs": {"coulomb_friction": {"friction_N": 3.0}},
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(records.NOISE, FORCE, 0.0)
        patch.setattr(gaps, "LONG_s", FRAMES / 120.0)
        nominal = gaps.nominal_rig(False)
        return {
            name: gaps.made(Path(tmp_path_factory.mktemp(name)), nominal, values, 21)
            for name, values in each.items()
        }


def noisy(record: Record, seed: int) -> Record:
    """Return a record whose force has noise with a corner at 10 Hz."""
    data = record.data.copy()
    sample = Noise(0.3, 0.6).sample(len(data), np.random.default_rng([9, seed]))
    data[:, record.channels.index(FORCE)] += sample
    return replace(record, data=data)


@pytest.mark.parametrize("seed", [1, 8, 9])
def test_a_colour_estimated_too_low_is_no_gap(plain: dict[str, Record], seed: int) -> None:
    found = diagnose(gaps.nominal_rig(False), {"r": noisy(plain["healthy"], seed)})
    loader = found.as_dict()["stages"]["loader"]
    assert found.verdict == "no_gap"
    assert 1.3 < loader["settled"] < loader["limit"]


@pytest.mark.slow
def test_once_there_is_a_gap_what_is_left_of_it_is_held_to_noise(plain: dict[str, Record]) -> None:
    found = diagnose(gaps.nominal_rig(False), {"r": noisy(plain["rubs"], 8)})
    loader = found.as_dict()["stages"]["loader"]
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    assert loader["settled"] > 2.0
    assert loader["limit"] < 1.35
