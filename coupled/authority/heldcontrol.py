"""Figures while a control is held: surface reached and force felt, beside the statics.

A control is held if it is far out on the peak's side, and still. Deflection and force are the
hand's own: zero and arc of the grip's transducer are removed, and the strain gauge is not used.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.channels import SURFACES, ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.equations import specified_force
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.parameters import Loader
from coupled.rig.rig import Rig
from coupled.rig.statics import static_point
from coupled.rig.surface import share_of_travel

Floats = NDArray[np.float64]
_AT_STOP_rad = 1e-6  # from its stop, within which a surface is at it
_SIGMAS = 6.0  # of the noise; exceeded once in 5e8 rows
_STILL = 1e-9  # of the travel: rounding of a loader at rest


@dataclass(frozen=True)
class Commands:
    """Mean surface commands about trim while a control is held, in ±1.

    The command for the deflection and the command reached, both limited to the surface's travel;
    `stop` is the command at the surface's stop if more is commanded, else None.
    """

    commanded: float
    reached: float
    stop: float | None


def true_deflection(rig: Rig, control: ControlName, record: Record) -> Floats:
    """Return the deflection δ at the grip in d, from the transducer's reading: eq. (15)."""
    data = rig.controls[control]
    read = record[channel(control, "deflection")] - data.sensing.deflection_zero
    read = read - data.sensing.grip_load_curve.at(record[channel(control, "force")])
    read = data.sensing.grip_curve.inverse(read)
    if data.loader.arc_geometry:
        read = data.length * np.arcsin(np.clip(read / data.length, -1.0, 1.0))
    return np.asarray(read)


def loader_rests(rig: Rig, control: ControlName, record: Record) -> bool:
    """Return whether a loader never leaves neutral, since the hand force is below the breakout.

    Decided by δc. With presliding friction the loader moves slightly before it slips; then the
    forces decide. Not for a loader with services, which a jam may hold.
    """
    loader, name = rig.controls[control].loader, channel(control, "computed")
    away = float(np.max(np.abs(record[name] - record[name][0])))
    within = _STILL * rig.controls[control].travel + 2.0 * abs(rig.controls[control].sensing.hum)
    if away <= within + 2.0 * _SIGMAS * rig.noise.get(name, 0.0):
        return True
    if loader.friction_stiffness == 0.0:
        return False
    net = record[channel(control, "hand_force")] + loader.offset
    if rig.flight is not None:
        net = net - loader.bob_weight * (record["load_factor"] - 1.0)
    return float(np.max(np.abs(net))) <= loader.breakout + breakaway_force(loader)


def breakaway_force(loader: Loader) -> float:
    """Return the breakaway force of a loader's dry friction, N."""
    curve = loader.friction_curve
    aft, forward = (curve.force[0], curve.forward[0]) if curve.nodes else (0.0, 0.0)
    added = max(loader.friction_pull + aft, loader.friction_push + forward)
    return max(max(loader.friction, loader.breakaway) + added, 0.0)


def predict_at_rest(
    rig: Rig,
    control: ControlName,
    record: Record,
    held: NDArray[np.bool_],
    stop: float | None = None,
) -> tuple[float, float]:
    """Return the lost share of the command, and force felt over specified, at rest.

    `stop` is the command at the surface's stop, if it is reached.
    """

    def mean(values: Floats) -> float:
        return float(np.mean(values[held]))

    others = {str(n): mean(record[channel(n, "hand_force")]) for n in rig.controls if n != control}
    load = mean(record["load_factor"]) if rig.flight is not None else 1.0
    deflection = mean(true_deflection(rig, control, record))
    point = static_point(
        rig,
        control,
        mean(record["dynamic_pressure_Pa"]),
        deflection,
        others,
        time_s=mean(record.time_s),
        load_factor=load,
    )
    loader = rig.controls[control].loader
    preload = math.copysign(loader.breakout, deflection)
    felt = float(point.force[0]) - preload - loader.bob_weight * (load - 1.0)
    specified = float(point.specified[0]) - preload
    commanded = _limit_to_stop(_commands(rig, control, np.array([deflection])), stop)
    loss = 1.0 - float(_limit_to_stop(point.command, stop)[0] / commanded[0])
    return loss, felt / specified if specified else float("nan")


def average_held_forces(
    manoeuvre: Manoeuvre, control: ControlName, record: Record
) -> tuple[float, float]:
    """Return the mean force felt and specified while a control is held, N; NaN if it never moves.

    Breakout and bob weight are subtracted from both.
    """
    deflection = true_deflection(manoeuvre.rig, control, record)
    if len(record) < 2 or not np.any(deflection):
        return float("nan"), float("nan")
    held = find_held_rows(record.time_s, deflection)
    return average_forces(manoeuvre.rig, control, record, held)


def find_held_rows(time_s: Floats, deflection: Floats) -> NDArray[np.bool_]:
    """Return the rows at which the control is held: far out on the peak's side, and still.

    Still is a speed under 5 % of the peak a second, over ±0.1 s, which tolerates transducer noise.
    If it is never still, the rows within 2 % of the peak.
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


def _commands(rig: Rig, control: ControlName, deflection: Floats) -> Floats:
    """Return the surface commands for deflections in d, 1 for full travel, without a limit."""
    data = rig.controls[control]
    return COMMAND_SIGN[data.surface] * share_of_travel(data, deflection)


def _limit_to_stop(commands: Floats, stop: float | None) -> Floats:
    """Return commands in ±1, limited to the stop of the surface on its side."""
    low = stop if stop is not None and stop <= 0.0 else -1.0
    high = stop if stop is not None and stop > 0.0 else 1.0
    return np.asarray(np.clip(commands, low, high))


def average_commands(
    rig: Rig, control: ControlName, record: Record, held: NDArray[np.bool_]
) -> Commands:
    """Return the mean surface commands for the deflection, and reached, in ±1."""
    commanded = _commands(rig, control, true_deflection(rig, control, record)[held])
    reached = record[channel(control, "surface_norm")]
    stop = _surface_stop(rig, control, record, held, float(np.mean(commanded)))
    if stop is None or abs(float(np.mean(commanded))) <= abs(stop):
        return Commands(
            float(np.mean(np.clip(commanded, -1, 1))), float(np.mean(reached[held])), None
        )
    means = [float(np.mean(_limit_to_stop(each, stop))) for each in (commanded, reached[held])]
    return Commands(means[0], means[1], stop)


def _surface_stop(
    rig: Rig, control: ControlName, record: Record, held: NDArray[np.bool_], commanded: float
) -> float | None:
    """Return the command at the surface's stop on the commanded side; None if unknown.

    The manifest has the stop at the end of the flight. If the trim has moved since the control was
    held, the surface's own position decides: at its stop the command of that time is the limit;
    elsewhere the stop is unknown.
    """
    data = rig.controls[control]
    surface = SURFACES[control]
    stops = record.manifest.get("surface_stops", {}).get(surface)
    rows = np.flatnonzero(held[:-1])  # a row's command moves the surface of the next
    known = stops["positive" if commanded > 0.0 else "negative"] if stops else None
    if known is None or not len(rows):
        return None
    stop, name = float(known["command_norm"]), f"{surface}_rad"
    reached = np.abs(record[channel(control, "surface_norm")][rows])
    slack = data.rigging.play + 1e-4

    def is_at_stop(of: NDArray[np.int64]) -> bool:
        within = _AT_STOP_rad + _SIGMAS * rig.noise.get(name, 0.0) / math.sqrt(len(of))
        return bool(abs(np.mean(record[name][of + 1]) - known["position_rad"]) <= within)

    if np.mean(reached) < abs(stop) - slack and is_at_stop(rows):
        return math.copysign(float(np.min(reached)), commanded)
    beyond = rows[reached > abs(stop) + slack]
    if len(beyond) and not is_at_stop(beyond):
        return None
    return stop


def average_forces(
    rig: Rig, control: ControlName, record: Record, held: NDArray[np.bool_]
) -> tuple[float, float]:
    """Return the mean force felt and specified, without breakout and bob weight, N.

    The specified force acts about the neutral, which a force trim may have moved.
    """
    deflection = true_deflection(rig, control, record)[held]
    neutral = f"{control}_trim_{unit_of(control)}"
    if neutral in record:
        deflection = deflection - record[neutral][held]
    pressure = record["dynamic_pressure_Pa"][held]
    loader = rig.controls[control].loader
    preload = np.sign(deflection) * loader.breakout
    flown = rig.flight is not None
    weight = loader.bob_weight * (record["load_factor"][held] - 1.0) if flown else 0.0
    specified = specified_force(rig, control, pressure, deflection)
    felt = record[channel(control, "hand_force")][held]
    return float(np.mean(felt - preload - weight)), float(np.mean(specified - preload))
