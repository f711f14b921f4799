"""The motions of a force documentation: slow sweeps both ways, and releases.

A sweep goes from neutral to one stop, to the other and back, slowly and at an even rate, as in a
static control check (14 CFR Part 60, table A2A: 95 to 105 s). The force is that of the rig's
static line, plus friction along the motion; the deflection is simulated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.authority.heldcontrol import breakaway_force
from coupled.calibration.plan import gradient_sets
from coupled.errors import InputError
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.rig.standalone import History, nodes_of, run_control
from coupled.rig.statics import static_line, static_point

Floats = NDArray[np.float64]
SWEEP_s = 100.0
TURN_s = 2.0  # for the hand's friction force to change sign
BEYOND = 1.02  # of the travel: the sweep pushes slightly into the stops
HELD_s = 6.0
RELEASE_s = 4.0
FINE_Hz = 1000.0
THROW = 0.4  # of the travel, from which a control is released; the rule requires 25 to 50 %


@dataclass(frozen=True)
class Release:
    """A release: time from it in s, deflection in d, and the deflection held before."""

    time_s: Floats
    deflection: Floats
    start: float


def feel_pressures(rig: Rig, control: ControlName) -> list[float]:
    """Return q̄ in Pa at the least, the middle and the greatest gradient of the schedule."""
    try:
        return [pressure for pressure, _ in gradient_sets(rig, control, 3)]
    except InputError:  # one gradient at every q̄
        return [float(rig.controls[control].schedule.dynamic_pressure[0])]


def sweep(rig: Rig, control: ControlName, pressure_Pa: float) -> History:
    """Return a slow sweep to both stops at a dynamic pressure."""
    data = rig.controls[control]
    frames = round(SWEEP_s * rig.frame_rate)
    ends = np.arange(frames + 1) / rig.frame_rate
    quarter, half, last = 0.25 * SWEEP_s, 0.5 * SWEEP_s, SWEEP_s - TURN_s
    stops = [TURN_s, quarter, half - TURN_s, half + TURN_s, 3.0 * quarter, last]
    places = [0.0, BEYOND * data.pull, 0.0, 0.0, -BEYOND * data.push, 0.0]
    path = np.interp(ends, stops, places)
    # At neutral the static line jumps by the breakout; the hand crosses the jump slowly.
    turns = [0.0, TURN_s, half - TURN_s, half + TURN_s, last, SWEEP_s]
    preload = np.interp(ends, turns, [0.0, 1.0, 1.0, -1.0, -1.0, 0.0])
    tiny = 1e-9 * data.travel
    outward = np.where(np.abs(path) < tiny, tiny, path)
    force = static_line(rig, control, pressure_Pa, outward).force
    force = np.where(np.abs(path) < tiny, preload * force, force)
    turns = [0.0, TURN_s, quarter, quarter + TURN_s, 3.0 * quarter, 3.0 * quarter + TURN_s]
    side = np.interp(ends, turns, [0.0, 1.0, 1.0, -1.0, -1.0, 1.0])
    force = force + side * breakaway_force(data.loader)
    # Without its damping's force a flat curve would be crossed late, and faster than evenly.
    force = force + data.loader.damping * np.gradient(path, ends)
    nodes = np.interp(nodes_of(rig, frames), ends, force)
    return run_control(rig, control, nodes, np.full(frames, pressure_Pa))


def release(rig: Rig, control: ControlName, pressure_Pa: float, side: float) -> Release:
    """Return the motion of a control that is held at `THROW` of its travel and released.

    `side` is +1 or −1. It is released from rest; its grip springs back by the bend at once.
    """
    rig = _finely_read(rig, control)
    held = side * THROW * rig.controls[control].travel_to(side)
    force = float(static_point(rig, control, pressure_Pa, held).force[0])
    frames = round((HELD_s + RELEASE_s) * rig.frame_rate)
    last = round(HELD_s * rig.frame_rate)
    nodes = np.zeros(frames * rig.substeps + 1)
    times = nodes_of(rig, frames)
    pull = np.minimum(times / (0.25 * HELD_s), 1.0)
    held_nodes = last * rig.substeps + 1
    nodes[:held_nodes] = force * pull[:held_nodes]
    friction = breakaway_force(rig.controls[control].loader)
    nodes[:held_nodes] += side * friction * pull[:held_nodes]
    response = run_control(rig, control, nodes, np.full(frames, pressure_Pa))
    start = float(response.deflection[last])
    time_s = response.time_s[last:] - response.time_s[last]
    return Release(time_s, response.deflection[last:], start)


def _finely_read(rig: Rig, control: ControlName) -> Rig:
    """Return the rig with a frame rate of 1 kHz, unless the frame determines the product."""
    if rig.controls[control].loader.multiplier == "digital":
        return rig
    return rig.changed({"frame_rate_Hz": max(rig.frame_rate, FINE_Hz)})
