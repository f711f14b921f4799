"""Fast functions for every frame: read the motion, run a step, set a property."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from coupled.record.channels import LATERAL, LONGITUDINAL, ControlName
from coupled.rig.placed import Commands, HalfFrames, Placed
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
    """The calls of an aircraft without acting wrappers, and when to check it.

    Below `safe_altitude_m`, and if the height is NaN, `trouble` tells whether the flight must end.
    """

    longitudinal: Sequence[Read]
    lateral: Sequence[Read]
    writes: Sequence[Write]
    run: Callable[[], bool]
    safe_altitude_m: float
    trouble: Callable[[], str]


def plain_frames(aircraft: PlainAircraft, placed: Placed) -> PlainFrames | None:
    """Return a loop of rig and aircraft from one frame to another, without calls in between.

    It does what `motion_reader`, the rig's frame and `stepper` do, in one loop: their calls, and
    packing the motion, cost a fifth of the rig's own time. It returns the frame reached, an earlier
    one if the flight must end. None for rigs with two controls, of which none is shipped.
    """
    if not aircraft.lateral and len(aircraft.writes) == 1:
        return _column_frames(aircraft, placed)
    return _three_frames(aircraft, placed) if len(aircraft.writes) == 3 else None


def _column_frames(aircraft: PlainAircraft, placed: Placed) -> PlainFrames:
    qbar, load, elevator, pitch_rate, alpha, pitch, speed, height = aircraft.longitudinal
    ((write, trim),) = aircraft.writes
    run, safe_m, trouble = aircraft.run, aircraft.safe_altitude_m, aircraft.trouble
    rig_frame, address = placed.run_column, placed.address

    def fly(first: int, last: int) -> int:
        for k in range(first, last):
            altitude = height() * FOOT_m
            if not altitude > safe_m and trouble():
                return k
            command = rig_frame(
                address,
                k,
                qbar() * PSF_Pa,
                load(),
                elevator(),
                pitch_rate(),
                alpha(),
                pitch(),
                speed() * FOOT_m,
                altitude,
            )
            write(trim + command)
            run()
        return last

    return fly


def _three_frames(aircraft: PlainAircraft, placed: Placed) -> PlainFrames:
    qbar, load, elevator, pitch_rate, alpha, pitch, speed, height = aircraft.longitudinal
    aileron, rudder, roll_rate, yaw_rate, beta, roll, heading = aircraft.lateral
    (write, trim), (second_write, second_trim), (third_write, third_trim) = aircraft.writes
    run, safe_m, trouble = aircraft.run, aircraft.safe_altitude_m, aircraft.trouble
    rig_frame, address = placed.run_all, placed.address

    def fly(first: int, last: int) -> int:
        for k in range(first, last):
            altitude = height() * FOOT_m
            if not altitude > safe_m and trouble():
                return k
            turned = heading()  # from 0 to 2π, where both mean north
            command, second, third = rig_frame(
                address,
                k,
                qbar() * PSF_Pa,
                load(),
                elevator(),
                pitch_rate(),
                alpha(),
                pitch(),
                speed() * FOOT_m,
                altitude,
                aileron(),
                rudder(),
                roll_rate(),
                yaw_rate(),
                beta(),
                roll(),
                turned if turned <= math.pi else turned - 2.0 * math.pi,
            )
            write(trim + command)
            second_write(second_trim + second)
            third_write(third_trim + third)
            run()
        return last

    return fly


class PlainSteps(NamedTuple):
    """A frame in two halves, as `Frames.steps`; `begun` takes the commands of a host run again.

    `advance` is `end` of a frame under a force on the column, N, and `begin` of the next one.
    """

    begin: Callable[[int], str]
    end: Callable[[int, Sequence[float]], None]
    begun: Callable[[Commands], None]
    advance: Callable[[int, float], str] | None = None


def plain_steps(aircraft: PlainAircraft, halves: HalfFrames) -> PlainSteps | None:
    """Return the two halves of a frame of rig and aircraft, without calls in between.

    They do what `plain_frames` does. None for rigs with two controls.
    """
    if not aircraft.lateral and len(aircraft.writes) == 1:
        return _column_steps(aircraft, halves)
    return _three_steps(aircraft, halves) if len(aircraft.writes) == 3 else None


def _column_steps(aircraft: PlainAircraft, halves: HalfFrames) -> PlainSteps:
    qbar, load, elevator, pitch_rate, alpha, pitch, speed, height = aircraft.longitudinal
    ((write, trim),) = aircraft.writes
    run, safe_m, trouble = aircraft.run, aircraft.safe_altitude_m, aircraft.trouble
    host, loaders, address = halves.host_column, halves.loaders, halves.address
    both, command = halves.step_column, 0.0

    def begin(k: int) -> str:
        nonlocal command
        altitude = height() * FOOT_m
        if not altitude > safe_m and (why := trouble()):
            return why
        command = host(
            address,
            k,
            qbar() * PSF_Pa,
            load(),
            elevator(),
            pitch_rate(),
            alpha(),
            pitch(),
            speed() * FOOT_m,
            altitude,
        )
        return ""

    def end(k: int, forces: Sequence[float]) -> None:
        loaders(address, k, *forces)
        write(trim + command)
        run()

    def advance(k: int, force: float) -> str:
        nonlocal command
        write(trim + command)
        run()
        altitude = height() * FOOT_m
        if not altitude > safe_m and (why := trouble()):
            return why
        command = both(
            address,
            k,
            force,
            qbar() * PSF_Pa,
            load(),
            elevator(),
            pitch_rate(),
            alpha(),
            pitch(),
            speed() * FOOT_m,
            altitude,
        )
        return ""

    def begun(commands: Commands) -> None:
        nonlocal command
        command = commands[0]

    return PlainSteps(begin, end, begun, advance)


def _three_steps(aircraft: PlainAircraft, halves: HalfFrames) -> PlainSteps:
    qbar, load, elevator, pitch_rate, alpha, pitch, speed, height = aircraft.longitudinal
    aileron, rudder, roll_rate, yaw_rate, beta, roll, heading = aircraft.lateral
    (write, trim), (second_write, second_trim), (third_write, third_trim) = aircraft.writes
    run, safe_m, trouble = aircraft.run, aircraft.safe_altitude_m, aircraft.trouble
    host, loaders, address = halves.host, halves.loaders, halves.address
    command = second = third = 0.0

    def begin(k: int) -> str:
        nonlocal command, second, third
        altitude = height() * FOOT_m
        if not altitude > safe_m and (why := trouble()):
            return why
        turned = heading()  # from 0 to 2π, where both mean north
        command, second, third = host(
            address,
            k,
            qbar() * PSF_Pa,
            load(),
            elevator(),
            pitch_rate(),
            alpha(),
            pitch(),
            speed() * FOOT_m,
            altitude,
            aileron(),
            rudder(),
            roll_rate(),
            yaw_rate(),
            beta(),
            roll(),
            turned if turned <= math.pi else turned - 2.0 * math.pi,
        )
        return ""

    def end(k: int, forces: Sequence[float]) -> None:
        loaders(address, k, *forces)
        write(trim + command)
        second_write(second_trim + second)
        third_write(third_trim + third)
        run()

    def begun(commands: Commands) -> None:
        nonlocal command, second, third
        command, second, third = commands

    return PlainSteps(begin, end, begun)
