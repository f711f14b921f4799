"""Refusal of insufficient or impossible readings, with advice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from coupled.calibration.errors_in_variables import FINEST
from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.fit import solve
from coupled.calibration.readings import Readings
from coupled.calibration.sandwich import sandwich
from coupled.errors import InputError
from coupled.record.channels import unit_of
from coupled.record.importing.plausible import unit_doubt
from coupled.rig.parameters import Control

Floats = NDArray[np.float64]
FEWEST = 4  # readings: two unknowns, and degrees of freedom for their errors
FEWEST_CROSSED = 2  # readings with a force on another control
INSEPARABLE = 1e3  # condition number of δ, F and the forces on others, each scaled
FAR = 0.1  # of the largest; a smaller deflection may have any sign
BEYOND_TRAVEL = 1.5  # of the travel; a larger deflection is in a wrong unit
SURELY = 0.999  # confidence that the gradients differ, that a zero is off, that K is negative


def refuse_poor(
    readings: Readings, control: Control, name: str, instruments: Instruments, file: Path | str
) -> None:
    """Raise InputError for too few readings, one force or gradient, a wrong sign or unit."""
    n, force, deflection = len(readings.row), readings.force, readings.deflection
    if n < FEWEST:
        raise InputError(
            file, "", f"has deflection and force in {n} rows; {FEWEST} readings are the least"
        )
    if np.count_nonzero(force) < FEWEST:
        raise InputError(
            file, "force", f"is not 0 in {np.count_nonzero(force)} rows; {FEWEST} at least"
        )
    rows = f"rows {readings.row[0]} to {readings.row[-1]}"
    for quantity, values in (("force", force), ("v1", readings.v1), ("v3", readings.v3)):
        if np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
            problem = f"every {quantity} is the same; S1 and K need readings that differ"
            raise InputError(file, rows, problem)
    _refuse_signs(readings, control, name, file)
    _refuse_others(readings, file)
    if len(set(readings.label)) == 1:
        why = f"all readings are of one gradient set, {readings.label[0]!r}"
    elif not _gradients_differ(readings, instruments):
        why = "all gradients F/deflection are the same to within the instruments' errors"
    else:
        return
    slope = float(force @ deflection / (deflection @ deflection))
    separating = _separating(control, slope, float(np.max(np.abs(force))), unit_of(name))
    problem = (
        f"{why}: with one gradient v1 = (S1 - S1*K*G)*deflection, and S1 and K are inseparable"
    )
    raise InputError(file, rows, f"{problem}; {separating}")


def _refuse_others(readings: Readings, file: Path | str) -> None:
    """Refuse forces on other controls that are zero, or collinear with this control's own."""
    for name, held in zip(readings.other_names, readings.others.T, strict=True):
        if np.count_nonzero(held) < FEWEST_CROSSED:
            problem = f"is not 0 in {np.count_nonzero(held)} rows; {FEWEST_CROSSED} at least"
            raise InputError(file, f"force_on_{name}", f"{problem}, or leave the column out")
    if not readings.other_names:
        return
    columns = np.column_stack((readings.deflection, readings.force, readings.others))
    if np.linalg.cond(columns / np.linalg.norm(columns, axis=0)) > INSEPARABLE:
        names = " and ".join(readings.other_names)
        problem = f"the forces on {names} go with this control's own, or with one another"
        wanted = "hold them with either sign at one force on this control"
        raise InputError(file, f"force_on_{readings.other_names[0]}", f"{problem}; {wanted}")


def _refuse_signs(readings: Readings, control: Control, name: str, file: Path | str) -> None:
    """Refuse rows with a wrong sign or unit."""
    deflection, force = readings.deflection, readings.force
    far = np.abs(deflection) > FAR * np.max(np.abs(deflection))
    far &= np.abs(force) > FAR * np.max(np.abs(force))  # friction may reverse a small force
    against = far & (deflection * force < 0.0)
    if against.any():
        row = int(readings.row[np.argmax(against)])
        problem = "force and deflection have different signs; a pull moves the control with it"
        raise InputError(file, f"row {row}", problem)
    if force @ readings.v3 < 0.0:
        raise InputError(file, "v3_V", "falls as the force grows; check its sign")
    wrong = readings.null_v2 * readings.null_v3 < 0.0
    if wrong.any():
        row = int(readings.null_row[np.argmax(wrong)])
        problem = "has another sign than v3; the supply takes the hand's place"
        raise InputError(file, f"row {row}: v2_V", problem)
    if np.median(np.abs(deflection)) > BEYOND_TRAVEL * control.travel:
        d = unit_of(name)
        problem = f"is {deflection[0]:.4g} {d}, the {name}'s travel is {control.travel:g} {d}"
        raise InputError(file, f"row {readings.row[0]}: deflection", f"{problem}; another unit?")


def _gradients_differ(readings: Readings, instruments: Instruments) -> bool:
    """Return whether F = G·δ with one G is rejected (χ² test)."""
    deflection, force = readings.deflection, readings.force
    slope = float(force @ deflection / (deflection @ deflection))
    ruler = instruments.deflection_variance(deflection, readings.deflection_looks)
    variance = instruments.force_variance(force, readings.force_looks) + slope**2 * ruler
    variance += (1e-7 * np.max(np.abs(force))) ** 2
    excess = float(np.sum((force - slope * deflection) ** 2 / variance))
    return excess > float(chdtri(len(force) - 1, 1.0 - SURELY))


def find_unit_doubts(readings: Readings, control: Control, name: str) -> list[str]:
    """Return the doubt about a unit if all gradients F/δ are outside those of the rig's schedule.

    K is in proportion to δ/F: readings in another unit than stated give it wrong by the ratio.
    """
    size = np.abs(readings.deflection)
    far = size > FAR * np.max(size)
    found = readings.force[far] / readings.deflection[far]
    filed = np.array(control.schedule.gradients)
    ends = float(np.min(found)), float(np.max(found))
    if min(*ends, float(np.min(filed))) <= 0.0:
        return []
    if ends[1] >= np.min(filed) and ends[0] <= np.max(filed):
        return []
    ratio = float(np.sqrt(ends[0] * ends[1] / (np.min(filed) * np.max(filed))))
    doubt = unit_doubt(ratio, unit_of(name) == "rad")
    if doubt is None:
        return []
    span = f"{ends[0]:.4g} to {ends[1]:.4g} N/{unit_of(name)}"
    problem = f"F/deflection is {span}, the rig's gradients {np.min(filed):.4g}"
    return [f"{problem} to {np.max(filed):.4g}: the force {doubt}"]


def find_zeros(readings: Readings, file: Path | str) -> list[str]:
    """Return a doubt for v1 and v3 if they are not 0 at zero deflection and force.

    The equations have no constant, so that a zero error of an instrument makes S1, K and S3 wrong.
    Raises InputError for one that is a large share of the signal.
    """
    own = np.column_stack((readings.deflection, readings.force, readings.others))
    signals = [("v1", own, readings.v1)]
    if readings.gauge:
        signals.append(("v3", readings.force[:, None], readings.v3))
    doubts = []
    for name, columns, signal in signals:
        zero, most = _zero(columns, signal), float(np.max(np.abs(signal)))
        if zero is None or abs(zero.value) <= max(zero.half_width_at(SURELY), FINEST * most):
            continue
        unit = readings.signal
        said = f"is {zero.value:.4g} {unit} at zero deflection and force (line through the readings"
        said += f", std. error {zero.error:.2g})"
        if abs(zero.value) > FAR * most:
            raise InputError(file, f"{name}_{unit}", f"{said}; subtract it from each reading")
        doubts.append(f"{name} {said}: correct the zero of the meter, ruler or scale")
    return doubts


def _zero(columns: Floats, signal: Floats) -> Estimate | None:
    """Return the constant of a line through the readings; None if they do not determine it."""
    design = np.column_stack((np.ones(len(signal)), columns))
    size = np.linalg.norm(design, axis=0)
    if len(signal) <= len(size) or np.linalg.cond(design / size) > INSEPARABLE:
        return None
    found = solve(design, signal)
    errors = sandwich(design[:, None, :], (signal - design @ found)[:, None])
    return errors.estimate(float(found[0]), np.eye(len(found))[0])


def _separating(control: Control, slope: float, strongest: float, d: str) -> str:
    """Return, for a message, the reading that separates S₁ and K best."""
    gradients = np.array(control.schedule.gradients)
    other = float(gradients[np.argmax(np.abs(gradients - slope))])
    if abs(other - slope) < 0.02 * abs(slope):
        return f"the rig's schedule has no other gradient than {slope:.4g} N/{d}: give it one"
    far = 0.95 * control.pull
    held = min(far, strongest / other) if other > 0.0 else far
    return (
        f"add a reading at {other:.4g} N/{d}, at {held:.3g} {d} ({held * other:.3g} N),"
        f" where these are at {slope:.4g} N/{d}"
    )
