"""The library's parameters on a machine: those that are nuisance parameters, and their scale.

A value that may be off within a tolerance, without an effect, is a nuisance parameter. The default
tolerance is 1 or 2 %, to which a potentiometer is set and a servo tuned; the file of a nominal rig
fitted to records of the machine (`nominal`) has the tolerance of each fitted value.

A parameter in the unit Nᵃ·dᵇ·sᶜ has the scale Fᵃ·xᵇ·tᶜ, with the rms force F, the rms motion x
about its mean, and the time t = x/v with the rms speed v; kg is N·s²/d. Friction of one scale
equals the rms force, and damping of one scale balances it at the rms speed.

The library's starts and bounds suit a control column. For a machine of another order of magnitude
they are multiplied by Fᵃ·xᵇ over the column's. A bound of a force is at least several times the rms
force. Parameters for each unit of a regressor are in rms forces over its standard deviation.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from coupled.gap.effects.effect import BY_REGRESSOR, Effect, Parameter, entry, setting_of, value
from coupled.gap.effects.library import BY_NAME, EFFECTS, LAG, MOTION, STAMP
from coupled.gap.noise.noise import rms_of
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.output import Output
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import (
    COLUMN_FORCE_N,
    COLUMN_WAY,
    MINOR,
    MOST,
    OTHER_SCALE,
    CLOCK_s,
    YIELDS_m,
)
from coupled.record.channels import ControlName, motions_in, unit_of
from coupled.rig.rig import Rig

# A time stamp error of the force, within the tolerance of a recorder's clocks.
CLOCK = setting_of(BY_NAME[STAMP], -CLOCK_s, CLOCK_s, 0.0)
CONTACT = ("loader.friction_stiffness_N_per_{d}", "loader.friction_elastic_share")
# The keys that an effect has alone.
ALONE = frozenset(
    effect.free[0].key for effect in EFFECTS if len(effect.parameters) == 1 and effect.free
)


def settings(rig: Rig, control: ControlName, outputs: Sequence[Output] = ()) -> dict[str, Effect]:
    """Return {effect that frees the same key: nuisance parameter within its tolerance}.

    If an output is of loader and linkage in series, the linkage's parameters show in both. Of an
    aircraft alone it is the time stamp of the motion, known to half a row where the model takes
    several steps between two: the rows do not show at which of them a surface moves.
    """
    if not rig.controls:
        assert rig.flight is not None
        half_s = CLOCK_s if rig.flight.steps_per_frame == 1 else max(CLOCK_s, 0.5 / rig.frame_rate)
        return {MOTION: setting_of(BY_NAME[MOTION], -half_s, half_s, 0.0)}
    given, found = rig.controls[control].tolerance, dict[str, Effect]()
    in_series = any(output.in_series for output in outputs)
    for effect in (*EFFECTS, *_only_beside_others(rig, control)):
        ends = _ends(effect, rig, control)
        if ends is None:
            continue
        # A tolerance of a sensor in the rig file shows in several outputs.
        every = effect.stage == "sensing" and effect.free[0].key_on(control) in given
        setting = setting_of(effect, *ends, every_output=every)
        both = in_series and effect.stage == "linkage"
        found[effect.name] = replace(setting, outputs=("linkage", "loader")) if both else setting
    return found


def _only_beside_others(rig: Rig, control: ControlName) -> list[Effect]:
    """Return the parameters with a tolerance in the rig file that no effect has alone."""
    given = rig.controls[control].tolerance
    free = {p.key for one in contact(rig, control) for p in one.free}
    found = {
        p.key: replace(effect, name=p.key, parameters=(p,))
        for effect in EFFECTS
        for p in effect.free
        if p.key not in ALONE | free and p.key_on(control) in given
    }
    return list(found.values())


def lag_within_a_step(rig: Rig) -> Effect:
    """Return a delay of the force on the loader as a nuisance parameter, at most one step.

    If a simulated hand and loader exchange force and motion once per step of the loader, the force
    of the step before acts.
    """
    step_s = 1.0 / (rig.frame_rate * rig.substeps)
    return setting_of(BY_NAME[LAG], 0.0, step_s, 0.0)


def contact(rig: Rig, control: ControlName, longest: float = 0.0) -> tuple[Effect, ...]:
    """Return the presliding parameters as nuisance parameters; none if the rig file has them.

    All dry friction has presliding, of up to half a millimetre, so that its length is no effect.
    `longest` is another largest length, d.
    """
    if not rig.controls:
        return ()
    loader = rig.controls[control].loader
    if loader.friction_stiffness > 0.0:
        return ()
    most = longest or most_yielding(control)
    length = Parameter(
        "", CONTACT[0], "yields", 1e-3 * most, most, (0.1 * most, 0.01 * most), may_end=True
    )
    share = value("", CONTACT[1], 0.0, 1.0 - MINOR, loader.friction_elastic_share, may_end=True)
    return (
        entry("loader", "setting of the contact", ("", ""), length),
        entry("loader", "setting of the contact's share", ("", ""), share),
    )


def most_yielding(control: ControlName) -> float:
    """Return the largest presliding length, d."""
    return YIELDS_m * COLUMN_WAY[unit_of(control)] / COLUMN_WAY["m"]


def is_dry(rig: Rig, control: ControlName) -> bool:
    """Tell whether a rig file has dry friction."""
    if not rig.controls:
        return False
    loader = rig.controls[control].loader
    levels = (loader.friction, loader.breakaway, loader.friction_pull, loader.friction_push)
    return any((*levels, loader.friction_by_load, loader.regressor_friction))


def _ends(effect: Effect, rig: Rig, control: ControlName) -> tuple[float, float, float] | None:
    """Return tolerance limits and neutral value of an effect's only parameter; None without."""
    if len(effect.parameters) != 1 or not effect.free:
        return None
    (number,) = effect.free
    given = rig.controls[control].tolerance.get(number.key_on(control))
    tolerance = number.tolerance if given is None else given
    if given is None and tolerance <= 0.0:
        return None
    neutral = number.neutral(rig, control)
    if number.mode == "factor":
        filed = float(number.nominal(rig, control))
        if filed == 0.0:
            return None  # the rig lacks the component, such as a servo
        tolerance = tolerance if given is None else given / abs(filed)
        if tolerance <= 0.0:
            return None
    elif given is not None:
        # At most the filed value is removed: friction is not negative.
        floor = -math.inf if number.low < 0.0 else -abs(float(number.nominal(rig, control)))
        floor = number.low if number.mode == "value" else floor
        return max(neutral - tolerance, floor), neutral + tolerance, neutral
    return neutral - min(tolerance, 0.9), neutral + tolerance, neutral


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
            moved = motions_in(reading.record, reading.control)
            if not moved or reading.name_of("force") not in reading.record:
                continue
            way = smoothed(reading.record[moved[0]])
            forces.append(reading.record[reading.name_of("force")])
            ways.append(way - way.mean())
            speeds.append(rate_of(way, reading.rig.frame_rate))
            if (other := reading.regressor()) is not None:
                others.append(other)
        if not forces:
            return None
        force, way_d, speed = (rms_of(np.concatenate(each)) for each in (forces, ways, speeds))
        spread = float(np.std(np.concatenate(others))) if others else 0.0
        return cls(force, way_d, way_d / speed, spread) if min(force, way_d, speed) > 0.0 else None

    def size(self, unit: str) -> float | None:
        """Return the scale of a parameter by its unit, such as N·s/m; None for an unknown unit."""
        powers = _powers(unit)
        if powers is None or not any(powers):
            return None
        return float(np.prod(np.array((self.force_N, self.way, self.time_s)) ** powers))

    def times_columns(self, unit: str, control: ControlName) -> float:
        """Return the factor on a column's value by its unit; 1 for a machine of similar size.

        The library's lengths are those of a column in m, which moves 0.03 m where a wheel turns
        0.3 rad.
        """
        powers = _powers(unit)
        if powers is None:
            return 1.0
        usual = COLUMN_WAY[unit_of(control)]
        ratios = (self.force_N / COLUMN_FORCE_N, self.way / usual)
        force, way = (1.0 if 1.0 / OTHER_SCALE < r < OTHER_SCALE else r for r in ratios)
        return float(force ** powers[0] * (way * usual / COLUMN_WAY["m"]) ** powers[1])


def way_of(readings: Sequence[Reading]) -> float:
    """Return the rms of a control's motion over records, d; 0 if it is unknown."""
    scales = Scales.of(readings)
    return 0.0 if scales is None else scales.way


def in_scale(
    effects: Sequence[Effect], scales: Scales | None, rig: Rig, control: ControlName
) -> list[Effect]:
    """Return effects with starts and bounds scaled to a machine."""
    if scales is None:
        return list(effects)
    scaled = (tuple(_scaled(p, scales, rig, control) for p in e.parameters) for e in effects)
    return [replace(effect, parameters=p) for effect, p in zip(effects, scaled, strict=True)]


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
    starts = tuple(times * start for start in p.starts)
    usual = Scales(COLUMN_FORCE_N, COLUMN_WAY[unit_of(control)], 1.0).times_columns(unit, control)
    if times != usual and p.mode == "value" and not (p.above or p.is_limit):
        filed = float(p.nominal(rig, control))  # of the size of this machine
        starts = ((1.0 + MOST) * filed,) if filed > 0.0 else starts
    return replace(p, low=low, high=high, starts=starts)


def _powers(unit: str) -> tuple[float, ...] | None:
    """Return the powers of force, motion and time in a unit such as N·s/m; None if unknown."""
    over, _, under = unit.partition("/")
    total = np.zeros(3)
    for side, part in ((1, over), (-1, under)):
        for token in filter(None, part.split("·")):
            found = re.fullmatch(r"([A-Za-z]+|1)([²³23]?)", token)  # such as m³
            if found is None or found[1] not in POWERS:
                return None
            total += side * EXPONENTS.get(found[2], 1) * np.array(POWERS[found[1]])
    return tuple(total.tolist())
