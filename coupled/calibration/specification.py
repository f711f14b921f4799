"""The specified force of a control: the reference of its checks.

Static: the force of `specified_force` at each deflection, plus friction along the motion. Dynamic:
a release of the specified rig. The specified rig is the rig that the host assumes, rigid, with true
scales and without faults: the schedule's table as filed, the host's G_B and breakout, and the filed
mass, damping, friction and servo, for which there is no other value. Faults of these four are
visible only with another rig as reference, or (static) with forces of the aircraft, which are the
reference if given (`aircraftdata`).
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
    """A quarter of a sweep, between neutral and a stop: δ in d by rising size, F in N.

    `surface` is the command of the surface about trim, −1 to 1. A leg `read` on an aircraft is
    known at its own deflections only, and may be empty (`aircraftdata`).
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
    """Return the rig as its host assumes it: rigid, with true scales, without faults."""
    changes = {f"controls.{name}": _specified(data) for name, data in rig.controls.items()}
    return rig.changed(changes)


def _specified(data: Control) -> Control:
    # Only what is listed here is taken from the rig; all other keys are neutral.
    loader, table = data.loader, data.schedule
    return Control(
        surface=data.surface,
        travel=data.travel,
        travel_pull=data.travel_pull,
        travel_push=data.travel_push,
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
            deflection=table.deflection,
            force=table.force,
        ),
        compensation=Compensation(deflection=True, gradient=True),
        sensing=Sensing(),
        rigging=Rigging(),
    )


def specified_legs(rig: Rig, control: ControlName, pressure_Pa: float) -> tuple[SweepLeg, ...]:
    """Return the forces of a slow sweep of a specified rig's control, leg by leg."""
    data = rig.controls[control]
    share = np.linspace(1e-9, 1.0, POINTS)
    legs = []
    for side, motion in LEGS.values():
        deflection = side * share * data.travel_to(side)
        force = specified_force(rig, control, pressure_Pa, deflection)
        rubs = side * motion * data.loader.friction
        legs.append(SweepLeg(deflection, force + rubs, side * share))
    return tuple(legs)
