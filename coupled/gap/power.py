"""Power: how large each effect would have had to be for this record to show it.

An effect shows where its signature, made orthogonal to those of the settings that may stand off
by their tolerance, lifts a stage from its floor over the bar of guilt. The least such size is
found by bisection. A setting that is off by less than its tolerance is no effect, however well
the record shows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects import (
    EFFECTS,
    SETTINGS,
    TOLERANCE,
    Effect,
    Parameter,
    apply,
    parameter_name,
)
from coupled.gap.fit import touched
from coupled.gap.output import Output
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
DECADE, DECADES = 10.0, 3  # sizes are sought over three decades to either side of a fit's start
STEPS = 5  # halvings of the decade where it begins to show: to 7 %
HELD = ("stribeck_{d}_per_s",)
INVERSE = ("rate_{d}_per_s", "rate_norm_per_s", "limit_{d}")  # the smaller, the more it does


def power(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    library: Sequence[Effect] = EFFECTS,
) -> list[dict[str, Any]]:
    """Return for each effect the least size that the record would have shown.

    `shows` is False where no size within the effect's bounds would, `parameters` the sizes.
    """
    found = []
    for effect in library:
        ours = touched(outputs, [effect])
        if not ours:
            found.append({"name": effect.name, "stage": effect.stage, "judged": False})
            continue
        values = _least(nominal, control, ours, effect)
        item: dict[str, Any] = {
            "name": effect.name,
            "stage": effect.stage,
            "shows": values is not None,
        }
        if values is not None:
            item["parameters"] = {
                parameter_name(p, control): values[f"{effect.name}.{p.name}"]
                for p in effect.free
                if p.name not in HELD
            }
        found.append(item)
    return found


def _values(effect: Effect, size: float, nominal: Rig, control: ControlName) -> dict[str, float]:
    """Return an effect's parameters so far from neutral; a size of 1 is where a fit starts."""
    values = {}
    for p in effect.free:
        start = p.starts[0]
        if p.name in HELD:
            value = start
        elif p.mode == "factor":
            off = size * (start - 1.0)
            slack = TOLERANCE.get(effect.name, 0.0)
            value = 1.0 + math.copysign(max(abs(off), slack), off)
        elif p.name in INVERSE:
            value = start / size
        else:
            value = _base(p, nominal, control) + size * start
        values[f"{effect.name}.{p.name}"] = float(np.clip(value, p.low, p.high))
    return values


def _base(p: Parameter, nominal: Rig, control: ControlName) -> float:
    """Return what a value that replaces the nominal one starts from."""
    if p.mode != "value" or p.section == "flight":
        return 0.0
    section = getattr(nominal.controls[control], p.section)
    return float(getattr(section, p.above or p.field))


def _signature(
    nominal: Rig, control: ControlName, outputs: Sequence[Output], effect: Effect, size: float
) -> float:
    """Return the largest rms signature of an effect in an output, settings profiled.

    Of what would lift a residual of noise alone to the gap from which its stage is guilty.
    """
    rig = apply(nominal, control, [effect], _values(effect, size, nominal, control))
    largest = 0.0
    for output in outputs:
        change = output.residual(rig) - output.residual(nominal)
        basis = _settings(nominal, control, output, effect)
        if basis.size:
            change = change - basis @ np.linalg.lstsq(basis, change, rcond=None)[0]
        wanted = math.sqrt(output.limit**2 - 1.0)
        largest = max(largest, float(np.sqrt(np.mean(change**2))) / wanted)
    return largest


def _settings(nominal: Rig, control: ControlName, output: Output, effect: Effect) -> Floats:
    """Return the signatures of a stage's settings, a column each."""
    columns = []
    for name, setting in SETTINGS.items():
        if setting.stage == output.stage and name != effect.name:
            rig = apply(nominal, control, [setting], {f"{setting.name}.factor": 1.01})
            columns.append(output.residual(rig) - output.residual(nominal))
    return np.column_stack(columns) if columns else np.empty((0, 0))


def _least(
    nominal: Rig, control: ControlName, outputs: Sequence[Output], effect: Effect
) -> dict[str, float] | None:
    """Return the parameters at which an effect just shows, or None where it never does."""

    def shows(size: float) -> bool:
        return _signature(nominal, control, outputs, effect, size) >= 1.0

    if not effect.free:
        return {} if shows(1.0) else None
    high = 1.0
    while not shows(high):
        high *= DECADE
        if high > DECADE**DECADES:
            return None
    low = high / DECADE
    while shows(low):
        low, high = low / DECADE, low
        if low < DECADE**-DECADES:
            break
    for _ in range(STEPS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if shows(middle) else (middle, high)
    return _values(effect, high, nominal, control)
