"""One control in a record: its channels, those that each stage needs, and what they measured.

Stages are driven by physical quantities, and a record contains readings: with a scale error, its
drift, mains hum, a zero offset, and late time stamps. The phase of the hum differs between records;
a rig has that of the first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from coupled.gap.noise.lines import projected
from coupled.gap.noise.noise import Noise, between_jumps, jumps, noise_of, noise_of_input
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.floors import Drive, floor_from, noise_in
from coupled.gap.signals.live import Assumed, Live, Mask, live_of
from coupled.gap.signals.missed import Missed, missed_in
from coupled.gap.signals.output import Floats, above_rounding
from coupled.gap.thresholds import MINOR, MOST, NEGLIGIBLE, PARTLY, SETTLE_s, SHORTEST_RECORD_s
from coupled.record.channels import SURFACES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.crossing import leaking
from coupled.rig.curves import DeflectionReading
from coupled.rig.equations import specified_gradient
from coupled.rig.hosted import Feel, OtherInputs
from coupled.rig.nodes import on_nodes
from coupled.rig.parameters import Schedule, Sensing
from coupled.rig.recorder import stamped
from coupled.rig.replay import replay_schedule
from coupled.rig.rig import Rig
from coupled.rig.serving import ServiceRows, service_rows


@dataclass(frozen=True)
class Sensed:
    """The conversion from a rig's readings of one control to the measured quantities."""

    rig: Rig
    control: ControlName
    number: int = 0  # of the record, where there are several

    @property
    def _of(self) -> Sensing:
        return self.rig.controls[self.control].sensing

    def at_grip(self, shown: Floats, force: Floats) -> Floats:
        """Return the reading of the grip's transducer, d, from its deflection on the arc, and F."""
        return self._loaded(force) + self._of.grip_curve.at(shown)

    def from_grip(self, read: Floats, force: Floats) -> Floats:
        """Return the deflection at the grip, d, from the reading of its transducer, and F in N."""
        return self._of.grip_curve.inverse(read - self._loaded(force))

    def _loaded(self, force: Floats) -> Floats:
        """Return what the reading at the grip has beyond its curve, d."""
        return self._of.deflection_zero + self._of.grip_load_curve.at(force)

    def hum(self, read: Floats) -> Floats | float:
        """Return the mains hum at each frame in δc as read, d."""
        of = self._of
        if of.hum == 0.0:
            return 0.0
        turn = 2.0 * math.pi * of.hum_frequency / self.rig.frame_rate
        at = turn * np.arange(len(read))
        phase = of.hum_phase
        if self.number != 0:
            phase = projected(np.diff(read, 4), turn).phase - 2.0 * turn  # of four differences
        return np.asarray(of.hum * np.sin(at + phase))

    def scale(self, samples: int, steps: int = 1) -> Floats | float:
        """Return the ratio of δc as read to δc at samples, so many `steps` of which are a frame."""
        of = self._of
        if of.scale_drift == 0.0:
            return of.read_scale
        times_s = np.arange(samples, dtype=np.float64) / (self.rig.frame_rate * steps)
        # The search may try a drift by which the scale would reach 0, and nothing is divided by 0.
        return np.asarray(of.read_scale * np.maximum(1.0 + of.scale_drift * times_s, NEGLIGIBLE))

    def force(self, recorded: Floats) -> Floats:
        """Return F in N at each frame from the recorded F."""
        return self._unread(self.as_the_host_had_it(recorded))

    def force_on_nodes(self, nodes: Floats, recorded: Floats) -> Floats:
        """Return F in N at each of the loader's nodes; `nodes` are those of the recorded F."""
        if self._of.force_stamp != 0.0:
            nodes = on_nodes(self.rig, self.as_the_host_had_it(recorded))
        return self._unread(nodes)

    def both(self, computed: Floats, recorded: Floats, read: Floats) -> tuple[Floats, Floats]:
        """Return δc on the nodes and F at the frames from readings; `read`: δc at frames."""
        hum = self.hum(read)
        still = computed - (on_nodes(self.rig, hum) if isinstance(hum, np.ndarray) else hum)
        true = self.curve.inverse(still / self.scale(len(computed), self.rig.substeps))
        return true, self.force(recorded)

    def as_the_host_had_it(self, recorded: Floats) -> Floats:
        """Return F as the host read it, N: without the delay of the recorder's time stamps."""
        return stamped(recorded, -self._of.force_stamp * self.rig.frame_rate)

    @property
    def curve(self) -> DeflectionReading:
        """The curve of the transducer of δc, before its scale."""
        return self._of.deflection_curve

    def _unread(self, read: Floats) -> Floats:
        of = self._of
        if of.force_scale != 1.0 or of.force_zero != 0.0:
            read = (read - of.force_zero) / of.force_scale
        return of.force_curve.inverse(read)


PRESSURE, LOAD = "dynamic_pressure_Pa", "load_factor"


def in_trim(rig: Rig, trim: Mapping[str, Any]) -> Rig:
    """Return a rig with the fields of a trim in its `flight`."""
    if rig.flight is None or not trim:
        return rig
    return rig.model_copy(update={"flight": rig.flight.model_copy(update={**trim})})


@dataclass(frozen=True)
class Reading:
    """A record of one control of a rig: its channels, and the missing ones."""

    rig: Rig
    record: Record
    control: ControlName
    # The map from a control's commands to surface positions; None if the aircraft moves it too.
    surface_points: Callable[[Rig, ControlName], tuple[Floats, Floats] | None]
    number: int = 0  # of the record, where there are several
    # Fields of the rig's `flight` with the trim of this record, if it is not that of the first.
    trim: Mapping[str, Any] = field(default_factory=dict)

    def under(self, rig: Rig) -> Self:
        """Return the reading with another rig, in the trim of the record."""
        return replace(self, rig=in_trim(rig, self.trim))

    @cached_property
    def missed(self) -> Missed:
        """The frames that the host missed."""
        return missed_in(self.record)

    @cached_property
    def live(self) -> Live | None:
        """The parts of a live record that can be judged; None for other records."""
        return live_of(self.record)

    @property
    def judged(self) -> Mask | None:
        """The rows in which stages of the loader are judged; None for all."""
        judged = None if self.live is None or self.live.judged.all() else self.live.judged
        if not self.begins_moved:
            return judged
        settled = np.arange(len(self.record)) >= SETTLE_s * self.rig.frame_rate
        return settled if judged is None else judged & settled

    @cached_property
    def begins_moved(self) -> bool:
        """Whether the loader is displaced or moves as the record begins, as after a cut.

        A replay then begins at the measured state, and not at rest at neutral.
        """
        name = self.name_of("deflection" if self.in_series else "computed")
        if name not in self.record or self.moved or self.set_points:
            return False
        place = smoothed(self._measured(name))
        rate = np.gradient(place)
        away = abs(float(place[0])) > MINOR * float(np.ptp(place))
        return away or abs(float(rate[0])) > PARTLY * float(np.std(rate))

    def assumed(self) -> Assumed | None:
        """Return K̂ in use, if it changed in flight."""
        return None if self.live is None else self.live.assumed.get(self.control)

    def signal(self, quantity: str) -> Floats:
        """Return a control's channel; of a live loader, at equal steps of its clock."""
        return self._measured(channel(self.control, quantity))

    def as_read(self, quantity: str) -> Floats:
        """Return a control's channel as the host read it."""
        return self.record[channel(self.control, quantity)]

    def _measured(self, name: str) -> Floats:
        signals = {} if self.live is None else self.live.signals
        return signals[name] if name in signals else self.record[name]

    def _quiet(self, name: str) -> Floats:
        """Return a channel in the rows from which its noise is estimated."""
        signal = self._measured(name)
        return signal if self.live is None else signal[self.live.quiet]

    def partner(self) -> list[Floats]:
        """Return the force in N on the control with crosstalk into this one, if recorded."""
        names = [channel(name, "force") for name in leaking(self.control)]
        return [self._measured(name) for name in names if name in self.record][:1]

    def other_inputs(self) -> Callable[[Rig], OtherInputs]:
        """Return the loader's inputs beside force and motion, as a function of the rig.

        The load factor at the bob weight acts without the delay of its time stamp.
        """
        regressor = self.regressor()
        if LOAD not in self.record:
            return lambda rig: OtherInputs(None, regressor)
        read, rate_Hz = smoothed(self.record[LOAD]), self.rig.frame_rate

        def stamped_as(rig: Rig) -> OtherInputs:
            late_s = rig.flight.motion_stamp if rig.flight else 0.0
            return OtherInputs(stamped(read, -late_s * rate_Hz), regressor)

        return stamped_as

    def regressor(self) -> Floats | None:
        """Return the channel on which force and friction depend, less its reference, or None."""
        loader = self.rig.controls[self.control].loader
        if loader.regressor is None:
            return None
        return smoothed(self.record[loader.regressor]) - loader.regressor_reference

    def sensed(self, rig: Rig) -> Sensed:
        """Return the conversion of a rig's readings of this control to the measured quantities."""
        return Sensed(rig, self.control, self.number)

    def others(self, as_read: bool = False) -> dict[str, Floats]:
        """Return the forces in N on other controls of a common structure, if recorded.

        `as_read` by the host, or smoothed; of a live loader at equal steps of its clock.
        """
        if self.rig.structure.stands_apart:
            return {}
        held = {str(n): channel(n, "force") for n in self.rig.controls if n != self.control}
        held = {name: force for name, force in held.items() if force in self.record}
        if as_read:
            return {name: self.record[force] for name, force in held.items()}
        return {name: smoothed(self._measured(force)) for name, force in held.items()}

    def missing(self) -> dict[str, list[str]]:
        """Return the channels that each stage needs and the record does not have."""
        if not self.rig.controls:  # an aircraft alone has none of these stages
            return {}
        feel = self._feel_from()

        def of(*quantities: str) -> list[str]:
            return [self.name_of(quantity) for quantity in quantities]

        needs = {
            "schedule": [PRESSURE, *of("gradient"), *of("computed") * self.schedule.curved],
            "loader": [*of("force", "computed"), *feel],
            "multiplier": [*of("computed", "modifying_force"), *feel],
            "linkage": of("computed", "force", "deflection"),
            "compensation": of("computed", "force", "estimate"),
            "surface": [*of("estimate"), PRESSURE, f"{SURFACES[self.control]}_rad"],
        }
        if self.moved:
            loader = [*of("force", self.imposed), *feel]
            needs = {"schedule": needs["schedule"], "loader": loader}
        elif self.in_series:
            del needs["linkage"]
            needs["loader"] = [*of("force", "deflection"), *feel]
        elif self.set_points:  # without the force only a bend cannot be identified
            needs["linkage"] = of("computed", "deflection")
        lacking = {s: [n for n in names if n not in self.record] for s, names in needs.items()}
        return {stage: names for stage, names in lacking.items() if names}

    @property
    def set_points(self) -> bool:
        """Whether δc is a command, so that there is no loader to judge."""
        return self._drive == "setpoint"

    @property
    def moved(self) -> bool:
        """Whether the motion is imposed, and the force is the judged output."""
        return self.by_hand and not self.in_series

    @property
    def by_hand(self) -> bool:
        """Whether a bench imposes the motion of the grip."""
        return self._drive == "displacement"

    @property
    def _drive(self) -> str:
        data = self.rig.controls.get(self.control)
        return "" if data is None else data.drive

    @property
    def in_series(self) -> bool:
        """Whether the record has F and δ without δc: loader and linkage are judged in series.

        With imposed motion, only if a spring holds the loader and carries most of the force.
        """
        if self.set_points or self.name_of("computed") in self.record:
            return False
        needed = [self.name_of(quantity) for quantity in ("force", "deflection")]
        if not all(name in self.record for name in needed):
            return False
        if not self.by_hand:
            return True
        softest = softest_gradient(self.rig, self.control, self.record)
        force, motion = (float(np.std(self.record[name])) for name in needed)
        holds = softest * motion > MOST * force
        return holds and not drifts(self.rig, self.control, softest)

    @property
    def imposed(self) -> str:
        """The imposed quantity: the grip's motion if recorded, else δc."""
        return "deflection" if self.name_of("deflection") in self.record else "computed"

    def commanded(self) -> Drive:
        """Return δc as the input of the linkage; a set point has no noise."""
        computed = self.signal("computed")
        if self.set_points:
            return Drive.of(computed, Noise(0.0))
        return Drive.of(computed, self.driving("computed"))

    def pulled(self) -> Drive:
        """Return F as the input of loader and linkage; zero if not recorded."""
        if self.name_of("force") not in self.record:
            return Drive.of(np.zeros(len(self.record)), Noise(0.0))
        return Drive.of(self.signal("force"), self.driving("force"), with_corners=True)

    def name_of(self, quantity: str) -> str:
        """Return the name of a quantity's channel."""
        return channel(self.control, quantity)

    @property
    def schedule(self) -> Schedule:
        """The schedule of the control."""
        return self.rig.controls[self.control].schedule

    def _feel_from(self) -> list[str]:
        """Return the channel that the loader's feel needs; none if the feel is the same at any q̄.

        It is q̄ for several segments, else G_T, which q̄ may replace.
        """
        own = self.name_of("gradient")
        if is_constant(self.schedule):
            return []
        if len(self.schedule.segments) > 1 or (PRESSURE in self.record and own not in self.record):
            return [PRESSURE]
        return [own]

    def services(self) -> ServiceRows | None:
        """Return the rows of trim, autopilot and stick pusher; None if the record has none.

        They act in the replay as recorded, and are no effect.
        """
        return service_rows(self.record, self.control)

    def feel_left(self) -> Floats | float:
        """Return the share of G_T that remains after a failure of the artificial feel."""
        rows = self.services()
        return 1.0 if rows is None else 1.0 - rows.feel_lost

    def neutral(self) -> Floats | float:
        """Return the deflection about which F_mod acts, d."""
        rows = self.services()
        return 0.0 if rows is None else rows.neutral

    def feel(self) -> Feel:
        """Return what the host specified: G_T as recorded, else of the nominal schedule at q̄.

        G_T beyond the break is never recorded, and a curve is always that of q̄.
        """
        own, share, schedule = self.name_of("gradient"), self.feel_left(), self.schedule
        pressure = np.full(len(self.record), schedule.dynamic_pressure[0])
        if PRESSURE in self.record:
            pressure = smoothed(self.record[PRESSURE])
        if schedule.curved:
            softest = np.full(len(self.record), min(map(min, schedule.segments)))
            return Feel(softest * share, None, pressure, share)
        first, second = (
            replay_schedule(self.rig, self.control, pressure, beyond) * share
            for beyond in (False, True)
        )
        given = self.signal("gradient") if own in self.record else first
        return Feel(given, None if schedule.second_gradient is None else second)

    def channel_noise(self, quantity: str) -> Noise:
        """Return the noise of a control's channel."""
        name = self.name_of(quantity)
        return noise_in(self.rig, name, self._quiet(name))

    def driving(self, quantity: str) -> Noise:
        """Return the noise of a control's channel as an input, without a broadband signal.

        If the signal jumps often, as a torque held in steps, the noise between jumps counts.
        """
        estimated, signal = self.channel_noise(quantity), self._quiet(self.name_of(quantity))
        found = None if estimated.filtered else noise_of_input(signal)
        known = [estimated if found is None else above_rounding(found, signal)]
        if jumps(signal):
            known.append(above_rounding(between_jumps(signal), signal))
        return min(known, key=lambda one: one.rms)

    def filtered(self) -> dict[str, str]:
        """Return {filtered channel of the control: source of its noise floor}."""
        names = [self.name_of(quantity) for quantity in ("force", "computed", "deflection")]
        return {
            name: floor_from(self.rig, name, self._quiet(name))
            for name in names
            if name in self.record and noise_of(self._quiet(name)).filtered
        }


def drifts(rig: Rig, control: ControlName, gradient: float) -> bool:
    """Tell whether a prediction from the force would drift, for lack of a spring.

    Then the loader's own period exceeds `SHORTEST_RECORD_s` at a gradient in N/d.
    """
    mass = rig.controls[control].loader.mass
    return max(gradient, 0.0) * SHORTEST_RECORD_s**2 < 4.0 * np.pi**2 * mass


def softest_gradient(rig: Rig, control: ControlName, record: Record) -> float:
    """Return a record's least gradient, N/d: as recorded, else from its q̄, else the table's.

    Of a curve, that of its softest segment.
    """
    gradient, schedule = channel(control, "gradient"), rig.controls[control].schedule
    if schedule.curved:
        return min(map(min, schedule.segments))
    if gradient in record:
        return float(np.min(record[gradient]))
    if PRESSURE in record:
        return float(np.min(specified_gradient(schedule, record[PRESSURE])))
    return min(schedule.total_gradient)


def is_constant(schedule: Schedule) -> bool:
    """Return whether a control's feel is the same at any q̄."""
    return all(g == row[0] for row in schedule.segments for g in row)


def worth_recording(
    rig: Rig, control: ControlName, stage: str, channels: Sequence[str]
) -> set[str]:
    """Return the missing channels of a stage that belong to hardware of the rig.

    A bench without a host has no estimate, a slide without a spring no schedule, a rig file
    without bend and backlash no second transducer, a rig without an aircraft no surface.
    """
    data = rig.controls[control]
    host = rig.flight is not None or data.compensation.deflection or data.compensation.gradient
    scheduled = not is_constant(data.schedule)
    soft = any((data.loader.bend, data.loader.play, data.loader.arc_geometry))
    has = {"schedule": scheduled, "compensation": host, "linkage": host or soft}
    has["surface"] = rig.flight is not None
    if not has.get(stage, True):
        return set()
    by_schedule = set() if scheduled or host else {PRESSURE, channel(control, "gradient")}
    return set(channels) - by_schedule
