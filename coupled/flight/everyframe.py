"""The calls of every frame, to read the motion, to run and to move a lever: quick ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from coupled.record.channels import LATERAL, LONGITUDINAL
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
# By channel; JSBSim has all but q̄, airspeed and height in SI, too.
PROPERTIES = dict(
    zip(LONGITUDINAL + LATERAL, LONGITUDINAL_PROPERTIES + LATERAL_PROPERTIES, strict=True)
)


class Lever(NamedTuple):
    """A property of a model that may be set in flight, in JSBSim's unit."""

    set: Callable[[float], object]
    read: Callable[[], float]


class Motion(NamedTuple):
    """What reads the motion, in SI: the channels that there are, and with zeros for the others."""

    read: Callable[[], tuple[float, ...]]
    read_whole: Callable[[], tuple[float, ...]]


def motion_reader(
    longitudinal: Sequence[Callable[[], float]], lateral: Sequence[Callable[[], float]]
) -> Motion:
    """Return what reads the motion; written out, since every frame calls it."""
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
        turned = heading()  # from 0 to 2π, north being either
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


def stepper(
    run: Callable[[], bool],
    writes: Sequence[tuple[Callable[[float], object], float]],
    steps: int,
) -> Callable[[tuple[float, float, float]], None]:
    """Return a function that runs a frame with commands about trim, one a control."""
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
