"""Simulated flights with the force of a record, or with that of a proposed test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import Action, Pilot
from coupled.flight.pilot.base import Start
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.air import vertical_air
from coupled.gap.stages.surfaces import surface_channel
from coupled.gap.thresholds import PROFILE_EVERY, SAME_FLIGHT
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.schema import SMALLEST

Floats = NDArray[np.float64]
COMPARED = ("deflection", "computed")  # of the control, and of the motion:
MOTION = ("pitch_rate_rad_per_s", "load_factor", "pitch_rad")
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
        known = {"before_s": self.before_s, "after_s": self.after_s}
        found = {"before": self.before, "after": self.after}
        return found | {name: value for name, value in known.items() if value is not None}


def nearer(channels: Sequence[ChannelAgain]) -> bool:
    """Tell whether `after` is no larger than `before`, by the geometric mean over channels."""
    ratios = [one.after / one.before for one in channels if one.before > 0.0]
    return not ratios or float(np.mean(np.log(np.maximum(ratios, 1e-12)))) <= SAME_FLIGHT


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
    air_m_per_s: Floats | None = None,
    seed: int = 0,
) -> Record:
    """Return the record of a rig under forces given at each frame, shape (frames,) each.

    `pressure_Pa` is the q̄ of a bench, `air_m_per_s` the vertical speed of the air, both by frame.
    """
    frames = len(next(iter(forces_N.values())))
    times = np.arange(frames) / rig.frame_rate
    pilots: dict[ControlName, Pilot] = {
        control: Recorded(times=times.tolist(), forces=_felt(force).tolist())
        for control, force in forces_N.items()
    }
    bench = None
    if rig.flight is None:
        assert pressure_Pa is not None
        points = slice(None, None, PROFILE_EVERY)
        bench = PressureProfile(time_s=times[points], dynamic_pressure_Pa=pressure_Pa[points])
    again = Manoeuvre(
        rig, pilots, frames / rig.frame_rate, seed=seed, bench=bench, name="flown-again"
    )
    air = None if air_m_per_s is None else air_m_per_s[1:].tolist()
    return fly(again, air_m_per_s=air)


@dataclass
class Again:
    """Flies rigs with the force of a record, and caches their flights.

    `pulled` are the forces on each control, N, and `pressure` a bench's q̄, Pa, at each frame.
    """

    record: Record
    pulled: Mapping[ControlName, Floats]
    pressure: Floats | None
    _flown: list[tuple[Rig, Record | None]] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, nominal: Rig, controls: Sequence[ControlName], record: Record) -> Again | None:
        """Return the simulation; None if the record lacks a control's force, or a bench's q̄."""
        pressure = "dynamic_pressure_Pa"
        forces = {name: channel(name, "force") for name in nominal.controls}
        pulled = {n: smoothed(record[force]) for n, force in forces.items() if force in record}
        lacks_pressure = nominal.flight is None and pressure not in record
        if not pulled or not pulled.keys() >= {*controls} or lacks_pressure:
            return None
        return cls(record, pulled, smoothed(record[pressure]) if pressure in record else None)

    def fly(self, rig: Rig) -> Record | None:
        """Return a rig's flight without noise; None if it cannot be flown."""
        quiet = rig.changed({"noise": {}})
        for known, flown in self._flown:
            if known == quiet:
                return flown
        gusts = rig.flight is not None and rig.flight.gust_rms > 0.0
        air = vertical_air(self.record, 1.0 / rig.frame_rate) if gusts else None
        made: Record | None
        try:
            made = fly_force(quiet, self.pulled, self.pressure, None if air is None else air.speed)
        except InputError:
            made = None
        self._flown.append((quiet, made))
        return made


def closed_loop(
    nominal: Rig,
    improved: Rig,
    controls: Sequence[ControlName],
    record: Record,
    again: Again | None = None,
) -> tuple[ChannelAgain, ...] | None:
    """Return the RMS differences from the record of both rigs, flown with the controls' forces.

    `again` is the simulation, if it exists already. None if the record lacks a force or a
    bench's q̄, or if a rig cannot be flown.
    """
    if not nominal.controls or any(nominal.controls[c].drive != "force" for c in controls):
        return None
    again = Again.of(nominal, controls, record) if again is None else again
    if again is None:
        return None
    names = [channel(control, quantity) for control in controls for quantity in COMPARED]
    motion = [*map(surface_channel, controls), *MOTION, *LATERAL]
    motion = motion if nominal.flight is not None else []
    names = [name for name in (*names, *motion) if name in record]
    before, after = (_differences(again, rig, names) for rig in (nominal, improved))
    if before is None or after is None:
        return None
    seconds = (before.seconds, after.seconds) if before.seconds != after.seconds else (None, None)
    return tuple(ChannelAgain(name, before.rms[name], after.rms[name], *seconds) for name in names)


def _felt(force: Floats) -> Floats:
    """Return a force with values below the smallest that a rig file accepts set to zero."""
    return np.where(np.abs(force) < SMALLEST, 0.0, force)


@dataclass(frozen=True)
class _Differences:
    """RMS differences of a flight from a record by channel, over the seconds that both last."""

    rms: Mapping[str, float]
    seconds: float


def _differences(again: Again, rig: Rig, names: Sequence[str]) -> _Differences | None:
    """Return the differences of a rig's flight from a record; None if it cannot be flown."""
    flown, record = again.fly(rig), again.record
    if flown is None:
        return None
    rows = min(len(flown), len(record))
    rms = {n: float(np.sqrt(np.mean((flown[n][:rows] - record[n][:rows]) ** 2))) for n in names}
    return _Differences(rms, rows / rig.frame_rate)
