"""The entries of the library of effects, their constructors, and how an effect changes a rig.

An effect is added to a rig by changing values under keys of the rig file. The stages are then
predicted with the changed rig.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal, NamedTuple

from coupled.errors import InputError
from coupled.gap.chain import AIRFRAME
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import LIGHT_LOAD_N, MODEL_ERROR
from coupled.record.channels import ControlName, channel, unit_at_end, unit_of
from coupled.record.record import Record
from coupled.rig.crossing import leaking
from coupled.rig.rig import Rig, with_values
from coupled.schema import SMALLEST, Section, file_keys

Mode = Literal["value", "factor", "added", "switch", "yields"]
Drawing = Literal["law", "loop", "time"]
Role = Literal["size", "other", "shape"]
Kind = Literal["", "limit", "aliased", "saturating"]
# The host computes with other values for these keys; they must be corrected, too.
HOST_VALUES = {
    "loader.bend_{d}_per_N": "K̂",
    "loader.basic_gradient_N_per_{d}": "the host's G_B",
    "loader.breakout_N": "the host's F_BO",
}


class ModelError(NamedTuple):
    """The error of a value from the model of a right effect.

    `relative` is relative to its size; `absolute`, in its unit, is the largest error from
    conditions that the record does not show.
    """

    relative: float = MODEL_ERROR
    absolute: float = 0.0


USUAL, EXACT = ModelError(), ModelError(0.0)


@dataclass(frozen=True)
class Parameter:
    """A free parameter of an effect: a key of the rig file, and how a fitted value changes it.

    `key`          key of a control or of the flight; `{d}` in it and in the name is m or rad
    `mode`         `value` replaces the nominal value, `factor` multiplies it, `added` is added to
                   it; a `switch` has no value (`Switch`); `yields` is the presliding length, which
                   sets the stiffness of the contact
    `low`, `high`  bounds of the fit, `starts` its start values
    `above`        key whose nominal value is added to the starts
    `role`         a `size` is varied by the screen; a `shape` is held at its start in the search
                   for the least size that shows
    `kind`         of a `limit` a smaller value has a larger effect, and 0 is no limit; an `aliased`
                   frequency may lie on either side of half the frame rate; larger values of a
                   `saturating` one make no difference, such as a play wider than the motion
    `may_end`      a fit at a bound is admissible
    `tolerance`    half-width of its range as a nuisance parameter, relative for a factor
    `model_error`  error of the value from the model of a right effect
    """

    name: str
    key: str
    mode: Mode
    low: float = 0.0
    high: float = 0.0
    starts: tuple[float, ...] = (0.0,)
    above: str = ""
    role: Role = "size"
    kind: Kind = ""
    may_end: bool = False
    model_error: ModelError = USUAL
    tolerance: float = 0.0

    @property
    def is_size(self) -> bool:
        """Whether the value is a size of the effect, which the screen varies."""
        return self.role == "size"

    @property
    def has_neutral(self) -> bool:
        """Whether the effect is absent only if this value is neutral."""
        return self.is_size or self.mode == "factor"

    @property
    def is_limit(self) -> bool:
        """Whether a smaller value has a larger effect."""
        return self.kind == "limit"

    def named(self, control: str) -> str:
        """Return the parameter's name with its unit on a control."""
        return self.name.format(d=unit_of(control))

    def key_on(self, control: str) -> str:
        """Return the parameter's key in a rig file, relative to the control or the flight."""
        return self.key.format(d=unit_of(control))

    def unit(self, rig: Rig, control: ControlName) -> str:
        """Return the unit of the rig's value in text, such as N·s/m."""
        if TERMS in self.key:
            return ""
        last = self.key_on(control).rpartition(".")[2]
        unit = last.removeprefix(field_of(rig, control, self.key)).lstrip("_")
        if self.key in BY_REGRESSOR:
            unit = unit.replace(UNIT, regressor_unit(rig, control))
        over, _, under = unit.partition("per_")
        text = (over.strip("_") or "1") + "/" + under.strip("_") if under else unit
        return text.replace("_", "·").removesuffix("3") + ("³" if text.endswith("3") else "")

    def nominal(self, rig: Rig, control: ControlName) -> Any:
        """Return the rig's value."""
        return value_of(rig, control, self.key)

    def base(self, rig: Rig, control: ControlName) -> float:
        """Return the nominal value to which a start is added, 0 without `above`."""
        return float(value_of(rig, control, self.above)) if self.above else 0.0

    def entered(self, nominal: Any, value: float) -> Any:
        """Return the rig's new value for a fitted value."""
        if self.mode == "factor":
            return nominal * value
        if self.mode == "added":
            return max(nominal + value, 0.0) if self.low == 0.0 else nominal + value
        return value

    def bounds(self, rig: Rig, control: ControlName) -> tuple[float, float]:
        """Return the bounds of the fit; an addition to a nonnegative value may remove all of it."""
        removes = self.mode == "added" and self.low == 0.0
        return -float(self.nominal(rig, control)) if removes else self.low, self.high

    def accepted(self, rig: Rig, control: ControlName) -> tuple[float, float]:
        """Return the least and the greatest value of the fit that a rig file accepts."""
        if TERMS in self.key:
            return -math.inf, math.inf
        holder = section_of(rig, control, self.key.partition(".")[0])
        low, high = declared_bounds(holder, field_of(rig, control, self.key))
        filed = float(self.nominal(rig, control))
        if self.mode == "factor" and filed > 0.0:
            low, high = low / filed, high / filed
        elif self.mode == "added":
            low, high = low - filed, high - filed
        least = self.bounds(rig, control)[0] if self.mode == "added" else 0.0
        return max(low, least) if self.low >= 0.0 else low, high

    def error(self, value: float, rig: Rig, control: ControlName) -> float:
        """Return the smallest standard error of a value, from its model error."""
        size = self.size(value, rig, control)
        return math.hypot(self.model_error.relative * size, self.model_error.absolute)

    def size(self, value: float, rig: Rig, control: ControlName) -> float:
        """Return how far a value is from that without an effect; of a limit, the value itself."""
        none = self.base(rig, control) if self.above else self.neutral(rig, control)
        return abs(value) if self.is_limit else abs(value - none)

    def neutral(self, rig: Rig, control: ControlName) -> float:
        """Return the value that leaves the rig's value unchanged."""
        if self.mode == "value":
            return float(self.nominal(rig, control))
        return 1.0 if self.mode == "factor" else 0.0


@dataclass(frozen=True)
class Switch(Parameter):
    """A parameter without a value, which sets its key to `on`."""

    on: Any = None

    def entered(self, nominal: Any, value: float) -> Any:
        """Return the value that is set."""
        return self.on


@dataclass(frozen=True)
class Signature:
    """How an effect is drawn: y against x, names in `plots.signals`, and the zoom's length, s."""

    x: str
    y: str
    drawing: Drawing = "law"
    zoom_s: float = 2.5


OTHER_FORCE = "another control's force"
# Force and friction for each unit of the regressor, a channel that the rig file names. In names of
# parameters its unit takes the place of `UNIT`.
BY_REGRESSOR = ("loader.regressor_force_N_per_unit", "loader.regressor_friction_N_per_unit")
UNIT = "unit"
TERMS = "terms."  # before the name of an aerodynamic function, in keys of the flight


class Sampled(NamedTuple):
    """The sampling error of a random effect.

    `error` returns the relative standard error of the fitted value as an estimate of the process
    parameter, given the nominal rig and a record; `times` those of its events, s from the start.
    """

    error: Callable[[Rig, Record], float]
    times: Callable[[Record], Floats] | None = None


@dataclass(frozen=True)
class Effect:
    """A named effect of one stage.

    `outputs`      the outputs in which it shows, if not those of its stage
    `needs`        channels that every record must have; `OTHER_FORCE` is another control's force
    `dry`          it is dry friction, whose presliding parameters are nuisance parameters
    `sampled`      its sampling error, if it is a random process
    `seen`         returns start values by parameter, estimated from the residuals
    `contains`     names of the laws nested in it
    `changes`      how many quantities of the rig change with its parameter
    `of`           the aerodynamic function that it scales; empty for an effect of the library
    """

    name: str
    stage: str
    parameters: tuple[Parameter, ...]
    signature: Signature
    outputs: tuple[str, ...] = ()
    needs: tuple[str, ...] = ()
    dry: bool = False
    sampled: Sampled | None = None
    seen: Callable[[Sequence[Output], Rig, ControlName], list[dict[str, float]]] | None = None
    contains: tuple[str, ...] = ()
    changes: int = 1
    of: str = ""

    @property
    def free(self) -> tuple[Parameter, ...]:
        """The parameters with a value to fit."""
        return tuple(p for p in self.parameters if p.mode != "switch")

    def deviating(self, rig: Rig, control: ControlName) -> tuple[Parameter, ...]:
        """Return the parameters of which one is not neutral if the effect is present.

        Shapes are among them if the rig files the sizes: the angle of a filed weight may be wrong.
        """
        filed = all(p.nominal(rig, control) for p in self.free if p.has_neutral or p.is_limit)
        return tuple(p for p in self.free if p.has_neutral or (filed and not p.is_limit))

    @property
    def shows_in(self) -> tuple[str, ...]:
        """The outputs in which it shows."""
        return self.outputs or STAGE_OF[self.stage].effects_show_in

    @property
    def of_sensor(self) -> bool:
        """Whether it acts in the sensor of δc, which a set point does not have."""
        return self.stage == "sensing" and "multiplier" in self.shows_in

    @property
    def flies(self) -> bool:
        """Whether each of its sizes needs a flight of the aircraft."""
        return AIRFRAME in self.shows_in and self.seen is None

    @property
    def gradual(self) -> bool:
        """Whether its first parameter is a rate: the effect grows from the record's start."""
        return bool(self.free) and self.free[0].name == "per_s"

    def value_key(self, parameter: Parameter) -> str:
        """Return the key of a parameter among fitted values."""
        return f"{self.name}.{parameter.name}"

    def can_be_tried(self, records: Sequence[Record], control: ControlName) -> bool:
        """Tell whether all records of a control have the channels that it needs."""
        others = [channel(name, "force") for name in leaking(control)]
        wanted = [others if name == OTHER_FORCE else [name] for name in self.needs]
        return all(any(n in record for n in names) for record in records for names in wanted)


def value_of(rig: Rig, control: ControlName, key: str) -> Any:
    """Return a rig's value of a key of a control, or of the flight."""
    section, _, last = key.partition(".")
    holder = section_of(rig, control, section)
    if section == "flight" and last.startswith(TERMS):
        return holder.terms.get(last.removeprefix(TERMS), 1.0)
    return getattr(holder, field_of(rig, control, key))


def section_of(rig: Rig, control: ControlName, section: str) -> Any:
    """Return a section of a control, or the flight."""
    return rig.flight if section == "flight" else getattr(rig.controls[control], section)


def declared_bounds(holder: Section, field: str) -> tuple[float, float]:
    """Return the bounds of a field in a rig file."""
    low, high = -math.inf, math.inf
    for bound in type(holder).model_fields[field].metadata:
        low = max(low, float(getattr(bound, "ge", getattr(bound, "gt", low))))
        high = min(high, float(getattr(bound, "le", getattr(bound, "lt", high))))
    return low, high


def fields_of(rig: Rig, control: ControlName, section: str) -> dict[str, str]:
    """Return {key in a rig file: field} of a section of a control, or of the flight."""
    holder = section_of(rig, control, section)
    assert isinstance(holder, Section), section
    return file_keys(type(holder), unit_of(control))


def field_of(rig: Rig, control: ControlName, key: str) -> str:
    """Return the name of a key's field, without its unit."""
    section, _, last = key.partition(".")
    return fields_of(rig, control, section)[last.format(d=unit_of(control))]


def regressor_unit(rig: Rig, control: ControlName) -> str:
    """Return the unit of the channel that a rig file names as regressor."""
    name = rig.controls[control].loader.regressor
    return UNIT if name is None else unit_at_end(name)


def apply(
    rig: Rig, control: ControlName, effects: Sequence[Effect], values: Mapping[str, float]
) -> Rig:
    """Return the rig with effects added; `values` by "effect.parameter".

    The host's own values do not change: its G_B and F_BO stay nominal. Raises InputError if the
    values give no valid rig.
    """
    changes: dict[str, Any] = {}
    lengths: dict[str, float] = {}
    for effect in effects:
        for p in effect.parameters:
            if p.key in changes or p.key in lengths:  # shared with an effect before
                continue
            value = values.get(effect.value_key(p), 0.0)
            value = value if abs(value) >= SMALLEST else 0.0
            if p.mode == "yields":
                lengths[p.key] = value
                continue
            changes[p.key] = p.entered(p.nominal(rig, control), value)
    for key, length in lengths.items():
        changes[key] = _level(rig, control, changes) / length if length > 0.0 else 0.0
    changes |= _breakaway(rig, control, changes)
    if control in rig.controls:
        data = rig.controls[control]
        changes["compensation.basic_gradient_N_per_{d}"] = data.assumed_basic_gradient
        changes["compensation.breakout_N"] = data.assumed_breakout
    d = unit_of(control)
    return with_values(rig, {dotted(key, control).format(d=d): new for key, new in changes.items()})


def possible(
    rig: Rig, control: ControlName, effects: Sequence[Effect], values: Mapping[str, float]
) -> Rig | None:
    """Return the rig with effects added, or None if the values give no valid rig."""
    try:
        return apply(rig, control, effects, values)
    except InputError:
        return None


def touched(outputs: Sequence[Output], effects: Iterable[Effect]) -> list[Output]:
    """Return the outputs that these effects act on."""
    stages = {stage for effect in effects for stage in effect.shows_in}
    return [output for output in outputs if output.stage in stages]


def contains(law: Effect, other: Effect) -> bool:
    """Tell whether a law contains another."""
    return other.name in law.contains


def keys_of(effects: Iterable[Effect]) -> set[str]:
    """Return the keys of a rig file that effects free."""
    return {p.key for effect in effects for p in effect.parameters}


def distinct(library: Sequence[Effect], nuisances: Iterable[Effect]) -> list[Effect]:
    """Return the library without laws that equal another law with its nuisance parameters.

    If the rig file does not give the presliding parameters, they are nuisance parameters of Coulomb
    friction, which then equals presliding friction.
    """
    free = keys_of(nuisances)
    return [
        law
        for law in library
        if not any(
            contains(law, other) and keys_of([law]) - keys_of([other]) <= free for other in library
        )
    ]


def dotted(key: str, control: str) -> str:
    """Return the key of a rig file for a key of a control, or of the flight."""
    return key if key.startswith("flight.") else f"controls.{control}.{key}"


FRICTION, BREAKAWAY = "loader.friction_N", "loader.breakaway_N"
DIRECTIONS = ("loader.friction_pull_N", "loader.friction_push_N")
BY_LOAD = "loader.friction_by_load"


def _level(rig: Rig, control: ControlName, changes: Mapping[str, Any]) -> float:
    """Return the dry friction of a rig with changes, N, that sets its contact stiffness.

    Friction by load counts at a light load.
    """

    def of(key: str) -> float:
        return float(changes.get(key, value_of(rig, control, key)))

    running = max(of(FRICTION), of(BREAKAWAY))
    return running + 0.5 * sum(map(of, DIRECTIONS)) + LIGHT_LOAD_N * of(BY_LOAD)


def _breakaway(rig: Rig, control: ControlName, changes: Mapping[str, Any]) -> dict[str, float]:
    """Return the breakaway force that a change of the running friction moves by as much."""
    if FRICTION not in changes or BREAKAWAY in changes:
        return {}
    filed, running = (float(value_of(rig, control, key)) for key in (BREAKAWAY, FRICTION))
    if filed == 0.0:
        return {}
    return {BREAKAWAY: float(changes[FRICTION]) + max(filed - running, 0.0)}


def factor(
    key: str, start: float, low: float = 0.1, high: float = 10.0, **options: Any
) -> Parameter:
    """Return a factor on the rig's value, with more fields of `Parameter` as options."""
    return Parameter("factor", key, "factor", low, high, (start,), **options)


def _number(
    mode: Mode, name: str, key: str, low: float, high: float, *starts: float, **options: Any
) -> Parameter:
    """Return a parameter with a value, with more fields of `Parameter` as options."""
    return Parameter(name, key, mode, low, high, starts, **options)


# Parameters that are added to the rig's value, that replace it, and limits that replace it.
added, value = partial(_number, "added"), partial(_number, "value")
limit = partial(value, kind="limit")


def real_bend(start: float, above: str = "") -> Parameter:
    """Return the actual bend coefficient K, with a start above the value of a key."""
    key = "loader.bend_{d}_per_N"
    return value("bend_{d}_per_N", key, 0, 1e-2, start, role="other", above=above)


def entry(
    stage: str, name: str, drawn: tuple[Any, ...], *parameters: Parameter, **options: Any
) -> Effect:
    """Return an effect, with `drawn` the fields of its `Signature`, and more of `Effect`."""
    return Effect(name, stage, parameters, Signature(*drawn), **options)


def setting_of(
    effect: Effect, low: float, high: float, neutral: float, every_output: bool = False
) -> Effect:
    """Return an effect's parameter as a nuisance parameter between two values.

    It is fitted to the first output in which the effect shows, or to all of them if `every_output`.
    """
    (number,) = effect.parameters
    within = replace(number, low=low, high=high, starts=(neutral,), tolerance=0.0)
    name, shown = f"setting of {effect.name}", effect.shows_in[: None if every_output else 1]
    return replace(effect, name=name, parameters=(within,), outputs=shown)
