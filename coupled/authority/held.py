"""What is read while a control is held: the surface reached, the force felt, beside the statics.

Held is far out on the peak's side, and still. The force is the hand's own.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.equations import specified_force
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.rig import Rig
from coupled.rig.statics import static_point

Floats = NDArray[np.float64]


def by_the_statics(
    rig: Rig, control: ControlName, record: Record, held: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return the share of the command that is lost, and force felt over specified, at rest."""
    others = {
        str(name): float(np.mean(record[channel(name, "hand_force")][held]))
        for name in rig.controls
        if name != control and not rig.structure.stands_apart
    }
    pressure = float(np.mean(record["dynamic_pressure_Pa"][held]))
    deflection = float(np.mean(record[channel(control, "deflection")][held]))
    point = static_point(rig, control, pressure, deflection, others)
    breakout = math.copysign(rig.controls[control].loader.breakout, deflection)
    felt, specified = float(point.force[0]) - breakout, float(point.specified[0]) - breakout
    loss = 1.0 - float(point.estimate[0] / point.deflection[0])
    return loss, felt / specified if specified else float("nan")


def held_forces(manoeuvre: Manoeuvre, control: ControlName, record: Record) -> tuple[float, float]:
    """Return the mean force felt and specified where a control is held, N; NaN if it never moves.

    Breakout and bob weight are taken off both.
    """
    deflection = record[channel(control, "deflection")]
    if len(record) < 2 or not np.any(deflection):
        return float("nan"), float("nan")
    held = where_held(record.time_s, deflection)
    return felt_and_specified(manoeuvre.rig, control, record, held)


def where_held(time_s: Floats, deflection: Floats) -> NDArray[np.bool_]:
    """Return the rows at which the control is held: far out on the peak's side, and still.

    Still is a speed under 5 % of the peak a second, over ±0.1 s, so that a noisy transducer
    counts as still too. Where it never is, the rows within 2 % of the peak.
    """
    peak = deflection[np.argmax(np.abs(deflection))]
    share = deflection / peak
    reach = max(1, round(0.1 / (time_s[1] - time_s[0])))
    rate = np.full_like(share, np.inf)
    if len(share) > 2 * reach:
        span = time_s[2 * reach :] - time_s[: -2 * reach]
        rate[reach:-reach] = (share[2 * reach :] - share[: -2 * reach]) / span
    held = (share >= 0.5) & (np.abs(rate) <= 0.05)
    return np.asarray(held if held.sum() >= reach else share >= 0.98)


def asked_and_reached(
    rig: Rig, control: ControlName, record: Record, held: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return the mean surface commands asked for by the deflection, and reached, of ±1."""
    data = rig.controls[control]
    gain = COMMAND_SIGN[data.surface] / data.travel
    deflection = record[channel(control, "deflection")]
    asked = np.clip(gain * deflection, -1.0, 1.0)
    reached = record[channel(control, "surface_norm")]
    return float(np.mean(asked[held])), float(np.mean(reached[held]))


def felt_and_specified(
    rig: Rig, control: ControlName, record: Record, held: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return the mean force felt and specified, breakout and bob weight taken off, N."""
    deflection = record[channel(control, "deflection")][held]
    pressure = record["dynamic_pressure_Pa"][held]
    loader = rig.controls[control].loader
    preload = np.sign(deflection) * loader.breakout
    flown = rig.flight is not None
    weight = loader.bob_weight * (record["load_factor"][held] - 1.0) if flown else 0.0
    specified = specified_force(rig, control, pressure, deflection)
    felt = record[channel(control, "hand_force")][held]
    return float(np.mean(felt - preload - weight)), float(np.mean(specified - preload))
