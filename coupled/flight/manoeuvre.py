"""A manoeuvre: a rig, pilots on some of its controls, and a duration. It needs no file.

It is checked when it is made, like a run file and with the same errors; a fault names the run's
file if there is one, or else the manoeuvre's name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

from coupled.arguments import public
from coupled.errors import InputError, nearest
from coupled.flight.conditions import Conditions
from coupled.flight.expectation import Expect
from coupled.flight.pilot import Pilot
from coupled.flight.pilot.base import Values
from coupled.flight.pilot.own import Law, PilotOrLaw, as_pilot, check_law
from coupled.record.channels import ControlName, record_channels, unit_of
from coupled.rig.equations import bend_loss, felt_gradient
from coupled.rig.parameters import Control, PlainName
from coupled.rig.rig import Rig
from coupled.rig.serving import check_service, has_services, service_channels
from coupled.rig.structure import Structure
from coupled.schema import Given, Section, build, plain_value, quantity

Configuration = Literal[
    "rigid", "uncompensated", "deflection only", "gradient only", "compensated", "calibrated low"
]
# Flown by a comparison by default.
CONFIGURATIONS: tuple[Configuration, ...] = (
    "rigid",
    "uncompensated",
    "deflection only",
    "gradient only",
    "compensated",
)
EVERY_CONFIGURATION: tuple[Configuration, ...] = (*CONFIGURATIONS, "calibrated low")


@public
class PressureProfile(Given):
    """The dynamic pressure of a bench over time, linear between points and constant beyond.

    For a rig without aircraft; `time_s` must rise, `dynamic_pressure_Pa` has as many values, none
    negative. Raises InputError as a run file does.
    >>> import coupled
    >>> rig = coupled.load_rig("t37").changed({"flight": None})
    >>> rise = coupled.PressureProfile(time_s=[0.0, 2.0], dynamic_pressure_Pa=[500.0, 2500.0])
    >>> pull = coupled.Step(force_N=20)
    >>> flight = coupled.fly(rig, column=pull, duration_s=3, dynamic_pressure_Pa=rise)
    >>> float(flight.record["dynamic_pressure_Pa"][120])
    1500.0
    """

    time_s: Values = quantity("", min_length=1)
    dynamic_pressure_Pa: Values = quantity("", min_length=1)

    def check(self, file: object) -> None:
        """Raise InputError for an invalid profile; `file` is named."""
        if len(self.time_s) != len(self.dynamic_pressure_Pa):
            raise InputError(file, "bench.dynamic_pressure_Pa", "needs as many values as time_s")
        if any(b <= a for a, b in pairwise(self.time_s)):
            raise InputError(file, "bench.time_s", "must rise from value to value")
        if min(self.dynamic_pressure_Pa) < 0.0:
            raise InputError(file, "bench.dynamic_pressure_Pa", "cannot be negative")


class Measure(Section):
    """The subject of a comparison: the control, the timed change of attitude, a channel."""

    control: ControlName | None = None
    attitude_change: float = quantity("rad", 0.1, gt=0)
    drawn: str | None = None


class Flown(Section):
    """The common keys of all run files."""

    name: PlainName
    duration: float = quantity("s", gt=0, le=7200)
    seed: int = quantity("", 0, ge=0)
    record_properties: list[str] = []


@dataclass(frozen=True)
class Source:
    """The files of a manoeuvre, and its case's changes of the rig."""

    run_file: Path
    rig_file: Path
    changes: Mapping[str, Any] = field(default_factory=dict)


@public
@dataclass(frozen=True)
class Manoeuvre:
    """A flight: a rig, and pilots on some of its controls, for `duration_s` seconds.

    rig                 as made by `Rig.changed` and `configured`
    pilots              {control: pilot}, for example {"column": Step(force_N=50)}; at least one.
                        A pilot may be a function of the state that returns a force in N
    duration_s          up to 7200 s
    seed                of noise, turbulence, gusts and a pilot's remnant
    conditions          wind, gust, turbulence and events; only with an aircraft
    bench               q̄ over time; required for a rig without aircraft, and only there
    gradient            {control: function of the state}, in place of its schedule, N/d
    record_properties   JSBSim properties that become channels of the record
    configurations      those of a comparison, of `EVERY_CONFIGURATION`
    measure             the subject of a comparison
    expect              the expectations of a check
    name, label         of the run, and of its case
    card                a description of the run
    source              the files of the manoeuvre, if any

    Raises InputError as a run file does, with its keys.

    >>> import coupled
    >>> rig, pull = coupled.load_rig("t37"), coupled.Step(force_N=50)
    >>> pull_up = coupled.Manoeuvre(rig, {"column": pull}, duration_s=2)
    >>> pull_up.frames, pull_up.configured("rigid").rig.controls["column"].loader.bend
    (240, 0.0)
    >>> coupled.Manoeuvre(rig, {"column": pull}, duration_s=0)
    Traceback (most recent call last):
    coupled.errors.InputError: manoeuvre: duration_s: input should be greater than 0, is 0
    """

    rig: Rig
    pilots: Mapping[ControlName, PilotOrLaw]
    duration_s: float
    seed: int = 0
    conditions: Conditions = field(default_factory=Conditions)
    bench: PressureProfile | None = None
    record_properties: tuple[str, ...] = ()
    configurations: tuple[Configuration, ...] = CONFIGURATIONS
    measure: Measure = field(default_factory=Measure)
    expect: tuple[Expect, ...] = ()
    name: str = "manoeuvre"
    label: str = ""
    card: str = ""
    source: Source | None = None
    gradient: Mapping[ControlName, Law] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.label:
            object.__setattr__(self, "label", self.name)
        object.__setattr__(self, "pilots", {n: as_pilot(p) for n, p in self.pilots.items()})
        object.__setattr__(self, "seed", plain_value(self.seed))
        scalars = {"name": self.name, "duration_s": self.duration_s, "seed": self.seed}
        build(Flown, scalars, self.file, "")
        self._check_kind()
        self._check_pilots()
        self._check_gradient()
        self._check_measure()
        self._check_services()

    @property
    def file(self) -> object:
        """The run's name in faults: its file, or else its name."""
        return self.source.run_file if self.source is not None else self.name

    @property
    def rig_file(self) -> object:
        """The rig's name in faults: its file, or else its name."""
        return self.source.rig_file if self.source is not None else self.rig.place

    @property
    def _rig_name(self) -> str:
        return self.source.rig_file.name if self.source is not None else self.rig.name

    @property
    def frames(self) -> int:
        """The number of rows of the record."""
        return max(1, round(self.duration_s * self.rig.frame_rate))

    @property
    def control(self) -> ControlName:
        """The compared control; by default the first that a pilot moves."""
        if self.measure.control is not None:
            return self.measure.control
        moved = [control for control, pilot in self.pilots.items() if not pilot.rests]
        return next(iter(moved or self.pilots))

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the record."""
        own = record_channels(list(self.rig.controls), self.rig.flight is not None)
        services = [name for control in self.served for name in service_channels(control)]
        return (*own, *services, *self.record_properties)

    @property
    def served(self) -> tuple[ControlName, ...]:
        """The controls with services in the rig, or set by an event."""
        led = {event.control for event in self.conditions.event.values()}
        return tuple(n for n, c in self.rig.controls.items() if n in led or has_services(c))

    def configured(self, configuration: Configuration) -> Manoeuvre:
        """Return this manoeuvre with the rig in one of the configurations."""
        return replace(self, rig=configure(self.rig, configuration))

    def begun(self) -> Manoeuvre:
        """Return this manoeuvre; raises InputError for a pilot who begins after its end."""
        for control, pilot in self.pilots.items():
            key, time_s = pilot.begins(control)
            if time_s >= self.duration_s:
                problem = f"is {time_s:g}; give less than duration_s = {self.duration_s:g}, when"
                raise InputError(self.file, f"pilot.{control}.{key}", f"{problem} the run ends")
        return self

    def _check_kind(self) -> None:
        """Refuse keys of a bench for a rig with an aircraft, and the reverse."""
        rig, file, bench = self._rig_name, self.file, self.bench
        twice = [x for i, x in enumerate(self.record_properties) if x in self.record_properties[:i]]
        if twice:
            raise InputError(file, "record_properties", f"names {twice[0]} twice")
        if self.rig.flight is not None:
            if bench is not None:
                raise InputError(file, "bench", f"{rig} has an aircraft, which gives q̄ itself")
            return
        if bench is None:
            raise InputError(file, "bench", f"is missing: {rig} has no aircraft, so give q̄ here")
        if self.record_properties:
            raise InputError(file, "record_properties", f"{rig} has no aircraft, so no properties")
        if self.conditions.given:
            raise InputError(file, self.conditions.given[0], f"{rig} has no aircraft for it")
        bench.check(file)

    def _check_pilots(self) -> None:
        self.rig.check_controlled(self.rig_file)
        if not self.pilots:
            controls = ", ".join(self.rig.controls)
            raise InputError(self.file, "pilot", f"needs at least one of {controls}")
        for control, pilot in self.pilots.items():
            if control not in self.rig.controls:
                problem = f"the rig has no {control}; {nearest(control, self.rig.controls)}"
                raise InputError(self.file, f"pilot.{control}", problem)
            if not isinstance(pilot, Pilot):
                problem = f"is {pilot!r:.60}; give a pilot, as Step(force_N=50)"
                raise InputError(self.file, f"pilot.{control}", problem)
            pilot.check(self.rig, control, self.file)

    def _check_gradient(self) -> None:
        for control, law in self.gradient.items():
            if control not in self.rig.controls:
                problem = f"the rig has no {control}; {nearest(control, self.rig.controls)}"
                raise InputError(self.file, f"gradient.{control}", problem)
            check_law(law, self.file, f"gradient.{control}")

    def _check_measure(self) -> None:
        control, drawn = self.measure.control, self.measure.drawn
        if control is not None and control not in self.rig.controls:
            problem = f"{self._rig_name} has no {control}"
            raise InputError(self.file, "measure.control", problem)
        if drawn is not None and drawn not in self.channels:
            problem = f"no {drawn!r}; {nearest(drawn, self.channels)}"
            raise InputError(self.file, "measure.drawn", problem)

    def _check_services(self) -> None:
        for name, event in self.conditions.event.items():
            if event.service is not None:
                control, to = str(event.control), float(event.to or 0.0)
                check_service(self.rig, control, event.service, to, self.file, f"event.{name}")


def configure(rig: Rig, configuration: Configuration) -> Rig:
    """Return the rig with a rigid structure, or with a bend and the named corrections on.

    Rigid: K = 0 and the host's K̂ = 0, between controls too. Otherwise the rig's own K and K̂.
    "calibrated low" is the uncompensated rig whose S₁ was calibrated at a low gradient, eq. (7a).
    """
    changes: dict[str, Any] = {}
    for name, control in rig.controls.items():
        loader, host = f"controls.{name}.loader", f"controls.{name}.compensation"
        if configuration == "rigid":
            d = unit_of(name)
            changes |= {f"{loader}.bend_{d}_per_N": 0.0, f"{host}.bend_{d}_per_N": 0.0}
            changes |= {f"{loader}.bend_push_{d}_per_N": None, f"{loader}.bend_curve": {}}
            changes["structure"] = Structure()
        changes[f"{host}.deflection"] = configuration in ("deflection only", "compensated")
        changes[f"{host}.gradient"] = configuration in ("gradient only", "compensated")
        if configuration == "calibrated low":
            low = _calibrated_low(control, unit_of(name))
            changes |= {f"controls.{name}.sensing.{key}": value for key, value in low.items()}
    return rig.changed(changes)


def _calibrated_low(control: Control, d: str) -> dict[str, float]:
    """Return the scales of a host whose S₁ is v₁/δ, read at a low gradient: eq. (7a).

    During the reading the loader holds F = G₀·δc, so that G₀/(1 + K·G₀) is felt and v₁/δ is
    S₁/(1 + K·G₀). This Ŝ₁ affects the analog product (figure 5) and the host's reading.
    """
    sensing, bend = control.sensing, control.loader.bend
    low = control.gains.low_gradient or min(control.schedule.gradients)
    kept = 1.0 - bend_loss(bend, felt_gradient(low, bend))
    return {
        f"s1_V_per_{d}": kept * sensing.read_scale * sensing.s1,
        "computed_scale": 1.0 / (kept * sensing.deflection_scale),
    }
