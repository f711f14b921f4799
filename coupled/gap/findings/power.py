"""Power: how large each effect would have had to be for this record to show it.

An effect shows where its signature, made orthogonal to those of the settings that may stand off
by their tolerance, lifts a stage from its floor over its limit. The least such size is
found by bisection. A setting that is off by less than its tolerance is no effect, however well
the record shows it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, Parameter, apply, possible, touched, value_of
from coupled.gap.effects.library import EFFECTS
from coupled.gap.effects.settings import contact, settings
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import POWER_DECADES, POWER_HALVINGS, SETTING_NUDGE
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
DECADE = 10.0


@dataclass(frozen=True)
class EffectPower:
    """The least size of an effect that the records would have shown.

    `judged`: whether they judge its stage; `shows`: whether any size that it may have would show.
    """

    name: str
    stage: str
    judged: bool = True
    shows: bool = False
    parameters: tuple[tuple[str, float], ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        found: dict[str, Any] = {"name": self.name, "stage": self.stage}
        if not self.judged:
            return found | {"judged": False}
        found["shows"] = self.shows
        return found | ({"parameters": dict(self.parameters)} if self.shows else {})


def power(
    nominal: Rig,
    control: ControlName,
    outputs: Sequence[Output],
    library: Sequence[Effect] = EFFECTS,
) -> tuple[EffectPower, ...]:
    """Return for each effect the least size that the record would have shown."""
    return tuple(_power(nominal, control, touched(outputs, [one]), one) for one in library)


def _power(
    nominal: Rig, control: ControlName, ours: Sequence[Output], effect: Effect
) -> EffectPower:
    if not ours:
        return EffectPower(effect.name, effect.stage, judged=False)
    values = _least(nominal, control, ours, effect)
    if values is None:
        return EffectPower(effect.name, effect.stage)
    sizes = tuple(
        (p.named(control), values[effect.value_key(p)]) for p in effect.free if not p.shape
    )
    return EffectPower(effect.name, effect.stage, shows=True, parameters=sizes)


def _values(effect: Effect, size: float, nominal: Rig, control: ControlName) -> dict[str, float]:
    """Return an effect's parameters so far from neutral; a size of 1 is where a fit starts."""
    values = {}
    for p in effect.free:
        start = p.starts[0]
        if p.shape:
            value = start
        elif p.mode == "factor":
            off = size * (start - 1.0)
            value = 1.0 + math.copysign(max(abs(off), p.tolerance), off)
        elif p.inverse:
            value = start / size
        else:
            value = _base(p, nominal, control) + size * start
        values[effect.value_key(p)] = float(np.clip(value, p.low, p.high))
    return values


def _base(p: Parameter, nominal: Rig, control: ControlName) -> float:
    """Return what a value that replaces the nominal one starts from."""
    if p.mode != "value":
        return 0.0
    return float(value_of(nominal, control, p.above or p.key))


def _signature(
    nominal: Rig, control: ControlName, outputs: Sequence[Output], effect: Effect, size: float
) -> float:
    """Return the largest rms signature of an effect in an output, settings profiled; 0 if none.

    Of what would lift a residual of noise alone to the gap from which its stage is guilty.
    """
    rig = possible(nominal, control, [effect], _values(effect, size, nominal, control))
    if rig is None:
        return 0.0
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
    known = settings(nominal, control, [output])
    beside = [one for name, one in known.items() if name != effect.name]
    for setting in (*beside, *(contact(nominal, control) if effect.dry else ())):
        if output.stage in setting.shows_in:
            (number,) = setting.free
            nudge = SETTING_NUDGE * (number.high - number.starts[0])
            values = {setting.value_key(number): number.starts[0] + nudge}
            rig = apply(nominal, control, [setting], values)
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
        if high > DECADE**POWER_DECADES:
            return None
    low = high / DECADE
    while shows(low):
        low, high = low / DECADE, low
        if low < DECADE**-POWER_DECADES:
            break
    for _ in range(POWER_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if shows(middle) else (middle, high)
    return _values(effect, high, nominal, control)
