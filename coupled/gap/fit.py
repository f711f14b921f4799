"""Fitting a set of effects to a record's stages, as physics, by least squares.

The residuals are in floors, so a channel weighs by what noise leaves it. Each fit returns
its outcome: values, intervals (from the Jacobian, widened by the residual's memory), which
of them stand at a bound, and the residuals.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from coupled.channels import ControlName
from coupled.gap.effects import Effect, Parameter, apply
from coupled.gap.output import Output, Part, memory
from coupled.rig.parameters import Rig

Floats = NDArray[np.float64]
# The outputs in which an effect of a stage shows.
TOUCHES = {
    "schedule": ("schedule",),
    "loader": ("loader",),
    "multiplier": ("loader", "multiplier"),
    "sensing": ("loader", "multiplier", "linkage"),
    "linkage": ("linkage",),
    "surface": ("surface",),
    "airframe": ("airframe",),
}


@dataclass(frozen=True)
class Fit:
    """A fitted set of effects: `values`, `low`, `high` (95 %) by "effect.parameter"."""

    effects: tuple[Effect, ...]
    values: Mapping[str, float]
    low: Mapping[str, float]
    high: Mapping[str, float]
    at_bound: tuple[str, ...]
    rig: Rig


def shows_in(effect: Effect) -> tuple[str, ...]:
    """Return the outputs' stages in which an effect shows."""
    return TOUCHES["multiplier" if effect.name == "digital_multiplier" else effect.stage]


def touched(outputs: Sequence[Output], effects: Sequence[Effect]) -> list[Output]:
    """Return the outputs that these effects act on."""
    stages = {stage for effect in effects for stage in shows_in(effect)}
    return [output for output in outputs if output.stage in stages]


def fit(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    effects: Sequence[Effect],
    part: Part = "all",
    start: Mapping[str, float] | None = None,
) -> Fit:
    """Return the effects fitted to a part of the outputs that they touch.

    Starts from each parameter's own starts, or from `start` where it has a value, and keeps
    the best.
    """
    ours = touched(outputs, effects)
    keys, frees = _free(effects)
    start = start or {}

    def rig_of(x: Floats) -> Rig:
        values = dict(zip(keys, np.asarray(x, dtype=float).tolist(), strict=True))
        return apply(nominal, control, effects, values)

    def residual(scaled: Floats) -> Floats:
        rig = rig_of(scaled * scale)
        return np.concatenate([output.residual(rig, part) for output in ours])

    if not keys:
        return Fit(tuple(effects), {}, {}, {}, (), rig_of(np.array([])))
    scale = np.array([max(abs(s) for s in p.starts) or 1.0 for p in frees])
    low = np.array([p.low for p in frees]) / scale
    high = np.array([p.high for p in frees]) / scale
    best = None
    for first in _starts(keys, frees, start):
        x0 = np.clip(np.array(first) / scale, low + 1e-9, high - 1e-9)
        found = least_squares(
            residual, x0, bounds=(low, high), diff_step=1e-3, xtol=1e-5, ftol=1e-7, max_nfev=25
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    half = _half_width(best, len(ours)) * scale
    values = best.x * scale
    stuck = np.isclose(best.x, low, atol=1e-4) | np.isclose(best.x, high, rtol=1e-4)
    return Fit(
        tuple(effects),
        dict(zip(keys, values.tolist(), strict=True)),
        dict(zip(keys, (values - half).tolist(), strict=True)),
        dict(zip(keys, (values + half).tolist(), strict=True)),
        tuple(key for key, at in zip(keys, stuck | ~np.isfinite(half), strict=True) if at),
        rig_of(values),
    )


def _half_width(found: Any, outputs: int) -> Floats:
    """Return half of each scaled parameter's 95 % interval; infinite where nothing tells it."""
    jacobian, left = found.jac, found.fun
    rows = len(left) // outputs
    widen = max(memory(left[i * rows : (i + 1) * rows]) for i in range(outputs))
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * float(np.mean(left**2)) * widen
    half = 1.96 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    half[np.linalg.norm(jacobian, axis=0) < 1e-9] = np.inf
    return np.asarray(half)


def _free(effects: Sequence[Effect]) -> tuple[list[str], list[Parameter]]:
    pairs = [(f"{e.name}.{p.name}", p) for e in effects for p in e.free]
    return [key for key, _ in pairs], [p for _, p in pairs]


def _starts(
    keys: list[str], frees: list[Parameter], start: Mapping[str, float]
) -> list[list[float]]:
    pairs = list(zip(keys, frees, strict=True))
    tries = max((len(p.starts) for key, p in pairs if key not in start), default=1)
    return [
        [start.get(key, p.starts[min(i, len(p.starts) - 1)]) for key, p in pairs]
        for i in range(tries)
    ]
