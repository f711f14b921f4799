"""Simulation of the twin: a rig's numbers in the kernel, and the frame loop."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from coupled.blind.twin.kernel import twin_frame
from coupled.blind.twin.numbers import KNOTS, TWIN_PARAMETERS, TWIN_STATE
from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.record.channels import (
    ALPHA,
    ALTITUDE,
    BENCH_MOTION,
    ELEVATOR,
    LOAD,
    LONGITUDINAL,
    PRESSURE,
    SPEED,
)
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.compiled import bound
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
RIG_CHANNELS = (
    "column_force_N",
    "column_computed_m",
    "column_deflection_m",
    "column_estimate_m",
    "column_gradient_N_per_m",
    "column_modifying_force_N",
    "dynamic_pressure_Pa",
)


@dataclass(frozen=True)
class Bristles:
    """The bristles of presliding friction, by a length or an energy.

    travel_m       the bristles' length, m; if it is None,
    energy_J       friction times that length
    elastic_share  share of the length below which nothing slips; 0 for LuGre's
    """

    travel_m: float | None = None
    energy_J: float = 1e-6
    elastic_share: float = 0.0

    def stiffness(self, level_N: float) -> float:
        """Return the bristles' stiffness for a friction, N/m."""
        if self.travel_m is None:
            return level_N**2 / self.energy_J
        return level_N / self.travel_m


@dataclass
class Air:
    """Effects of the air and of the airframe beyond the model.

    `factors` are on values of the rig's flight, by their names. `gust` is the air's upward speed,
    m/s in each frame; `moment` is a command, added at the airframe but not at the surface, as a
    function of time in s and the change of motion since trim. `late_s` is the delay of the motion's
    time stamps.
    """

    factors: dict[str, float] = field(default_factory=dict)
    gust: Floats | None = None
    moment: Callable[[float, Sequence[float]], float] | None = None
    late_s: float = 0.0


@dataclass
class Twin:
    """A real rig: the kernel's numbers, shape (1,), its air, and the force on another control.

    `others` is that force on the nodes of the pilot's, N; None if the rig has no other control.
    """

    numbers: NDArray[np.void]
    air: Air = field(default_factory=Air)
    others: Floats | None = None

    def set(self, **values: float) -> None:
        """Set numbers by their names."""
        for name, value in values.items():
            self.numbers[name] = value

    def get(self, name: str) -> float:
        """Return a number."""
        return float(self.numbers[name][0])


def first_order(lag_s: float, step_s: float) -> float:
    """Return the step response of a lag after one step."""
    return -math.expm1(-step_s / lag_s) if lag_s > 0.0 else 1.0


STIFF = Bristles()


def nominal_twin(rig: Rig, bristles: Bristles = STIFF) -> Twin:
    """Return a twin of the rig's column without any effect; the host's K̂, G_B and F_BO as filed."""
    column = rig.controls["column"]
    loader, table, host = column.loader, column.schedule, column.compensation
    frame_s = 1.0 / rig.frame_rate
    twin = Twin(np.zeros(1, TWIN_PARAMETERS))
    rows = len(table.dynamic_pressure)
    assert rows <= KNOTS
    numbers = twin.numbers[0]
    numbers["knots"] = rows
    numbers["pressures"][:rows] = table.dynamic_pressure
    numbers["first"][:rows] = table.total_gradient
    numbers["second"][:rows] = table.second_gradient or table.total_gradient
    twin.set(frame_s=frame_s, pressure_scale=table.pressure_scale, slope=table.slope)
    twin.set(pressure_gain=first_order(table.pressure_lag, frame_s), tent_width=1.0)
    twin.set(
        host_gradient=column.assumed_basic_gradient,
        host_breakout=column.assumed_breakout,
        gradient_bend=host.bend if host.gradient else 0.0,
        exact=float(host.breakout_term == "exact"),
        break_deflection=table.break_deflection,
        estimate_bend=host.bend if host.deflection else 0.0,
        digital=loader.multiplier == "digital",
        deflection_scale=column.sensing.deflection_scale,
        loop_yield=1.0,
        force_scale=1.0,
    )
    twin.set(mass=loader.mass, damping=loader.damping, basic_gradient=loader.basic_gradient)
    twin.set(cubic=loader.cubic, breakout=loader.breakout, bob_weight=loader.bob_weight)
    twin.set(offset=loader.offset, delay=loader.delay, cog_pitch=1.0)
    stops = (loader.stop_aft, loader.stop_forward)
    aft, forward = (min(column.travel, stop or column.travel) for stop in stops)
    twin.set(aft=aft, forward=forward)
    set_friction(twin, loader.friction, loader.breakaway, loader.stribeck_rate, bristles)
    twin.set(modifying_lag=loader.modifying_lag)
    twin.set(servo_rate=2.0 * math.pi * loader.servo_frequency, play=loader.play)
    twin.set(servo_ratio=loader.servo_damping_ratio, servo_limit=loader.servo_rate_limit)
    twin.set(servo_push=loader.servo_acceleration_limit)
    twin.set(bend=loader.bend, bend_limit=loader.bend_limit)
    twin.set(arc=column.length if loader.arc_geometry else 0.0)
    rigging = column.rigging
    twin.set(command_gain=-1.0 / column.travel, stretch=rigging.stretch_loss)
    twin.set(lag_gain=first_order(rigging.lag, frame_s), rate_step=rigging.rate_limit * frame_s)
    twin.set(surface_play=rigging.play, surface_offset=rigging.offset)
    return twin


def set_friction(
    twin: Twin, running_N: float, breakaway_N: float, rate_m_per_s: float, bristles: Bristles
) -> None:
    """Set the twin's friction and its bristles."""
    level = max(running_N, breakaway_N)
    twin.set(running=running_N, breakaway=level, stribeck_rate=rate_m_per_s)
    set_bristles(twin, level, bristles)


def set_bristles(twin: Twin, level_N: float, bristles: Bristles) -> None:
    """Set the stiffness and damping of bristles with a friction of `level_N`."""
    stiffness = bristles.stiffness(level_N)
    twin.set(bristle=stiffness, elastic_share=bristles.elastic_share)
    twin.set(bristle_damping=0.3 * math.sqrt(stiffness * twin.get("mass")))


class LostError(RuntimeError):
    """The aircraft left the envelope in which a trial is valid."""


def fly_twin(
    rig: Rig, twin: Twin, nodes: Floats, frames: int, pressures: Floats | None, noise: Floats
) -> Record:
    """Return the record of a twin, SI, one row a frame.

    rig        the nominal rig: its aircraft and frame rate
    nodes      the pilot's force, shape (frames·NODES + 1,), N
    pressures  q̄ of a bench, shape (frames,), Pa; None with an aircraft
    noise      shape (frames, channels without time), SI
    Raises LostError if the aircraft leaves the envelope.
    """
    rows = noise[:, :7].copy()
    state = np.zeros(1, TWIN_STATE)
    time = np.arange(frames) / rig.frame_rate
    others = np.zeros_like(nodes) if twin.others is None else twin.others
    kernel = bound(twin_frame, twin.numbers, state, nodes, others, rows[0], 0, 1.0, 1.0)
    if pressures is not None:
        for k in range(frames):
            kernel(twin.numbers, state, nodes, others, rows[k], k, float(pressures[k]), 1.0)
        return Record(("time_s", *RIG_CHANNELS), np.column_stack((time, rows)))
    assert rig.flight is not None
    motions = _stamped(
        _fly(rig, twin, (nodes, others), rows, kernel, state), twin.air.late_s * rig.frame_rate
    )
    motions[:, 1:] += noise[:, 7:]
    data = np.column_stack((time, rows, motions[:, 1:]))
    assert BENCH_MOTION[0] == RIG_CHANNELS[-1]
    return Record(("time_s", *RIG_CHANNELS, *LONGITUDINAL[1:]), data)


def _stamped(motions: Floats, late: float) -> Floats:
    """Return the motion as recorded, stamped `late` frames late; surface and q̄ without delay."""
    if late == 0.0:
        return motions
    at = np.arange(len(motions), dtype=float)
    moved = CubicSpline(at, motions)(np.maximum(at - late, 0.0))
    kept = [LONGITUDINAL.index(name) for name in (BENCH_MOTION[0], "elevator_rad")]
    moved[:, kept] = motions[:, kept]
    return np.asarray(moved)


def airframe(flight: Flight, frame_s: float) -> JSBSimAirframe:
    """Return the aircraft, trimmed, with its column only."""
    return make_aircraft(flight, frame_s, ["column"], [aircraft_folder()])


def _fly(
    rig: Rig,
    twin: Twin,
    forces: tuple[Floats, Floats],
    rows: Floats,
    kernel: Callable[..., float],
    state: NDArray[np.void],
) -> Floats:
    """Fly the twin's aircraft; fill the rig's rows and return the motion, one row a frame."""
    assert rig.flight is not None
    frame_s = 1.0 / rig.frame_rate
    factors = twin.air.factors.items()
    real = rig.changed({f"flight.{n}": getattr(rig.flight, n) * factor for n, factor in factors})
    assert real.flight is not None
    try:
        craft = airframe(real.flight, frame_s)
    except InputError as error:  # no trim with such factors
        raise LostError from error
    moment, gust = twin.air.moment, twin.air.gust
    motions, commands = [], np.zeros(len(rows))
    start = craft.motion()
    for k in range(len(rows)):
        motion = craft.motion()
        if abs(motion[LOAD] - 1.0) > 2.0 or not motion[ALTITUDE] > craft.safe_altitude_m:
            raise LostError
        if abs(motion[ALPHA] - start[ALPHA]) > 0.22 or motion[SPEED] < 0.7 * start[SPEED]:
            raise LostError
        motions.append(motion)
        command = kernel(twin.numbers, state, *forces, rows[k], k, motion[PRESSURE], motion[LOAD])
        commands[k] = command
        if moment is not None:
            change = [now - then for now, then in zip(motion, start, strict=True)]
            command += moment(k * frame_s, change)
        if gust is not None:
            craft.set_gust(float(gust[k]))
        craft.step((command, 0.0, 0.0))
    flown = np.array(motions)
    if moment is not None:  # the surface is at the rig's position
        asked, positions = airframe(rig.flight, frame_s).surface_map()
        flown[1:, ELEVATOR] = np.interp(commands[:-1], asked, positions)
    return flown
