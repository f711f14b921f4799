"""Numbers of a rig that no machine has.

A rig may be of any size, and a length beyond its travel may mean "none". Only the travel of a
control of an aircraft is compared with the reach of a hand.
"""

from __future__ import annotations

import math

import numpy as np

from coupled.errors import InputError
from coupled.rig.curves import FrictionCurve
from coupled.rig.parameters import Control
from coupled.rig.rigdata import RigData

WRONG_UNIT = 10.0  # times the q̄ of the flight; psf and hPa read as Pa are 48 and 100 times less
REACHED = {"m": 1.0, "rad": 2.0 * math.pi}  # of a hand on column and pedals, and on a wheel
ROUNDING = 1e-9  # of a sum of numbers that cancel


def check_bounds(rig: RigData, control: Control, file: object, path: str, d: str) -> None:
    """Refuse an impossible travel or friction curve of a control."""
    if rig.flight is not None and control.travel > REACHED[d]:
        problem = f"is {control.travel:g}: a hand reaches {REACHED[d]:.3g} {d} at most"
        raise InputError(file, f"{path}.travel_{d}", f"{problem}: is it in another unit?")
    if control.loader.friction_curve.nodes:
        _check_dissipation(control, file, f"{path}.loader.friction_curve", d)


def pressure_at(calibrated_m_per_s: float) -> float:
    """Return q̄ in Pa at a calibrated airspeed, without compressibility."""
    return 0.5 * 1.225 * calibrated_m_per_s**2


def pressure_doubts(rig: RigData) -> list[str]:
    """Return which schedules are held at an end far from the flight's q̄, as of another unit."""
    if rig.flight is None:
        return []
    flown = pressure_at(rig.flight.calibrated_airspeed)
    ends = {
        name: (control.schedule.dynamic_pressure[0], control.schedule.dynamic_pressure[-1])
        for name, control in rig.controls.items()
        if len(control.schedule.dynamic_pressure) > 1
    }
    return [
        f"controls.{name}.schedule.dynamic_pressure_Pa goes from {low:g} to {high:g}, and the"
        f" flight is at {flown:.3g} Pa: is it in another unit?"
        for name, (low, high) in ends.items()
        if not low / WRONG_UNIT < flown < high * WRONG_UNIT
    ]


def full_force(control: Control) -> float:
    """Return the specified force at full travel and the stiffest schedule, N."""
    schedule, loader = control.schedule, control.loader
    spring = max(loader.basic_gradient, *map(max, schedule.segments)) * control.travel
    if schedule.force is not None:
        spring = max(abs(force) for row in schedule.force for force in row)
    return spring + loader.breakout + loader.friction


def _check_dissipation(control: Control, file: object, path: str, d: str) -> None:
    """Refuse a friction curve that drives the hand, friction and damping included.

    Beyond its nodes up to the rate that the force of full travel gives the mass from stop to stop.
    """
    loader, travel, full_N = control.loader, control.travel, full_force(control)
    curve: FrictionCurve = loader.friction_curve
    rates = np.array(curve.rate)
    push = "force_push_N" if curve.force_push else "force_N"
    for key, forces, own_N in (
        ("force_N", curve.force, loader.friction_pull),
        (push, curve.forward, loader.friction_push),
    ):
        other = loader.friction + own_N + loader.damping * rates
        whole = other + forces
        whole[np.abs(whole) <= ROUNDING * other] = 0.0
        k = int(np.argmin(whole))
        if whole[k] < 0.0:
            problem = f"is {forces[k]:g} at {rates[k]:g} {d}/s, where other friction and damping"
            problem += f" are {other[k]:.3g} N: it drives the hand; give at least {-other[k]:.3g}"
            raise InputError(file, f"{path}.{key}", problem)
        fall = -float(np.diff(whole)[-1] / np.diff(rates)[-1])
        fastest = 2.0 * math.sqrt(travel * (full_N + max(forces)) / loader.mass)
        if fall > ROUNDING * loader.damping and whole[-1] < fall * (fastest - rates[-1]):
            problem = f"falls on beyond {rates[-1]:g} {d}/s: with other friction and damping it"
            problem += f" is below 0 from {rates[-1] + whole[-1] / fall:.3g} {d}/s and drives the"
            problem += f" hand; end it with a fall of at most {loader.damping:g} N·s/{d}"
            raise InputError(file, f"{path}.{key}", problem)
