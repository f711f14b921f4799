"""The characteristic force, motion and time of a machine in its records, which scale parameters.

A parameter in the unit Nᵃ·dᵇ·sᶜ has the scale Fᵃ·xᵇ·tᶜ, with the rms force F, the rms motion x
about its mean, and the time t = x/v with the rms speed v; kg is N·s²/d. Friction of one scale
equals the rms force, and damping of one scale balances it at the rms speed.

The library's starts and bounds suit a control column. For a machine of another order of magnitude
they are multiplied by Fᵃ·xᵇ over the column's, so that the fits do not depend on units. A bound of
a force is at least several times the rms force.

Parameters for each unit of a regressor have starts and bounds in rms forces over its standard
deviation.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from coupled.gap.effects.effect import BY_REGRESSOR, Effect, Parameter
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import COLUMN_FORCE_N, COLUMN_WAY, OTHER_SCALE
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

# Powers of force, motion and time by unit; a load factor has no dimension.
POWERS = {
    "N": (1, 0, 0),
    "kg": (1, -1, 2),
    "m": (0, 1, 0),
    "rad": (0, 1, 0),
    "s": (0, 0, 1),
    "Hz": (0, 0, -1),
    "g": (0, 0, 0),
    "1": (0, 0, 0),
}
EXPONENTS = {"²": 2, "³": 3, "2": 2, "3": 3}


@dataclass(frozen=True)
class Scales:
    """The rms of a control's force in N and motion in d, and their time in s, over records.

    `regressor` is the standard deviation of the regressor, 0 without one.
    """

    force_N: float
    way: float
    time_s: float
    regressor: float = 0.0

    @classmethod
    def of(cls, readings: Sequence[Reading]) -> Scales | None:
        """Return the scales of records; None where they lack force or motion, or nothing moves."""
        forces, ways, speeds, others = [], [], [], []
        for reading in readings:
            names = (reading.name_of(quantity) for quantity in ("computed", "deflection"))
            moved = next((name for name in names if name in reading.record), None)
            if moved is None or reading.name_of("force") not in reading.record:
                continue
            way = smoothed(reading.record[moved])
            forces.append(reading.record[reading.name_of("force")])
            ways.append(way - way.mean())
            speeds.append(rate_of(way, reading.rig.frame_rate))
            if (other := reading.regressor()) is not None:
                others.append(other)
        if not forces:
            return None
        force, way_d, speed = (
            float(np.sqrt(np.mean(np.concatenate(each) ** 2))) for each in (forces, ways, speeds)
        )
        spread = float(np.std(np.concatenate(others))) if others else 0.0
        return cls(force, way_d, way_d / speed, spread) if min(force, way_d, speed) > 0.0 else None

    def size(self, unit: str) -> float | None:
        """Return the scale of a parameter by its unit, such as N·s/m; None for an unknown unit."""
        powers = _powers(unit)
        if powers is None or not any(powers):
            return None
        return float(np.prod(np.array((self.force_N, self.way, self.time_s)) ** powers))

    def times_columns(self, unit: str, control: ControlName) -> float:
        """Return the factor on a column's value by its unit; 1 for a machine of similar size."""
        powers = _powers(unit)
        if powers is None:
            return 1.0
        force, way = self.force_N / COLUMN_FORCE_N, self.way / COLUMN_WAY[unit_of(control)]
        like = [1.0 if 1.0 / OTHER_SCALE < r < OTHER_SCALE else r for r in (force, way)]
        return float(like[0] ** powers[0] * like[1] ** powers[1])


def in_scale(
    effects: Sequence[Effect], scales: Scales | None, rig: Rig, control: ControlName
) -> list[Effect]:
    """Return effects with starts and bounds scaled to a machine."""
    if scales is None:
        return list(effects)
    return [
        replace(
            effect, parameters=tuple(_scaled(p, scales, rig, control) for p in effect.parameters)
        )
        for effect in effects
    ]


def _scaled(p: Parameter, scales: Scales, rig: Rig, control: ControlName) -> Parameter:
    """Return a parameter with scaled starts and bounds."""
    if p.mode not in ("added", "value") or p.key.startswith("flight."):
        return p
    if p.key in BY_REGRESSOR:
        times = scales.force_N / scales.regressor if scales.regressor > 0.0 else 1.0
        starts = tuple(times * start for start in p.starts)
        return replace(p, low=times * p.low, high=times * p.high, starts=starts)
    unit = p.unit(rig, control)
    if unit == "rad" and "{d}" not in p.key:  # a phase, which does not grow with the motion
        return p
    times, size = scales.times_columns(unit, control), scales.size(unit)
    low, high = times * p.low, times * p.high
    if unit == "N" and size is not None and not p.is_limit:
        high = max(high, OTHER_SCALE * size)
        low = min(low, -OTHER_SCALE * size) if low < 0.0 else low
    if (low, high, times) == (p.low, p.high, 1.0):
        return p
    return replace(p, low=low, high=high, starts=tuple(times * start for start in p.starts))


def _powers(unit: str) -> tuple[float, float, float] | None:
    """Return the powers of force, motion and time in a unit such as N·s/m; None if unknown."""
    over, _, under = unit.partition("/")
    total = np.zeros(3)
    for side, part in ((1, over), (-1, under)):
        for token in filter(None, part.split("·")):
            name, power = _split(token)
            if name not in POWERS:
                return None
            total += side * power * np.array(POWERS[name])
    force, way, time = total.tolist()
    return force, way, time


def _split(token: str) -> tuple[str, int]:
    """Return the base unit and power of a part of a unit: m³ is (m, 3)."""
    found = re.fullmatch(r"([A-Za-z]+|1)([²³23]?)", token)
    return (found[1], EXPONENTS.get(found[2], 1)) if found else ("", 1)
