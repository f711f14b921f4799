"""Numbers of a rig that no machine has, by the ratios between them.

A rig may be of any size, so lengths are compared with its travel. Only the travel of a control of
an aircraft is compared with the reach of a hand.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from coupled.errors import InputError
from coupled.rig.curves import Curve, FrictionCurve
from coupled.rig.parameters import Control
from coupled.rig.rigdata import RigData
from coupled.schema import Section, file_keys

# Times the travel: in, deg, cm and mm read as m or rad are 39, 57, 100 and 1000 times too large.
WRONG_UNIT = 10.0
REACHED = {"m": 1.0, "rad": 2.0 * math.pi}  # of a hand on column and pedals, and on a wheel
ROUNDING = 1e-9  # of a sum of numbers that cancel
# Beyond the travel these have no effect, and a fit may leave them there.
_FREE = ("bend_limit", "ripple_period")


def check_bounds(rig: RigData, control: Control, file: object, path: str, d: str) -> None:
    """Refuse an impossible travel, length, bend or friction curve of a control."""
    travel, key, loader = control.travel, f"travel_{d}", control.loader
    unit = "is it in another unit?"
    if rig.flight is not None and travel > REACHED[d]:
        problem = f"is {travel:g}: {unit} a hand reaches {REACHED[d]:.3g} {d} at most"
        raise InputError(file, f"{path}.{key}", problem)
    most, full_N = WRONG_UNIT * travel, full_force(control)
    for part in ("loader", "schedule", "sensing", "services"):
        for where, size in _lengths(getattr(control, part), f"{path}.{part}", d, travel, full_N):
            if size > most:
                problem = f"reaches {size:.4g}, {size / travel:.3g} times {key} = {travel:g}: "
                raise InputError(file, where, f"{problem}{unit} give at most {most:g}")
    for name in ("bend", "bend_push"):
        if (bent := (getattr(loader, name) or 0.0) * full_N) > most:
            problem = f"gives {bent:.3g} {d} at the force of full travel, {full_N:.3g} N, with"
            problem = f"{problem} {key} = {travel:g}: {unit} give at most {most / full_N:.3g}"
            raise InputError(file, f"{path}.loader.{name}_{d}_per_N", problem)
    if loader.friction_curve.nodes:
        _check_dissipation(control, full_N, file, f"{path}.loader.friction_curve", d)


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


def _lengths(
    section: Section, path: str, d: str, travel: float, full_N: float
) -> Iterator[tuple[str, float]]:
    """Yield the lengths, or angles, of a section and its curves: key and largest size.

    Of a curve those of its inner nodes, since its ends may lie anywhere, and of its values at full
    travel, or at its end within it.
    """
    keys = file_keys(type(section), d)
    if isinstance(section, Curve):
        if section.nodes:
            of, value, *_ = ((key, key == f"{field}_{d}") for key, field in keys.items())
            ends = np.array([-1.0, 1.0]) * min(travel if of[1] else full_N, section.nodes[-1])
            sizes = (of, section.nodes[1:-1]), (value, section.at(ends).tolist())
            for (key, is_length), given in sizes:
                if is_length:
                    yield f"{path}.{key}", max(map(abs, given), default=0.0)
        return
    for key, field in keys.items():
        value = getattr(section, field)
        if isinstance(value, Section):
            yield from _lengths(value, f"{path}.{key}", d, travel, full_N)
        elif key == f"{field}_{d}" and field not in _FREE and value:
            yield f"{path}.{key}", max(map(abs, value if isinstance(value, list) else [value]))


def _check_dissipation(control: Control, full_N: float, file: object, path: str, d: str) -> None:
    """Refuse a friction curve that drives the hand, friction and damping included.

    Beyond its nodes up to the rate that the force of full travel gives the mass from stop to stop.
    """
    loader, travel = control.loader, control.travel
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
