"""What an entry of the library of effects is, and how effects enter a rig.

Adding an effect to a rig means writing values under the rig file's own keys, which the same
stages then fly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import hypot
from typing import Any, Literal, NamedTuple

from coupled.errors import InputError
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import MODEL_ERROR
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.crossing import leaking
from coupled.rig.rig import Rig
from coupled.schema import SMALLEST, Section, file_keys

Mode = Literal["value", "factor", "added", "switch", "yields"]
Drawing = Literal["law", "loop", "time"]


@dataclass(frozen=True)
class Parameter:
    """One freed number of the rig: its key in a rig file, and how a fitted value enters it.

    The key is one of a control's, or of the flight's; `{d}` in it and in the name is m, or rad on
    a wheel. `value` replaces the nominal one, `factor` multiplies it, `added` is added to it; a
    `switch` has no number, and sets the key to `on`; `yields` is the length over which the rig's
    dry friction yields before it slips, and sets the stiffness of its contact. `above` is a key
    from whose nominal value the starts count.

    How its size is scanned: not at all where not `scanned`; `shape` is held at its start when
    the least size that shows is sought; of an `inverse` one, less does more, and 0 is none. One
    that `may_end` can stand at a bound while the effect is there. `host` is what the host calls
    its own number for it, which is then to be set. A frequency `folds` about half of the frame
    rate. One that `saturates` does all that it can from some size on: a play wider than a motion.
    One with a `tolerance`, relative for a factor, is off by so much without being there: it is a
    nuisance parameter.
    `model_error` is how well, relative, the physics of a right effect gives it, `unsure` by
    how much it is off at most for what a record does not say.
    """

    name: str
    key: str
    mode: Mode
    low: float = 0.0
    high: float = 0.0
    starts: tuple[float, ...] = (0.0,)
    on: Any = None
    above: str = ""
    scanned: bool = True
    shape: bool = False
    inverse: bool = False
    may_end: bool = False
    model_error: float = MODEL_ERROR
    unsure: float = 0.0
    host: str = ""
    folds: bool = False
    saturates: bool = False
    tolerance: float = 0.0

    def named(self, control: str) -> str:
        """Return its name with its unit on this control."""
        return self.name.format(d=unit_of(control))

    def key_on(self, control: str) -> str:
        """Return its key in a rig file, from the control or the flight on."""
        return self.key.format(d=unit_of(control))

    def unit(self, rig: Rig, control: ControlName) -> str:
        """Return the unit of the rig's number as it is written: N·s/m."""
        last = self.key_on(control).rpartition(".")[2]
        unit = last.removeprefix(field_of(rig, control, self.key)).lstrip("_")
        over, _, under = unit.partition("per_")
        text = (over.strip("_") or "1") + "/" + under.strip("_") if under else unit
        return text.replace("_", "·").removesuffix("3") + ("³" if text.endswith("3") else "")

    def nominal(self, rig: Rig, control: ControlName) -> Any:
        """Return what the rig has."""
        return value_of(rig, control, self.key)

    def base(self, rig: Rig, control: ControlName) -> float:
        """Return the nominal value from which a start counts, 0 where it has none."""
        return float(value_of(rig, control, self.above)) if self.above else 0.0

    def entered(self, nominal: Any, value: float) -> Any:
        """Return the rig's new number for a fitted value."""
        if self.mode == "switch":
            return self.on
        if self.mode == "factor":
            return nominal * value
        if self.mode == "added":
            return max(nominal + value, 0.0) if self.low == 0.0 else nominal + value
        return value

    def bounds(self, rig: Rig, control: ControlName) -> tuple[float, float]:
        """Return between which values it may be fitted.

        Of what is added, and is never negative in the rig, all that is filed may be taken off.
        """
        if self.mode == "added" and self.low == 0.0:
            return -float(self.nominal(rig, control)), self.high
        return self.low, self.high

    def error(self, value: float, rig: Rig, control: ControlName) -> float:
        """Return how well a value is known at best: by its way from none, or by a limit."""
        none = self.base(rig, control) if self.above else self.neutral(rig, control)
        size = abs(value) if self.inverse else abs(value - none)
        return hypot(self.model_error * size, self.unsure)

    def neutral(self, rig: Rig, control: ControlName) -> float:
        """Return the value at which the rig's number stays as it is."""
        if self.mode == "value":
            return float(self.nominal(rig, control))
        return 1.0 if self.mode == "factor" else 0.0


@dataclass(frozen=True)
class Signature:
    """How an effect is drawn: y against x as a law, a loop or over time; and its zoom's length.

    `x` and `y` are names of `plots.signals`.
    """

    x: str
    y: str
    drawing: Drawing = "law"
    zoom_s: float = 2.5


OTHER_FORCE = "another control's force"


class Sampled(NamedTuple):
    """What a record holds of an effect that is random.

    `error` is the relative standard error of its number as an estimate of the process', by the
    record and its frame in s; `times` are those of the events that it consists of, in s from the
    record's start, None where it is continuous.
    """

    error: Callable[[Record, float], float]
    times: Callable[[Record], Floats] | None = None


@dataclass(frozen=True)
class Effect:
    """A named effect of one stage.

    `outputs`      those in which it shows, if not those of its stage
    `needs`        channels that every record must have for it to be tried; `OTHER_FORCE` is that
                   of another control
    `dry`          it is dry friction: its presliding is a nuisance parameter beside it
    `sampled`      a record holds a random sample of it
    `seen`         values by parameter where a fit may start, as a rig's residuals show them
    `of_sensor`    it is one of the sensor of δc, which a set point has none of
    `contains`     the laws that it is at some value of a further parameter
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
    of_sensor: bool = False
    contains: tuple[str, ...] = ()

    @property
    def free(self) -> tuple[Parameter, ...]:
        """The parameters that have a number to fit."""
        return tuple(p for p in self.parameters if p.mode != "switch")

    @property
    def shows_in(self) -> tuple[str, ...]:
        """The outputs in which it shows."""
        return self.outputs or STAGE_OF[self.stage].effects_show_in

    @property
    def gradual(self) -> bool:
        """Whether its first number is a rate: it grows from the record's start on."""
        return bool(self.free) and self.free[0].name == "per_s"

    def value_key(self, parameter: Parameter) -> str:
        """Return the key of a parameter among fitted values."""
        return f"{self.name}.{parameter.name}"

    def can_be_tried(self, records: Sequence[Record], control: ControlName) -> bool:
        """Tell whether all records of a control have the channels that it needs."""
        others = [channel(name, "force") for name in leaking(control)]
        wanted = [others if name == OTHER_FORCE else [name] for name in self.needs]
        return all(any(n in record for n in names) for record in records for names in wanted)


@cache
def _fields(section: type[Section], d: str) -> dict[str, str]:
    return file_keys(section, d)


def value_of(rig: Rig, control: ControlName, key: str) -> Any:
    """Return what a rig has under a key of a control, or of the flight."""
    section, _, last = key.partition(".")
    holder = rig.flight if section == "flight" else getattr(rig.controls[control], section)
    return getattr(holder, field_of(rig, control, key)) if last else holder


def field_of(rig: Rig, control: ControlName, key: str) -> str:
    """Return the name of a key's field, without its unit."""
    section, _, last = key.partition(".")
    d = unit_of(control)
    holder = rig.flight if section == "flight" else getattr(rig.controls[control], section)
    assert isinstance(holder, Section), key
    return _fields(type(holder), d)[last.format(d=d)]


def apply(
    rig: Rig, control: ControlName, effects: Sequence[Effect], values: Mapping[str, float]
) -> Rig:
    """Return the rig with effects added; `values` by "effect.parameter".

    The host's own values stay: its G_B and F_BO are pinned to the nominal. Raises InputError
    where the physics cannot give such a rig.
    """
    changes: dict[str, Any] = {}
    lengths: dict[str, float] = {}
    for effect in effects:
        for p in effect.parameters:
            if p.key in changes or p.key in lengths:  # of an effect before it, which it shares
                continue
            value = values.get(effect.value_key(p), 0.0)
            value = value if abs(value) >= SMALLEST else 0.0
            if p.mode == "yields":
                lengths[p.key] = value
                continue
            changes[p.key] = p.entered(p.nominal(rig, control), value)
    for key, length in lengths.items():
        changes[key] = _level(rig, control, changes) / length if length > 0.0 else 0.0
    changes |= _no_less_than_running(rig, control, changes)
    data = rig.controls[control]
    changes["compensation.basic_gradient_N_per_{d}"] = data.assumed_basic_gradient
    changes["compensation.breakout_N"] = data.assumed_breakout
    d = unit_of(control)
    return rig.changed({dotted(key, control).format(d=d): new for key, new in changes.items()})


def possible(
    rig: Rig, control: ControlName, effects: Sequence[Effect], values: Mapping[str, float]
) -> Rig | None:
    """Return the rig with effects added, or None where the physics cannot give it."""
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
    """Return the laws that are not another one beside its nuisance parameters.

    Dry friction yields before it slips, and how far is a nuisance parameter where the rig file does
    not give it: presliding friction is Coulomb friction then.
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
BY_LOAD, LIGHT_LOAD_N = "loader.friction_by_load", 10.0


def _level(rig: Rig, control: ControlName, changes: Mapping[str, Any]) -> float:
    """Return the dry friction of a rig with changes, N, that its contact carries.

    Of what goes with the direction the mean, of what goes with the load that at a light one:
    a loader that is never loaded more may yield by all that a contact may, too.
    """

    def of(key: str) -> float:
        return float(changes.get(key, value_of(rig, control, key)))

    running = max(of(FRICTION), of(BREAKAWAY))
    return running + 0.5 * sum(map(of, DIRECTIONS)) + LIGHT_LOAD_N * of(BY_LOAD)


def _no_less_than_running(
    rig: Rig, control: ControlName, changes: Mapping[str, Any]
) -> dict[str, float]:
    """Return the breakaway raised to the running friction where below it: a file is refused so."""
    if FRICTION not in changes and BREAKAWAY not in changes:
        return {}
    running = float(changes.get(FRICTION, value_of(rig, control, FRICTION)))
    breakaway = float(changes.get(BREAKAWAY, value_of(rig, control, BREAKAWAY)))
    return {BREAKAWAY: running} if 0.0 < breakaway < running else {}
