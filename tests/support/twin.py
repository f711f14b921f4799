"""A twin on the bench, without noise: mass, spring and damper, driven by a force."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.blind.trials.deck import read_deck
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.twin import Twin, fly_twin, nominal_twin
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
POOL = read_deck(1).rigs
STEP_N = 20.0
RATE_Hz = 120
# Effects that no twin has: of a rotating joint, of an imposed motion, of an aircraft moved by all
# controls, and of its sensors.
WITHOUT_TWIN = {
    *("gravity", "yielding_contact", "regressor_force", "regressor_friction"),
    *("aileron_effectiveness", "rudder_effectiveness", "roll_damping", "yaw_damping"),
    *("dihedral_effect", "directional_stability", "side_force_slope", "adverse_yaw", "drag"),
    *("thrust", "roll_inertia", "pitch_inertia", "yaw_inertia", "center_of_gravity"),
    *("lateral_gust", "pitching_moment", "lift_offset", "fuel"),
    *("yawing_moment", "side_force"),
    *("elevator_zero", "alpha_zero", "sideslip_zero", "pitch_zero", "load_factor_zero"),
    *("pitch_rate_zero", "roll_rate_zero", "yaw_rate_zero"),
}


def alone(rig: Rig, twin: Twin, force: Floats, pressure_Pa: float = 0.0) -> Record:
    """Return a noiseless bench record."""
    frames = (len(force) - 1) // NODES
    pressures = np.full(frames, pressure_Pa)
    return fly_twin(rig, twin, force, frames, pressures, np.zeros((frames, 7)))


def plain() -> tuple[Rig, Twin]:
    """Return a rigid bench, q̄ = 0: mass, spring and damper, and no preload."""
    rig = POOL["bench-rigid"]
    twin = nominal_twin(rig)
    twin.set(breakout=0.0, host_breakout=0.0)
    return rig, twin


def nodes(seconds: float) -> Floats:
    """Return the times of the force's nodes, s."""
    return np.arange(round(seconds * RATE_Hz) * NODES + 1) / (RATE_Hz * NODES)


def stepped(seconds: float, size_N: float = STEP_N) -> Floats:
    """Return a step of force at 0 s, N."""
    force = np.full(len(nodes(seconds)), size_N)
    force[0] = 0.0
    return force


def loop(seconds: float, size_N: float) -> Floats:
    """Return a slow force in N: one period of a triangle."""
    t = nodes(seconds) / seconds
    return size_N * np.interp(t, [0.0, 0.25, 0.75, 1.0], [0.0, 1.0, -1.0, 0.0])
