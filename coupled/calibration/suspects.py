"""Mistyped readings, found by robust regression and reported by their row.

Tukey's biweight, started from the line through two readings with which most others agree, so that
a third of the readings may be wrong. v₃ is compared with S₃·F in the same way: swapped digits of a
force show there and hardly in v₁.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.estimate import Instruments
from coupled.calibration.fit import error_variance
from coupled.calibration.readings import Readings

Floats = NDArray[np.float64]
FEWEST = 5  # readings; outliers of fewer cannot be found
MOST_PAIRS = 400
MANY_SETS = 2000  # random sets if there are more than two parameters
LEAST_TURN = 0.3  # of the largest angle between two readings' (δ, F)
BIWEIGHT = 4.685  # 95 % efficiency for Gaussian errors
TOO_FAR = 6.0  # robust standard deviations; exceeded by chance in fewer than 1 of 100 benches
SLIP = 1e-4  # of the largest value: the smallest mistyped digit
NORMAL = 1.4826  # ratio of a standard deviation to a median absolute deviation


@dataclass(frozen=True)
class Suspect:
    """An outlier: its row, the column in question, and its deviation."""

    row: int
    columns: str
    deviations: float


def find_suspects(readings: Readings, instruments: Instruments) -> list[Suspect]:
    """Return the readings whose deviation exceeds the instruments' errors."""
    suspects = []
    if len(readings.row) >= FEWEST:
        line = _line_deviations(readings, instruments)
        ratio = np.zeros(len(readings.row))
        if readings.gauge:
            ratio = _ratio_deviations(
                readings.v3,
                readings.force,
                instruments.voltage_variance(readings.v3),
                instruments.force_variance(readings.force, readings.force_looks),
            )
        for row, one, two in zip(readings.row, line, ratio, strict=True):
            if max(one, two) > TOO_FAR:
                where = "force" if min(one, two) > TOO_FAR else "deflection or v1"
                where = "force or v3" if one <= TOO_FAR else where
                suspects.append(Suspect(int(row), where, float(max(one, two))))
    if len(readings.null_row) >= FEWEST:
        volts = instruments.voltage_variance
        off = _ratio_deviations(
            readings.null_v2,
            readings.null_v3,
            volts(readings.null_v2),
            volts(readings.null_v3) + instruments.voltage_variance(readings.null_v1),
        )
        for row, far in zip(readings.null_row, off, strict=True):
            if far > TOO_FAR:
                suspects.append(Suspect(int(row), "v2 or v3", float(far)))
    return suspects


def robust_line(columns: Sequence[Floats], v1: Floats, spread: Floats) -> Floats:
    """Return (a, b, c…) by the biweight for δ, F and the forces on other controls.

    `spread` are the readings' relative standard deviations.
    """
    design = np.column_stack(columns) / spread[:, None]
    target = v1 / spread
    beta, scale = _best_pair(design, target)
    for _ in range(50):
        residual = target - design @ beta
        weight = np.maximum(1.0 - (residual / (BIWEIGHT * scale)) ** 2, 0.0)
        before = beta
        beta = np.asarray(
            np.linalg.lstsq(design * weight[:, None], target * weight, rcond=None)[0], float
        )
        if np.allclose(beta, before, rtol=1e-6, atol=0.0):
            break
    return beta


def _best_pair(design: Floats, target: Floats) -> tuple[Floats, float]:
    """Return the line through two readings with which most others agree, and the residuals' scale.

    The two readings must have different gradients: two of one gradient fit all readings of that
    gradient. The scale is that of the least median residual.
    """
    if design.shape[1] > 2:
        return _of_all(design, target)
    pairs = np.array(list(combinations(range(len(target)), 2)))
    unit = design / np.linalg.norm(design, axis=0)
    one, two = unit[pairs[:, 0]], unit[pairs[:, 1]]
    turn = np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    turn /= np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1) + 1e-300
    pairs = pairs[turn >= LEAST_TURN * turn.max()]
    if len(pairs) > MOST_PAIRS:
        pairs = np.random.default_rng(0).choice(pairs, MOST_PAIRS, replace=False)
    return _best_of(design, target, pairs)


def _of_all(design: Floats, target: Floats) -> tuple[Floats, float]:
    """Return the same for more parameters, with random sets of as many readings."""
    rows, figures = design.shape
    rng = np.random.default_rng(0)
    sets = np.array([rng.choice(rows, figures, replace=False) for _ in range(MANY_SETS)])
    unit = design / np.linalg.norm(design, axis=0)
    size = np.abs(np.linalg.det(unit[sets]))
    return _best_of(design, target, sets[size >= LEAST_TURN * size.max()])


def _best_of(design: Floats, target: Floats, sets: NDArray[np.int64]) -> tuple[Floats, float]:
    """Return the line of the set with which most readings agree, and the residuals' scale."""
    betas = np.linalg.solve(design[sets], target[sets][:, :, None])[:, :, 0]
    residuals = np.abs(target - betas @ design.T)
    floor = 1e-12 * float(np.max(np.abs(target)))
    scale = _scale(residuals[np.argmin(np.median(residuals, axis=1))]) + floor
    agreed = np.sum(np.minimum((residuals / (BIWEIGHT * scale)) ** 2, 1.0), axis=1)
    return np.asarray(betas[np.argmin(agreed)]), scale


def _scale(residual: Floats) -> float:
    """Return the residuals' robust standard deviation, widened for few readings."""
    n = len(residual)
    return float(NORMAL * (1.0 + 5.0 / (n - 2)) * np.median(np.abs(residual)) + 1e-300)


def _line_deviations(readings: Readings, instruments: Instruments) -> Floats:
    """Return the deviation of each v₁ from the robust line, in standard deviations."""
    columns = (readings.deflection, readings.force, *readings.others.T)
    v = readings.v1
    a, b, *c = robust_line(columns, v, np.ones_like(v))
    spread = np.sqrt(error_variance(float(a), float(b), readings, instruments, c))
    spread = np.maximum(spread, SLIP * np.max(np.abs(v)))
    found = robust_line(columns, v, spread)
    return _deviations((v - sum(x * one for x, one in zip(found, columns, strict=True))) / spread)


def _ratio_deviations(
    top: Floats, bottom: Floats, top_variance: Floats, bottom_variance: Floats
) -> Floats:
    """Return the deviation of each `top` from the median ratio times `bottom`, likewise."""
    there = bottom != 0.0
    slope = float(np.median(top[there] / bottom[there])) if there.any() else 0.0
    spread = np.sqrt(top_variance + slope**2 * bottom_variance)
    spread = np.maximum(spread, SLIP * np.max(np.abs(top), initial=1e-300))
    return _deviations((top - slope * bottom) / spread)


def _deviations(whitened: Floats) -> Floats:
    """Return residuals over their robust scale, which is at least half of the stated one."""
    return np.asarray(np.abs(whitened) / max(_scale(whitened), 0.5))
