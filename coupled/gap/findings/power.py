"""The power of the records: the smallest size of each effect that they would have shown.

An effect shows if its signature raises a stage from its noise floor to its limit. The signature is
first made orthogonal to those of the nuisance parameters. The smallest size is found by bisection.
A deviation within the tolerance of a nuisance parameter is no effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import (
    Effect,
    Parameter,
    apply,
    keys_of,
    possible,
    touched,
    value_of,
)
from coupled.gap.effects.library import EFFECTS
from coupled.gap.effects.settings import contact, settings
from coupled.gap.signals.output import Output
from coupled.gap.stages.tried import lacking_keys
from coupled.gap.thresholds import POWER_DECADES, POWER_HALVINGS, SETTING_NUDGE
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
DECADE = 10.0


@dataclass(frozen=True)
class EffectPower:
    """The smallest size of an effect that would have been detected.

    `judged`: its stage can be judged; `shows`: some size within its bounds would be detected.
    """

    name: str
    stage: str
    judged: bool = True
    shows: bool = False
    parameters: tuple[tuple[str, float], ...] = ()
    control: str | None = None  # where several are judged; None for the airframe

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
    """Return the smallest detectable size of each effect."""
    lacking = lacking_keys(nominal)

    def judging(effect: Effect) -> list[Output]:
        return [] if lacking & keys_of([effect]) else touched(outputs, [effect])

    return tuple(_power(nominal, control, judging(one), one) for one in library)


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
    """Return the parameters of an effect of a size; at size 1 they are the fit's first start."""
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
    """Return the value from which a parameter's size counts."""
    if p.mode != "value":
        return 0.0
    return float(value_of(nominal, control, p.above or p.key))


def _signature(
    nominal: Rig, control: ControlName, outputs: Sequence[Output], effect: Effect, size: float
) -> float:
    """Return the largest rms signature of an effect in an output, nuisance parameters profiled.

    It is relative to the signature that raises a residual of noise alone to the output's limit; 0
    if the rig cannot have the effect.
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
    """Return the signatures of the stage's nuisance parameters, a column each."""
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
    """Return the smallest parameters at which an effect is detected; None if at no size."""

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
