"""The coverage of the intervals: many simulated benches, each compared with the truth."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from coupled.calibration.accuracy import (
    DEFLECTION_WITHIN,
    FELT_WITHIN,
    actual_over_ordered,
    deflection_off,
    felt_off,
)
from coupled.calibration.assumedscales import Scales, real_scales
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.result import CalibrationResult
from coupled.parallel import as_done, executor
from coupled.rig.parameters import Control

Progress = Callable[[str, int, int], None]
NEAR = 0.05
_BLOCK = 25
_AHEAD = 64  # blocks in the queue of the workers


@dataclass(frozen=True)
class Coverage:
    """Shares of benches, without unit.

    `covered` of each value's 95 % interval, `within` of K within 5 %; `bias` and `spread` of K
    over its true value, with errors in variables and ordinary; `accused` of benches with a good
    reading excluded as mistyped; `deflection` and `felt` of benches with a compensated rig's δ̂
    within 0.5 % and felt gradient within 1 %, at the least, middle and greatest gradient
    (`circle`: both).
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
        """Return the JSON."""
        return dict(self.__dict__)


@dataclass(frozen=True)
class Trial:
    """One bench, fitted and compared with the truth: K, S1, S3, S2, and K by others' forces.

    `held`: each value's interval contains the truth, None if it was not found. `bend_off` and
    `ordinary_off` are K's relative errors, `deflection_off` and `felt_off` the largest relative
    errors of δ̂ and of the felt gradient.
    """

    held: Mapping[str, bool | None]
    bend_off: float
    ordinary_off: float
    ordinary_held: bool
    accused: bool
    deflection_off: float
    felt_off: float


def measure_coverage(
    bench: CalibrationBench,
    benches: int,
    seed: int = 0,
    workers: int = 1,
    progress: Progress | None = None,
) -> Coverage:
    """Return the coverage of the intervals from benches with seeds from `seed` on."""
    blocks = [
        range(first, min(first + _BLOCK, seed + benches))
        for first in range(seed, seed + benches, _BLOCK)
    ]
    found: dict[range, list[Trial]] = {}
    with executor(workers) as pool:
        for block, of_block in as_done(pool, _block, [(bench, each) for each in blocks], _AHEAD):
            found[block] = of_block
            if progress is not None:
                progress("benches", sum(map(len, found.values())), benches)
    trials = [trial for block in blocks for trial in found[block]]
    bend = [trial.bend_off for trial in trials]
    plain = [trial.ordinary_off for trial in trials]
    deflection = np.array([trial.deflection_off for trial in trials]) <= DEFLECTION_WITHIN
    felt = np.array([trial.felt_off for trial in trials]) <= FELT_WITHIN
    return Coverage(
        benches,
        {figure: _share(trial.held[figure] for trial in trials) for figure in trials[0].held},
        float(np.mean(np.abs(bend) <= NEAR)),
        float(np.mean(bend)),
        float(np.std(bend)),
        _share(trial.ordinary_held for trial in trials),
        float(np.mean(plain)),
        float(np.std(plain)),
        _share(trial.accused for trial in trials),
        float(np.mean(deflection)),
        float(np.mean(felt)),
        float(np.mean(deflection & felt)),
    )


def _share(held: Iterable[bool | None]) -> float:
    """Return the share of true values, without None; NaN if there are none."""
    had = [one for one in held if one is not None]
    return float(np.mean(had)) if had else float("nan")


def _block(bench: CalibrationBench, seeds: range) -> tuple[range, list[Trial]]:
    return seeds, [_trial(bench, seed) for seed in seeds]


def _trial(bench: CalibrationBench, seed: int) -> Trial:
    data = bench.rig.controls[bench.control]
    readings = take_readings(bench, seed)
    found = calibrate_control(readings, data, bench.control, bench.instruments, f"bench {seed}")
    true, bend = real_scales(data), data.loader.bend
    s2, plain = found.s2_chosen, found.plain.bend
    others = list(found.fit.others)
    row = bench.rig.structure.between([bench.control, *others])[0, 1:]
    terms = dict(zip(others, row, strict=True))
    return Trial(
        {
            "K": found.line.bend.holds(bend),
            "S1": found.line.s1.holds(true.s1),
            "S3": found.fit.s3.holds(true.s3),
            "S2": None if s2 is None else s2.holds(true.s2),
            **{f"K by {name}": one.holds(terms[name]) for name, one in found.fit.others.items()},
        },
        found.line.bend.value / bend - 1.0,
        plain.value / bend - 1.0,
        plain.holds(bend),
        bool(found.suspects),
        *_largest_errors(found, data),
    )


def _largest_errors(found: CalibrationResult, data: Control) -> tuple[float, float]:
    """Return the largest relative errors of δ̂ and of the felt gradient."""
    true, bend = real_scales(data), data.loader.bend
    k, s2 = found.line.bend.value, found.s2_chosen
    assumed = Scales(found.line.s1.value, true.s2 if s2 is None else s2.value, found.fit.s3.value)
    table, basic = data.schedule.gradients, data.loader.basic_gradient
    gradients = [float(g) for g in np.linspace(min(table), max(table), 3)]
    made = actual_over_ordered(assumed, true)
    return (
        max(abs(deflection_off(assumed, k, true, bend, g)) for g in gradients),
        max(abs(felt_off(made, k, bend, (g, basic))) for g in gradients),
    )
