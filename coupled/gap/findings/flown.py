"""The flight of the improved rig, and what each effect changes in it.

A flight has the force of a record, or that of a proposed test. The size of a gap does not show its
importance for the flight: a loader gap of 100 may hardly move the aircraft. With and without the
effects, the flights differ in pitch rate, load factor and surface. Each effect's share of this
difference is its Shapley value. The effect with the largest share should be corrected first.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from coupled.display import percent, split_unit
from coupled.errors import InputError, joined
from coupled.flight.gusts import DRAWN, GivenAir
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import Action, Pilot
from coupled.flight.pilot.base import Start
from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.budget import shapley_subsets
from coupled.gap.findings.result import labelled
from coupled.gap.findings.summary import plain
from coupled.gap.noise.noise import rms_of
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.output import Floats
from coupled.gap.signals.reading import LOAD, PRESSURE, drifts, softest_gradient
from coupled.gap.stages.airframe import gusts_of, has_gusts
from coupled.gap.stages.surfaces import surface_channel
from coupled.gap.thresholds import NEGLIGIBLE, SHORT_FRAMES
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.results import Plain
from coupled.rig.rig import Rig
from coupled.schema import SMALLEST

COMPARED = ("deflection", "computed")  # of the control, and of the motion:
MOTION = ("pitch_rate_rad_per_s", LOAD, "pitch_rad")
LATERAL = ("roll_rate_rad_per_s", "yaw_rate_rad_per_s")


@dataclass(frozen=True)
class ChannelAgain:
    """RMS differences of two flights from the record whose force they use, in the channel's unit.

    `before` is with the filed rig, `after` with the improved rig. The seconds compared are given
    if one of the flights ended early.
    """

    channel: str
    before: float
    after: float
    before_s: float | None = None
    after_s: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        known = {name: value for name, value in vars(self).items() if name != "channel"}
        return {name: value for name, value in known.items() if value is not None}


def nearer(channels: Sequence[ChannelAgain]) -> bool:
    """Tell whether `after` is no larger than `before`, by the geometric mean over channels."""
    ratios = [one.after / one.before for one in channels if one.before > 0.0]
    return not ratios or float(np.mean(np.log(np.maximum(ratios, 1e-12)))) <= NEGLIGIBLE


class Recorded(Pilot):
    """Applies a recorded force, N, at times in s."""

    kind: Literal["recorded"] = "recorded"
    times: list[float]
    forces: list[float]

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the recorded force, interpolated linearly between its samples."""
        times, forces = np.array(self.times), np.array(self.forces)
        return Action(force=lambda t: np.interp(t, times, forces))


def fly_force(
    rig: Rig,
    forces_N: Mapping[ControlName, Floats],
    pressure_Pa: Floats | None = None,
    air: GivenAir = DRAWN,
    seed: int = 0,
) -> Record:
    """Return the record of a rig under forces given at each frame, shape (frames,) each.

    `pressure_Pa` is the q̄ of a bench by frame, `air` the motion of the air.
    """
    frames = len(next(iter(forces_N.values())))
    times = np.arange(frames) / rig.frame_rate
    pilots: dict[ControlName, Pilot] = {}
    for control, force in forces_N.items():
        felt = np.where(np.abs(force) < SMALLEST, 0.0, force)  # as a rig file accepts it
        pilots[control] = Recorded(times=times.tolist(), forces=felt.tolist())
    bench = None
    if rig.flight is None:
        assert pressure_Pa is not None
        points = slice(None, None, SHORT_FRAMES)
        bench = PressureProfile(time_s=times[points], dynamic_pressure_Pa=pressure_Pa[points])
    lasts_s = frames / rig.frame_rate
    return fly(Manoeuvre(rig, pilots, lasts_s, seed=seed, bench=bench, name="flown-again"), air=air)


@dataclass
class Again:
    """Flies rigs with the force of a record, and caches their flights.

    `pulled` are the forces on each control, N, and `pressure` a bench's q̄, Pa, at each frame.
    """

    record: Record
    nominal: Rig
    pulled: Mapping[ControlName, Floats]
    pressure: Floats | None
    _flown: list[tuple[Rig, Record | None]] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, nominal: Rig, controls: Sequence[ControlName], record: Record) -> Again | None:
        """Return the simulation; None if the record lacks a control's force, or a bench's q̄."""
        forces = {name: channel(name, "force") for name in nominal.controls}
        pulled = {n: smoothed(record[force]) for n, force in forces.items() if force in record}
        pressure = smoothed(record[PRESSURE]) if PRESSURE in record else None
        lacks_pressure = nominal.flight is None and pressure is None
        if not pulled or not pulled.keys() >= {*controls} or lacks_pressure:
            return None
        return cls(record, nominal, pulled, pressure)

    def fly(self, rig: Rig) -> Record | None:
        """Return a rig's flight without noise; None if it cannot be flown."""
        quiet = rig.changed({"noise": {}})
        for known, flown in self._flown:
            if known == quiet:
                return flown
        air = DRAWN
        made: Record | None = None
        if rig.flight is not None and has_gusts(rig.flight):
            model = gusts_of(self.nominal, self.record)
            air = DRAWN if model is None else model.air(rig.flight)
        with suppress(InputError):
            made = fly_force(quiet, self.pulled, self.pressure, air)
        self._flown.append((quiet, made))
        return made

    def differences(self, rig: Rig, names: Sequence[str]) -> tuple[dict[str, float], float] | None:
        """Return the RMS differences of a rig's flight from the record, and its time, s."""
        flown, record = self.fly(rig), self.record
        if flown is None:
            return None
        rows = min(len(flown), len(record))
        rms = {n: rms_of(flown[n][:rows] - record[n][:rows]) for n in names}
        return rms, rows / rig.frame_rate


def closed_loop(
    nominal: Rig, improved: Rig, controls: Sequence[ControlName], again: Again | None
) -> tuple[ChannelAgain, ...] | None:
    """Return the RMS differences from the record of both rigs, flown with the controls' forces.

    None without a simulation, if a control is not moved by force, or if a rig cannot be flown. A
    bench without a spring is not flown: its motion would drift with any error of the force.
    """
    by_force = nominal.controls and all(nominal.controls[c].drive == "force" for c in controls)
    if again is None or not by_force:
        return None
    if nominal.flight is None and any(
        drifts(nominal, c, softest_gradient(nominal, c, again.record)) for c in controls
    ):
        return None
    names = [channel(control, quantity) for control in controls for quantity in COMPARED]
    motion = [*map(surface_channel, controls), *MOTION, *LATERAL]
    motion = motion if nominal.flight is not None else []
    names = [name for name in (*names, *motion) if name in again.record]
    before, after = (again.differences(rig, names) for rig in (nominal, improved))
    if before is None or after is None:
        return None
    (rms, over_s), (rms_after, after_s) = before, after
    seconds = (over_s, after_s) if over_s != after_s else (None, None)
    return tuple(ChannelAgain(name, rms[name], rms_after[name], *seconds) for name in names)


RATES: Mapping[ControlName, tuple[str, ...]] = {
    "column": ("pitch_rate_rad_per_s", LOAD),
    "wheel": ("roll_rate_rad_per_s",),
    "pedals": ("yaw_rate_rad_per_s",),
}


@dataclass(frozen=True)
class EffectInFlight(Plain):
    """The change of the flight by one effect, by channel.

    `shares` are of the power of the change by all effects, sum 1; negative if the effect
    counteracts the others. `changes` are the RMS differences if the effect is removed, in the
    channel's unit; `of_motion` the same over the RMS of the channel's motion, with all effects or
    with none, whichever is larger. `share` is over all channels, each normalised by its motion.
    """

    name: str
    share: float
    shares: Mapping[str, float]
    changes: Mapping[str, float]
    of_motion: Mapping[str, float]
    control: ControlName | None = None

    @property
    def shows(self) -> bool:
        """Whether removing the effect changes any channel by at least `NEGLIGIBLE`."""
        return any(value >= NEGLIGIBLE for value in self.of_motion.values())


def in_flight(
    effects: Sequence[tuple[ControlName | None, str]],
    rig_with: Callable[[Sequence[int]], Rig],
    controls: Sequence[ControlName],
    again: Again,
) -> tuple[EffectInFlight, ...] | None:
    """Return the change of the flight by each effect, largest first; None if it cannot be flown.

    `effects` are the control and the name of each, `rig_with` returns the rig with those of the
    given indices. Time stamps of the recorder are zero, since they do not affect the flight.
    """
    if rig_with(()).flight is None or not effects:
        return None
    subsets, weights = shapley_subsets(count := len(effects))
    flights = []
    for subset in subsets:
        kept = [i for i in range(count) if subset & 1 << i]
        flown = again.fly(_unstamped(rig_with(kept), controls))
        if flown is None:
            return None
        flights.append(flown)
    known = (BY_NAME.get(name) for _, name in effects)  # a term of the model is not in the library
    turning = RATES if any(e is None or e.stage == AIRFRAME for e in known) else controls
    shown = [*(name for c in turning for name in RATES[c]), *map(surface_channel, controls)]
    names = [name for name in shown if name in flights[-1]]
    rows = min(len(flown) for flown in flights)
    whole = np.array([flights[-1][name][:rows] for name in names])
    each = np.array([[flown[name][:rows] for name in names] for flown in flights])
    power = np.mean((each - whole) ** 2, axis=2)  # (subsets, channels)
    # An effect may suppress a motion, so the motion is the larger with or without effects.
    moved = np.mean((each - each[:, :, :1]) ** 2, axis=2)
    motion = np.sqrt(np.maximum(moved[0], moved[-1]))
    shares = weights @ power
    changed = np.flatnonzero((motion > 0.0) & (power[0] > (1e-3 * NEGLIGIBLE * motion) ** 2))
    weight = 1.0 / motion[changed] ** 2
    total = float(power[0, changed] @ weight)

    def of(i: int) -> EffectInFlight:
        without = np.sqrt(power[subsets.index(subsets[-1] - (1 << i))])
        relative = np.divide(without, motion, out=np.zeros_like(without), where=motion > 0.0)
        control, name = effects[i]
        return EffectInFlight(
            name,
            float(shares[i, changed] @ weight) / total if total > 0.0 else 0.0,
            {names[c]: float(shares[i, c] / power[0, c]) for c in changed},
            dict(zip(names, without.tolist(), strict=True)),
            dict(zip(names, relative.tolist(), strict=True)),
            control,
        )

    return tuple(sorted(map(of, range(count)), key=lambda one: -one.share))


def _unstamped(rig: Rig, controls: Sequence[ControlName]) -> Rig:
    """Return a rig whose recorder stamps all channels without delay."""
    stamps = {f"controls.{name}.sensing.force_stamp_s": 0.0 for name in controls}
    late = rig.flight is not None and rig.flight.motion_stamp != 0.0
    late = late or any(rig.controls[name].sensing.force_stamp != 0.0 for name in controls)
    return rig.changed({"flight.motion_stamp_s": 0.0, **stamps}) if late else rig


def in_words(effects: Sequence[EffectInFlight], credible: Collection[str]) -> str:
    """Return how the effects change the flight, and which of the `credible` to correct first."""
    shown = [effect for effect in effects if effect.shows]
    if not shown:
        return "In flight the effect is small: no channel of the motion changes by 1 %."
    if len(effects) == 1:
        (only,) = effects
        moved = ((plain(split_unit(name)[0]), by) for name, by in only.of_motion.items())
        parts = [f"the {name} by {_per_cent(by)}" for name, by in moved]
        return f"In flight the effect changes {joined(parts)} of their rms."
    shares = {labelled(e.name, e.control): _per_cent(e.share) for e in effects}
    parts = [f"{label} {share}" for label, share in shares.items()]
    first = next((f" Correct {label} first." for label in shares if label in credible), "")
    return f"Shares of the change in flight: {joined(parts)}.{first}"


def _per_cent(share: float) -> str:
    return percent(share, 0 if abs(share) >= 0.095 else 1)
