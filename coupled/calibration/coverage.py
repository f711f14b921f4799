"""How often the intervals hold what they should: many benches, each fitted, against the truth."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.belief import Scales, real_scales
from coupled.calibration.bench import Bench, take_readings
from coupled.calibration.calibrate import Result, calibrate
from coupled.calibration.outcome import deflection_off, felt_off
from coupled.rig.parameters import Control

Progress = Callable[[str, int, int], None]
FIGURES = ("K", "S1", "S3", "S2")
NEAR = 0.05
_BLOCK = 25


@dataclass(frozen=True)
class Coverage:
    """Shares of benches, without unit.

    `covered` of each figure's 95 % interval, `within` of K within 5 %; `bias` and `spread` of
    K over its true value, errors in variables and ordinary; `accused` of benches in which a
    good reading was taken for a mistyped one; `deflection` and `felt` of benches after which a
    compensated rig's δ̂ is within 0.5 % and its felt gradient within 1 %, at the least, middle
    and greatest gradient (`circle`: both).
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
    deflection: float
    felt: float
    circle: float

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
    held, k, plain = table[:, : len(FIGURES)], table[:, -6], table[:, -5]
    deflection, felt = (np.abs(table[:, -2]) <= 0.005, np.abs(table[:, -1]) <= 0.01)
    return Coverage(
        benches,
        dict(zip(FIGURES, _means(held), strict=True)),
        float(np.mean(np.abs(k) <= NEAR)),
        float(np.mean(k)),
        float(np.std(k)),
        float(np.mean(table[:, -4])),
        float(np.mean(plain)),
        float(np.std(plain)),
        float(np.mean(table[:, -3])),
        float(np.mean(deflection)),
        float(np.mean(felt)),
        float(np.mean(deflection & felt)),
    )


def _means(held: NDArray[np.float64]) -> list[float]:
    """Return the mean of each column, NaN for one that was never found."""
    return [float(np.mean(c[~np.isnan(c)])) if np.any(~np.isnan(c)) else np.nan for c in held.T]


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
    errors += [float(plain.low <= bend <= plain.high), float(bool(found.suspects))]
    return [*held, *errors, *_circle(found, data)]


def _circle(found: Result, data: Control) -> tuple[float, float]:
    """Return how far δ̂ and the felt gradient are off, as shares, where most so."""
    true, bend = real_scales(data), data.loader.bend
    k, s2 = found.line.bend.value, found.s2_chosen
    believed = Scales(found.line.s1.value, true.s2 if s2 is None else s2.value, found.s3.value)
    table = data.schedule.total_gradient
    pairs = []
    for g in np.linspace(min(table), max(table), 3):
        off = deflection_off(believed, k, true, bend, float(g))
        basic = data.loader.basic_gradient
        pairs.append((off, felt_off(believed.s2 / true.s2, k, bend, (float(g), basic))))
    deflection, felt = np.max(np.abs(pairs), axis=0)
    return float(deflection), float(felt)
