"""Fast functions for every frame: read the motion, run a step, set a property."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from coupled.record.channels import (
    ALTITUDE,
    LATERAL,
    LONGITUDINAL,
    PRESSURE,
    SPEED,
    ControlName,
)
from coupled.rig.placed import Connection, HalfFrames, Placed
from coupled.units import FOOT_m, PSF_Pa

# JSBSim's property behind each motion channel, in the channels' order.
LONGITUDINAL_PROPERTIES = (
    "aero/qbar-psf",
    "accelerations/Nz",
    "fcs/elevator-pos-rad",
    "velocities/q-rad_sec",
    "aero/alpha-rad",
    "attitude/theta-rad",
    "velocities/vt-fps",
    "position/h-sl-ft",
)
LATERAL_PROPERTIES = (
    "fcs/left-aileron-pos-rad",
    "fcs/rudder-pos-rad",
    "velocities/p-rad_sec",
    "velocities/r-rad_sec",
    "aero/beta-rad",
    "attitude/phi-rad",
    "attitude/psi-rad",
)
assert len(LONGITUDINAL_PROPERTIES) == len(LONGITUDINAL)
assert len(LATERAL_PROPERTIES) == len(LATERAL)
_LONGITUDINAL = len(LONGITUDINAL)
# By channel; JSBSim has all but q̄, airspeed and height in SI.
PROPERTIES = dict(
    zip(LONGITUDINAL + LATERAL, LONGITUDINAL_PROPERTIES + LATERAL_PROPERTIES, strict=True)
)
_UNITS = {PRESSURE: PSF_Pa, SPEED: FOOT_m, ALTITUDE: FOOT_m}
TO_SI = tuple(_UNITS.get(i, 1.0) for i in range(len(PROPERTIES)))

# JSBSim's trim of each control's surface, in its commands.
TRIMS: Mapping[ControlName, str] = {
    "column": "fcs/pitch-trim-cmd-norm",
    "wheel": "fcs/roll-trim-cmd-norm",
    "pedals": "fcs/yaw-trim-cmd-norm",
}


class Lever(NamedTuple):
    """A property of a model that may be set in flight, in JSBSim's unit."""

    set: Callable[[float], object]
    read: Callable[[], float]


Read = Callable[[], float]
Write = tuple[Callable[[float], object], float]  # a command's setter, and its value in trim
PlainFrames = Callable[[int, int], int]


class Motion(NamedTuple):
    """Functions that read the motion, in SI: its channels, and with zeros for missing ones."""

    read: Callable[[], tuple[float, ...]]
    read_whole: Callable[[], tuple[float, ...]]


def motion_reader(longitudinal: Sequence[Read], lateral: Sequence[Read]) -> Motion:
    """Return the functions that read the motion; unrolled, since every frame calls them."""
    qbar, load, elevator, pitch_rate, alpha, pitch, speed, height = longitudinal

    def column() -> tuple[float, ...]:
        return whole_column()[:_LONGITUDINAL]

    def whole_column() -> tuple[float, ...]:
        return (
            qbar() * PSF_Pa,
            load(),
            elevator(),
            pitch_rate(),
            alpha(),
            pitch(),
            speed() * FOOT_m,
            height() * FOOT_m,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )

    if not lateral:
        return Motion(column, whole_column)
    aileron, rudder, roll_rate, yaw_rate, beta, roll, heading = lateral

    def all_controls() -> tuple[float, ...]:
        turned = heading()  # from 0 to 2π, where both mean north
        return (
            qbar() * PSF_Pa,
            load(),
            elevator(),
            pitch_rate(),
            alpha(),
            pitch(),
            speed() * FOOT_m,
            height() * FOOT_m,
            aileron(),
            rudder(),
            roll_rate(),
            yaw_rate(),
            beta(),
            roll(),
            turned if turned <= math.pi else turned - 2.0 * math.pi,
        )

    return Motion(all_controls, all_controls)


def mean_reader(terms: Sequence[tuple[float, Read]]) -> Read:
    """Return the function that reads a sum of factors times properties."""
    if len(terms) == 1 and terms[0][0] == 1.0:
        return terms[0][1]

    def mean() -> float:
        return sum(factor * read() for factor, read in terms)

    return mean


def command_writes(levers: Sequence[Sequence[tuple[str, float, Lever]]]) -> list[Write]:
    """Return the setter of each control's command, and the command in trim.

    `levers` are each control's properties: name, sign, and how to set it. A property that several
    controls command, as an elevon's, gets its value in trim and the sum of their commands.
    """
    now = [0.0] * len(levers)
    shares: dict[str, list[tuple[int, float]]] = {}
    for i, each in enumerate(levers):
        for name, sign, _ in each:
            shares.setdefault(name, []).append((i, sign))

    def write_of(i: int) -> Write:
        (name, sign, lever), *others = levers[i]
        if not others and sign > 0.0 and len(shares[name]) == 1:
            return lever.set, lever.read()
        parts = [(lever.set, lever.read(), shares[name]) for name, _, lever in levers[i]]

        def write(command: float) -> None:
            now[i] = command
            for set_value, trim, commanded in parts:
                set_value(trim + sum(sign * now[j] for j, sign in commanded))

        return write, 0.0

    return [write_of(i) for i in range(len(levers))]


def stepper(
    run: Callable[[], bool],
    writes: Sequence[Write],
    steps: int,
) -> Callable[[tuple[float, float, float]], None]:
    """Return a function that runs a frame with commands about trim, one for each control."""
    (first, first_trim), *others = writes

    def one(commands: tuple[float, float, float], /) -> None:
        first(first_trim + commands[0])
        run()

    def several(commands: tuple[float, float, float], /) -> None:
        for (write, trim), command in zip(writes, commands, strict=False):
            write(trim + command)
        for _ in range(steps):
            run()

    if steps > 1 or len(others) == 1:
        return several
    if not others:
        return one
    (second, second_trim), (third, third_trim) = others

    def three(commands: tuple[float, float, float], /) -> None:
        a, b, c = commands
        first(first_trim + a)
        second(second_trim + b)
        third(third_trim + c)
        run()

    return three


class PlainAircraft(NamedTuple):
    """An aircraft without acting wrappers, and its ground check.

    Below the connection's safe altitude, and if the height is NaN, `trouble` returns whether the
    flight must end. `nodes` are the objects whose addresses the connection has.
    """

    connection: Connection
    nodes: Sequence[object]
    run: Callable[[], bool]
    trouble: Callable[[], str]


def plain_frames(aircraft: PlainAircraft, placed: Placed) -> PlainFrames:
    """Return a loop of rig and aircraft from one frame to another, without calls in between.

    It returns the frame reached, an earlier one if the flight must end.
    """
    placed.connect(aircraft.connection)
    rig_frame, address, run, trouble = placed.fly, placed.address, aircraft.run, aircraft.trouble

    def fly(first: int, last: int) -> int:
        for k in range(first, last):
            if rig_frame(address, k, True):
                if trouble():
                    return k
                rig_frame(address, k, False)
            run()
        return last

    return fly


class PlainSteps(NamedTuple):
    """A frame in two halves, as `Frames.steps`.

    `advance` is `end` of a frame under a force on the column, N, and `begin` of the next one.
    """

    begin: Callable[[int], str]
    end: Callable[[int, Sequence[float]], None]
    advance: Callable[[int, float], str] | None


def plain_steps(aircraft: PlainAircraft, halves: HalfFrames) -> PlainSteps:
    """Return the two halves of a frame of rig and aircraft, without calls in between.

    The aircraft's commands are set with the host's, before its step.
    """
    halves.placed.connect(aircraft.connection)
    host, loaders, step, address = halves.host, halves.loaders, halves.step, halves.address
    run, trouble = aircraft.run, aircraft.trouble

    def begin(k: int) -> str:
        if host(address, k, True):
            if why := trouble():
                return why
            host(address, k, False)
        return ""

    def end(k: int, forces: Sequence[float]) -> None:
        loaders(address, k, *forces)
        run()

    def advance(k: int, force: float) -> str:
        run()
        if step(address, k, force, True):
            if why := trouble():
                return why
            host(address, k + 1, False)
        return ""

    return PlainSteps(begin, end, advance if len(aircraft.connection.commands) == 1 else None)
