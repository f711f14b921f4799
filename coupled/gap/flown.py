"""Flying a rig with the pilot of a record, and making the record of a test not flown yet."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import Action, Pilot
from coupled.flight.pilot.base import Start
from coupled.gap.air import vertical_air
from coupled.gap.smooth import smoothed
from coupled.gap.surfaces import surface_channel
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
COMPARED = ("deflection", "computed")  # of the control, and of the motion:
MOTION = ("pitch_rate_rad_per_s", "load_factor", "pitch_rad")
LATERAL = ("roll_rate_rad_per_s", "yaw_rate_rad_per_s")
TOLD_EVERY = 12  # frames between the points at which a bench is told q̄


class Recorded(Pilot):
    """Repeats a force, N, given at times in s."""

    kind: Literal["recorded"] = "recorded"
    times: list[float]
    forces: list[float]

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the recorded force, straight between its samples."""
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

    `pressure_Pa` is what a bench is told, at each frame; `air_m_per_s` how fast the air rises.
    """
    frames = len(next(iter(forces_N.values())))
    times = np.arange(frames) / rig.frame_rate
    pilots: dict[ControlName, Pilot] = {
        control: Recorded(times=times.tolist(), forces=force.tolist())
        for control, force in forces_N.items()
    }
    bench = None
    if rig.flight is None:
        assert pressure_Pa is not None
        told = slice(None, None, TOLD_EVERY)
        bench = PressureProfile(time_s=times[told], dynamic_pressure_Pa=pressure_Pa[told])
    again = Manoeuvre(
        rig, pilots, frames / rig.frame_rate, seed=seed, bench=bench, name="flown-again"
    )
    air = None if air_m_per_s is None else air_m_per_s[1:].tolist()
    return fly(again, air_m_per_s=air)


def closed_loop(
    nominal: Rig, improved: Rig, control: ControlName, record: Record
) -> dict[str, Any] | None:
    """Return how far the flights of both rigs, with the record's pilot, stay from the record.

    rms differences by channel, in its unit: {channel: {"before", "after"}}. None where the
    record lacks the force, or a bench's q̄, or where the rig cannot be flown so.
    """
    pressure = "dynamic_pressure_Pa"
    forces = {name: channel(name, "force") for name in nominal.controls}
    pulled = {name: smoothed(record[force]) for name, force in forces.items() if force in record}
    if control not in pulled or (nominal.flight is None and pressure not in record):
        return None
    names = [channel(control, quantity) for quantity in COMPARED]
    surface = surface_channel(control)
    motion = [surface, *MOTION, *(() if control == "column" else LATERAL)]
    motion = motion if nominal.flight is not None else []
    names = [name for name in (*names, *motion) if name in record]
    told = smoothed(record[pressure]) if pressure in record else None
    left: dict[str, dict[str, float]] = {name: {} for name in names}
    for when, rig in (("before", nominal), ("after", improved)):
        gusts = rig.flight is not None and rig.flight.gust_rms > 0.0
        told_air = vertical_air(record, 1.0 / rig.frame_rate) if gusts else None
        air = None if told_air is None else told_air.speed
        quiet = rig.model_copy(update={"noise": {}})
        try:
            flown = fly_force(quiet, pulled, told, air)
        except InputError:
            return None
        rows = min(len(flown), len(record))
        for name in names:
            difference = flown[name][:rows] - record[name][:rows]
            left[name][when] = float(np.sqrt(np.mean(difference**2)))
        left_seconds = rows / rig.frame_rate
        for name in names:
            left[name][f"{when}_s"] = left_seconds
    return _worth(left)


def _worth(left: Mapping[str, Mapping[str, float]]) -> dict[str, Any]:
    """Return the differences; the time flown only where it is not the same for both."""
    found: dict[str, Any] = {}
    for name, item in left.items():
        found[name] = {"before": item["before"], "after": item["after"]}
        if item["before_s"] != item["after_s"]:
            found[name] |= {"before_s": item["before_s"], "after_s": item["after_s"]}
    return found
