"""Latency: how much later a simulated aircraft answers than the aircraft itself (Part 60, 4.a).

The rule counts from the aircraft's own answer to an abrupt command at the control. That answer is
flown: the same aircraft under the same hand, on the same rig with nothing in it that takes time, at
frames of half a millisecond. What the aircraft and its control's mass and spring take is in both
and drops out; what is left is what the simulator adds.

Either answer begins where the rate of pitch, roll or yaw has come to 5 % of the greatest that it
reaches within a second. A delay alone then shows as it is, and a smaller answer is not a later one.
A host that takes the force at t_k adds a frame and a half: half of it while the command is held,
and one in JSBSim, which turns this frame's moment into the next one's rate.
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
from coupled.record.channels import RATE, ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
UNDELAYED = "with nothing late"  # the reference's name, as a configuration's
REFERENCE_Hz = 2000.0
FRAMES_LATE = 1.5  # of a host and JSBSim; the reference's own are taken into account
BEGUN = 0.05  # of the greatest rate
WITHIN_s = 1.0  # of the beginning: where the greatest rate is looked for
_ROUNDS = 100  # at most; an answer of two parts takes some ten
_SETTLED_s = 1e-6

# What takes time between hand and surface, and what it is where nothing does.
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
    """Return the rig with nothing in it that takes time between hand and surface."""
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
    """Fly a manoeuvre, in the configuration that it is in, with nothing late."""
    rig = undelayed_rig(manoeuvre.rig)
    return fly_and_judge(replace(manoeuvre, rig=rig), UNDELAYED, progress)


def latency_s(control: ControlName, flight: Flight, reference: Flight) -> float:
    """Return by how much later than the reference a flight answers a control, s.

    Raises UnjudgedError for a flight that is no test of it.
    """
    _check_flight(control, flight.manoeuvre)
    begun_s = _begins(reference.record, control)
    own = _answer(reference.record, control, begun_s)
    late = 0.0
    for _ in range(_ROUNDS):  # the second in which the greatest rate is looked for comes late, too
        before, late = late, _answer(flight.record, control, begun_s + late) - own
        if abs(late - before) <= _SETTLED_s:
            break
    return late + FRAMES_LATE / REFERENCE_Hz


def _check_flight(control: ControlName, manoeuvre: Manoeuvre) -> None:
    pilot = manoeuvre.pilots.get(control)
    if pilot is None or isinstance(pilot, Attitude | Clamp | Track):
        problem = f"latency needs a force on the {control} that the rig does not change"
        raise UnjudgedError(f"{problem}: step, ramp, doublet, 3211, sweep or table")
    flight = manoeuvre.rig.flight
    if manoeuvre.conditions != Conditions() or (flight is not None and flight.gust_rms > 0.0):
        raise UnjudgedError("latency is measured in still air and without events")


def _begins(record: Record, control: ControlName) -> float:
    """Return when the hand's force begins, s."""
    force = record[channel(control, "hand_force")]
    moved = np.flatnonzero(force != force[0])
    if not moved.size:
        raise UnjudgedError(f"no force acts on the {control}")
    return float(record.time_s[max(int(moved[0]) - 1, 0)])


def _answer(record: Record, control: ControlName, begun_s: float) -> float:
    """Return when the rate that a control turns the aircraft at has begun, s.

    It is the last time before the greatest rate at which it was under its share, straight
    between rows, so that noise is not taken for an answer.
    """
    time_s, rate = record.time_s, record[RATE[control]]
    if begun_s + WITHIN_s > time_s[-1]:
        raise UnjudgedError(f"the run lacks {WITHIN_s:g} s after the command")
    turned = np.abs(rate - np.interp(begun_s, time_s, rate))
    looked_at = (time_s >= begun_s) & (time_s <= begun_s + WITHIN_s)
    peak = int(np.argmax(np.where(looked_at, turned, -1.0)))
    level = BEGUN * turned[peak]
    under = np.flatnonzero(turned[:peak] < level)
    if not under.size:
        raise UnjudgedError(f"the aircraft does not turn on the {control}")
    i = int(under[-1])
    share = (level - turned[i]) / (turned[i + 1] - turned[i])
    return float(time_s[i] + share * (time_s[i + 1] - time_s[i]))
