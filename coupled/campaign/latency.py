"""Latency: the delay of a simulator's response after that of the aircraft (Part 60, 4.a).

The rule counts from the aircraft's own response to an abrupt command at the control. That response
is simulated: the same aircraft and hand, on the same rig without delays, at frames of half a
millisecond. Responses of the aircraft and of the control's mass and spring are in both and cancel;
the difference is the simulator's.

A response begins when the rate of pitch, roll or yaw reaches 5 % of its largest value within a
second. A pure delay is then measured exactly, and a smaller response does not count as a later one.
A host that takes the force at t_k adds a frame and a half: half a frame while the command is held,
and one in JSBSim, which integrates this frame's moment to the next one's rate.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.authority.compare import Flight, fly_and_judge
from coupled.flight.conditions import Conditions
from coupled.flight.expectation import UnjudgedError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Attitude, Clamp, Track
from coupled.flight.pilot.own import OwnPilot
from coupled.record.channels import RATE, ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
UNDELAYED = "with nothing late"  # configuration name of the reference
REFERENCE_Hz = 2000.0
FRAMES_LATE = 1.5  # of a host and JSBSim; subtracted from the reference
RESPONSE_SHARE = 0.05  # of the largest rate
WITHIN_s = 1.0  # of the beginning, in which the largest rate is searched
_ROUNDS = 100  # at most; a response of two parts takes some ten
_SETTLED_s = 1e-6

# The delays between hand and surface, and their values in the reference.
AT_ONCE: dict[str, Any] = {
    "loader.delay_s": 0.0,
    "loader.modifying_lag_s": 0.0,
    "loader.multiplier": "hybrid",
    "loader.bend_frequency_Hz": 0.0,
    "schedule.pressure_lag_s": 0.0,
    "compensation.missed_share": 0.0,
    "compensation.inertia_gradient_N_per_{d}": None,
    "compensation.mass_factor": None,
    "compensation.damping_factor": None,
    "compensation.force_lead_s": None,
    "sensing.gauge_mass_kg": 0.0,
    "sensing.gauge_frequency_Hz": 0.0,
    "sensing.gauge_delay_s": 0.0,
    "sensing.gauge_sampling_Hz": 0.0,
    "sensing.computed_skew_s": 0.0,
    "sensing.force_skew_s": 0.0,
    "sensing.gradient_skew_s": 0.0,
    "rigging.lag_s": 0.0,
    "rigging.rate_limit_norm_per_s": 0.0,
    "rigging.play_norm": 0.0,
}


def undelayed_rig(rig: Rig) -> Rig:
    """Return the rig without delays between hand and surface."""
    changes: dict[str, Any] = {"frame_rate_Hz": REFERENCE_Hz, "noise": {}}
    changes["loader_rate_Hz"] = max(rig.loader_rate, REFERENCE_Hz)
    if rig.flight is not None:
        changes["flight.steps_per_frame"] = 1
    for name in rig.controls:
        d = "rad" if name == "wheel" else "m"
        for key, value in AT_ONCE.items():
            changes[f"controls.{name}.{key.format(d=d)}"] = value
    return rig.changed(changes)


def fly_undelayed(manoeuvre: Manoeuvre, progress: Any = None) -> Flight:
    """Fly a manoeuvre in its configuration, without delays."""
    rig = undelayed_rig(manoeuvre.rig)
    return fly_and_judge(replace(manoeuvre, rig=rig), UNDELAYED, progress)


def latency_s(control: ControlName, flight: Flight, reference: Flight) -> float:
    """Return the delay of a flight's response to a control after the reference's, s.

    Raises UnjudgedError if the flight is not a valid test.
    """
    _check_flight(control, flight.manoeuvre)
    begun_s = _command_start(reference.record, control)
    own = _response_start(reference.record, control, begun_s)
    late = 0.0
    for _ in range(_ROUNDS):  # the second with the largest rate is delayed as well
        before, late = late, _response_start(flight.record, control, begun_s + late) - own
        if abs(late - before) <= _SETTLED_s:
            break
    return late + FRAMES_LATE / REFERENCE_Hz


def _check_flight(control: ControlName, manoeuvre: Manoeuvre) -> None:
    pilot = manoeuvre.pilots.get(control)
    if pilot is None or isinstance(pilot, Attitude | Clamp | Track | OwnPilot):
        problem = f"latency needs a force on the {control} that the rig does not change"
        raise UnjudgedError(f"{problem}: step, ramp, doublet, 3211, sweep or table")
    flight = manoeuvre.rig.flight
    if manoeuvre.conditions != Conditions() or (flight is not None and not flight.still):
        raise UnjudgedError("latency is measured in still air and without events")


def _command_start(record: Record, control: ControlName) -> float:
    """Return the start time of the pilot's force, s."""
    force = record[channel(control, "hand_force")]
    moved = np.flatnonzero(force != force[0])
    if not moved.size:
        raise UnjudgedError(f"no force acts on the {control}")
    return float(record.time_s[max(int(moved[0]) - 1, 0)])


def _response_start(record: Record, control: ControlName, begun_s: float) -> float:
    """Return the start time of the response in the rate that a control causes, s.

    It is the last time before the largest rate at which the rate was below `RESPONSE_SHARE` of it,
    interpolated between rows, so that noise does not count.
    """
    time_s, rate = record.time_s, record[RATE[control]]
    if begun_s + WITHIN_s > time_s[-1]:
        raise UnjudgedError(f"the run lacks {WITHIN_s:g} s after the command")
    turned = np.abs(rate - np.interp(begun_s, time_s, rate))
    looked_at = (time_s >= begun_s) & (time_s <= begun_s + WITHIN_s)
    peak = int(np.argmax(np.where(looked_at, turned, -1.0)))
    level = RESPONSE_SHARE * turned[peak]
    under = np.flatnonzero(turned[:peak] < level)
    if not under.size:
        raise UnjudgedError(f"the aircraft does not turn on the {control}")
    i = int(under[-1])
    share = (level - turned[i]) / (turned[i + 1] - turned[i])
    return float(time_s[i] + share * (time_s[i + 1] - time_s[i]))
