"""What a control is specified to feel like: the reference of its checks.

Static: the force that `specified_force` gives at each deflection, and the friction with the
motion. Dynamic: the specified rig let go. The specified rig is what the host assumes, with a
rigid structure, true scales and nothing amiss: the schedule's table as it is written, G_B and
breakout as the host has them; mass, damping, friction and servo as the file has them, which
says nothing else of them. A fault of those shows against another rig, or (static) against the
aircraft's own forces, which are the reference where they are given (`aircraftdata`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ControlName
from coupled.rig.equations import specified_force
from coupled.rig.parameters import Compensation, Control, Loader, Rigging, Schedule, Sensing
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
POINTS = 401  # of a specified leg


@dataclass(frozen=True)
class SweepLeg:
    """A quarter of a sweep, between neutral and a stop: δ in d, rising in size, F in N.

    `surface` is the command that reaches the surface, about trim, of ±1. A leg that was `read` on
    an aircraft is known at its own places only, and may be empty (`aircraftdata`).
    """

    deflection: Floats
    force: Floats
    surface: Floats
    read: bool = False


# The legs in their order, with the side of neutral and the direction of the motion.
LEGS = {
    "out, positive": (1.0, 1.0),
    "back, positive": (1.0, -1.0),
    "out, negative": (-1.0, 1.0),
    "back, negative": (-1.0, -1.0),
}


def specified_rig(rig: Rig) -> Rig:
    """Return the rig as its host assumes it: rigid, true in every scale, with nothing amiss."""
    changes = {f"controls.{name}": _specified(data) for name, data in rig.controls.items()}
    return rig.changed(changes)


def _specified(data: Control) -> Control:
    # Only what is named is taken over: all else, today's faults and those to come, is neutral.
    loader, table = data.loader, data.schedule
    return Control(
        surface=data.surface,
        travel=data.travel,
        length=data.length,
        loader=Loader(
            mass=loader.mass,
            damping=loader.damping,
            basic_gradient=data.assumed_basic_gradient,
            breakout=data.assumed_breakout,
            friction=loader.friction,
            bob_weight=loader.bob_weight,
            servo_frequency=loader.servo_frequency,
            servo_damping_ratio=loader.servo_damping_ratio,
        ),
        schedule=Schedule(
            dynamic_pressure=table.dynamic_pressure,
            total_gradient=table.total_gradient,
            second_gradient=table.second_gradient,
            break_deflection=table.break_deflection,
        ),
        compensation=Compensation(deflection=True, gradient=True),
        sensing=Sensing(),
        rigging=Rigging(),
    )


def specified_legs(rig: Rig, control: ControlName, pressure_Pa: float) -> tuple[SweepLeg, ...]:
    """Return what a slow sweep of a specified rig's control is to show, leg by leg."""
    data = rig.controls[control]
    share = np.linspace(1e-9, 1.0, POINTS)
    legs = []
    for side, motion in LEGS.values():
        deflection = side * share * data.travel
        force = specified_force(rig, control, pressure_Pa, deflection)
        rubs = side * motion * data.loader.friction
        legs.append(SweepLeg(deflection, force + rubs, side * share))
    return tuple(legs)
