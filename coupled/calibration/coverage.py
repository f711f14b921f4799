"""How often the intervals hold what they should: many benches, each fitted, against the truth."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupled.calibration.belief import real_scales
from coupled.calibration.bench import Bench, take_readings
from coupled.calibration.calibrate import calibrate

Progress = Callable[[str, int, int], None]
FIGURES = ("K", "S1", "S3", "S2")
NEAR = 0.05
_BLOCK = 25


@dataclass(frozen=True)
class Coverage:
    """Shares of benches, without unit.

    `covered` of each figure's 95 % interval, `within` of K within 5 %; `bias` and `spread` of
    K over its true value, errors in variables and ordinary; `accused` of benches in which a
    good reading was taken for a mistyped one.
    """

    benches: int
    covered: dict[str, float]
    within: float
    bias: float
    spread: float
    ordinary_covered: float
    ordinary_bias: float
    ordinary_spread: float
    accused: float

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON takes it."""
        return dict(self.__dict__)


def measure_coverage(
    bench: Bench, benches: int, seed: int = 0, workers: int = 1, progress: Progress | None = None
) -> Coverage:
    """Return how often intervals from benches with seeds `seed` and on hold the truth."""
    blocks = [
        (bench, range(first, min(first + _BLOCK, seed + benches)))
        for first in range(seed, seed + benches, _BLOCK)
    ]
    rows: list[list[float]] = []
    for block in _done(blocks, workers):
        rows += block
        if progress is not None:
            progress("benches", len(rows), benches)
    table = np.array(rows)
    held, k, plain = table[:, : len(FIGURES)], table[:, -4], table[:, -3]
    return Coverage(
        benches,
        dict(zip(FIGURES, np.nanmean(held, axis=0).tolist(), strict=True)),
        float(np.mean(np.abs(k) <= NEAR)),
        float(np.mean(k)),
        float(np.std(k)),
        float(np.mean(table[:, -2])),
        float(np.mean(plain)),
        float(np.std(plain)),
        float(np.mean(table[:, -1])),
    )


def _done(blocks: list[tuple[Bench, range]], workers: int) -> Iterator[list[list[float]]]:
    if workers <= 1:
        yield from map(_block, blocks)
        return
    own = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=own) as pool:
        yield from pool.map(_block, blocks)


def _block(block: tuple[Bench, range]) -> list[list[float]]:
    bench, seeds = block
    return [_one(bench, seed) for seed in seeds]


def _one(bench: Bench, seed: int) -> list[float]:
    """Return whether each figure was covered, K's relative errors, and false accusations."""
    data = bench.rig.controls[bench.control]
    readings = take_readings(bench, seed)
    found = calibrate(readings, data, bench.control, bench.instruments, f"bench {seed}")
    scales, bend = real_scales(data), data.loader.bend
    pairs = [(found.line.bend, bend), (found.line.s1, scales.s1), (found.s3, scales.s3)]
    held = [float(e.low <= true <= e.high) for e, true in pairs]
    s2 = found.s2_chosen
    held.append(float("nan") if s2 is None else float(s2.low <= scales.s2 <= s2.high))
    plain = found.plain.bend
    errors = [found.line.bend.value / bend - 1.0, plain.value / bend - 1.0]
    return [*held, *errors, float(plain.low <= bend <= plain.high), float(bool(found.suspects))]
