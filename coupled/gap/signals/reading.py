"""What a record holds of a control, and what each stage would need of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise, noise_of
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.driven import Drive
from coupled.gap.signals.floors import floor_from, input_noise, noise_in
from coupled.gap.signals.missed import Missed, missed_in
from coupled.gap.signals.sensed import Sensed
from coupled.gap.signals.served import left
from coupled.record.channels import SURFACES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.crossing import leaking
from coupled.rig.recorder import stamped
from coupled.rig.replay import replay_schedule
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
PRESSURE, LOAD = "dynamic_pressure_Pa", "load_factor"


@dataclass(frozen=True)
class Reading:
    """A record of one control of a rig: its channels, and those that lack."""

    rig: Rig
    record: Record
    control: ControlName
    # The map of a control's commands to its surface's positions; None where others move it, too.
    surface_points: Callable[[Rig, ControlName], tuple[Floats, Floats] | None]
    number: int = 0  # of the record, where there are several

    @cached_property
    def missed(self) -> Missed:
        """The frames that the host missed."""
        return missed_in(self.record)

    @property
    def surface(self) -> str:
        """The channel of the control's surface."""
        return f"{SURFACES[self.control]}_rad"

    def signal(self, quantity: str) -> Floats:
        """Return a control's channel."""
        return self.record[channel(self.control, quantity)]

    def partner(self) -> list[Floats]:
        """Return the force in N on the control whose force leaks into this one, if recorded."""
        names = [channel(name, "force") for name in leaking(self.control)]
        return [self.record[name] for name in names if name in self.record][:1]

    def load(self) -> Callable[[Rig], Floats | None]:
        """Return by the rig what load factor pulls at the bob weight; none where not recorded.

        The machine feels it in time: a motion that is stamped late is moved back.
        """
        if LOAD not in self.record:
            return lambda rig: None
        read, rate_Hz = smoothed(self.record[LOAD]), self.rig.frame_rate

        def felt(rig: Rig) -> Floats:
            return stamped(read, -rig.flight.motion_stamp * rate_Hz if rig.flight else 0.0)

        return felt

    def sensed(self, rig: Rig) -> Sensed:
        """Return what a rig's channels have to do with what they measure."""
        return Sensed(rig, self.control, self.number)

    def others(self) -> dict[str, Floats]:
        """Return the forces in N on other controls of a common structure, where recorded."""
        if self.rig.structure.stands_apart:
            return {}
        held = {str(n): channel(n, "force") for n in self.rig.controls if n != self.control}
        return {name: self.record[force] for name, force in held.items() if force in self.record}

    def missing(self) -> dict[str, list[str]]:
        """Return the channels that each stage would need and the record lacks."""
        needs = {
            "schedule": [PRESSURE, self.name_of("gradient")],
            "loader": [self.name_of(q) for q in ("force", "computed")] + self._gradient_from(),
            "multiplier": [self.name_of(q) for q in ("computed", "modifying_force")]
            + self._gradient_from(),
            "linkage": [self.name_of(q) for q in ("computed", "force", "deflection")],
            "compensation": [self.name_of(q) for q in ("computed", "force", "estimate")],
            "surface": [self.name_of("estimate"), PRESSURE, self.surface],
        }
        lacking = {s: [n for n in names if n not in self.record] for s, names in needs.items()}
        if self.moved:
            loader = [self.name_of("force"), self.name_of(self.imposed), *self._gradient_from()]
            needs = {"schedule": needs["schedule"], "loader": loader}
            lacking = {s: [n for n in names if n not in self.record] for s, names in needs.items()}
        if self.set_points:  # a bend is not to be seen without the force, but all else
            needless = self.name_of("force")
            lacking["linkage"] = [name for name in lacking["linkage"] if name != needless]
        return {stage: names for stage, names in lacking.items() if names}

    @property
    def set_points(self) -> bool:
        """Whether δc is a number that is commanded, so that there is no loader to judge."""
        return self.rig.controls[self.control].drive == "setpoint"

    @property
    def moved(self) -> bool:
        """Whether the motion is imposed, and the force its answer."""
        return self.rig.controls[self.control].drive == "displacement"

    @property
    def imposed(self) -> str:
        """The quantity that is imposed: the grip's motion where the record has it, else δc."""
        return "deflection" if self.name_of("deflection") in self.record else "computed"

    def commanded(self) -> Drive:
        """Return δc as it drives the linkage: a set point has no noise."""
        computed = self.signal("computed")
        if self.set_points:
            return Drive.of(computed, Noise(0.0))
        return Drive.of(computed, self.driving("computed"))

    def pulled(self) -> Drive:
        """Return F as it drives the loader and the linkage; none where the record lacks it."""
        if self.name_of("force") not in self.record:
            return Drive.of(np.zeros(len(self.record)), Noise(0.0))
        return Drive.of(self.signal("force"), self.driving("force"))

    def name_of(self, quantity: str) -> str:
        """Return the name of a quantity's channel."""
        return channel(self.control, quantity)

    def _gradient_from(self) -> list[str]:
        """Return the channel that G_T is taken from: its own, or q̄ where the record lacks it.

        None where the record has neither, and the rig has one gradient at any q̄.
        """
        own = self.name_of("gradient")
        if own in self.record:
            return [own]
        if PRESSURE in self.record:
            return [PRESSURE]
        return [] if one_gradient(self.rig, self.control) else [own]

    def gradient(self) -> Floats:
        """Return G_T in N/d: as recorded, else what the nominal schedule makes of q̄."""
        source = self._gradient_from()
        if source == [PRESSURE]:
            pressure = smoothed(self.record[PRESSURE])
            return replay_schedule(self.rig, self.control, pressure) * left(self)
        if source:
            return self.signal("gradient")
        table = self.rig.controls[self.control].schedule.total_gradient
        return np.full(len(self.record), table[0]) * left(self)

    def second(self) -> Floats | None:
        """Return G_T beyond the break, which no record holds: what the schedule makes of q̄."""
        two = self.rig.controls[self.control].schedule.second_gradient is not None
        if not two or PRESSURE not in self.record:
            return None
        smooth = smoothed(self.record[PRESSURE])
        return replay_schedule(self.rig, self.control, smooth, beyond=True) * left(self)

    def heard(self, quantity: str) -> Noise:
        """Return the noise of a control's channel."""
        return noise_in(self.rig, self.name_of(quantity), self.signal(quantity))

    def driving(self, quantity: str) -> Noise:
        """Return the noise of a control's channel that drives a stage, and may be a signal's."""
        return input_noise(self.heard(quantity), self.signal(quantity))

    def filtered(self) -> dict[str, str]:
        """Return {a channel of the control whose log was filtered: where its floor comes from}."""
        names = [self.name_of(quantity) for quantity in ("force", "computed", "deflection")]
        return {
            name: floor_from(self.rig, name, self.record[name])
            for name in names
            if name in self.record and noise_of(self.record[name]).filtered
        }


def one_gradient(rig: Rig, control: ControlName) -> bool:
    """Return whether a control's gradient is the same at any q̄; it is 0 without a spring."""
    schedule = rig.controls[control].schedule
    first, *rest = schedule.total_gradient
    return schedule.second_gradient is None and all(g == first for g in rest)


def worth_recording(
    rig: Rig, control: ControlName, stage: str, channels: Sequence[str]
) -> set[str]:
    """Return those of a stage's lacking channels that belong to what the machine has.

    A bench without a host has no estimate, a slide without a spring no schedule, a rig file
    without bend and play no second transducer, a rig without an aircraft no surface.
    """
    data = rig.controls[control]
    host = rig.flight is not None or data.compensation.deflection or data.compensation.gradient
    scheduled = len(set(data.schedule.total_gradient)) > 1
    soft = any((data.loader.bend, data.loader.play, data.loader.arc_geometry))
    has = {"schedule": scheduled, "compensation": host, "linkage": host or soft}
    has["surface"] = rig.flight is not None
    if not has.get(stage, True):
        return set()
    by_schedule = set() if scheduled or host else {PRESSURE, channel(control, "gradient")}
    return set(channels) - by_schedule
