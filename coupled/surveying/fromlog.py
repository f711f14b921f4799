"""Estimates of a control's parameters from a log, by its static line and its free response.

The control is modelled as a mass on a spring with friction and breakout,

    F = m·ẍ + c·ẋ + G·x + F_f·sgn(ẋ) + F_bo·sgn(x) + F_0,

where x is the computed deflection, or the grip's in a log without it. The grip moves by K·F more,
so that the gradient there is G/(1 + K·G). The numbers satisfy it by least squares in the weak form:
multiplied by smooth functions φ that vanish with their slopes at the ends of a window, and
integrated by parts, so that no measured signal is differentiated twice. A slow sweep gives G, F_f
and F_bo, a control that is let go m and c. `coupled fit` starts from such numbers, and finds them
by the rig's own physics.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from coupled.errors import InputError
from coupled.record.channels import ControlName, channel
from coupled.record.importing.plausible import check_size
from coupled.record.record import Record
from coupled.record.samples import check_samples
from coupled.rig.equations import felt_gradient

Floats = NDArray[np.float64]
_WINDOWS_s = (0.2, 0.8)  # short ones for mass and damping, long ones for the gradient
_SMOOTHED_s = 0.04  # before the rate's sign is taken
_MOVES = 0.1  # of the median rate: a slower control may stick, with friction below F_f
_STILL = 1e-3  # of the greatest rate
_LEAST_WINDOWS = 40
_SURE = 0.1  # of a number, or of the greatest force for friction and breakout: 2 standard errors
_BENT = 1e-3  # of the travel: a smaller difference of δ and δc is no bend


@dataclass(frozen=True)
class LogNumbers:
    """The parameters of a control from a log: SI, d being m or rad.

    `travel` is the greatest deflection in it, `gradient` that at the grip. `sure` are the names of
    those whose 95 % interval is within a tenth: `mass`, `damping`, `gradient`, `breakout_N`,
    `friction_N`, `bend`. `bend` is 0 where the log has not both deflections.
    """

    travel: float
    mass: float
    damping: float
    gradient: float
    breakout_N: float
    friction_N: float
    bend: float
    sure: frozenset[str]


def numbers_from_log(record: Record, control: ControlName, file: object) -> LogNumbers:
    """Return a control's parameters from a record of slow motion and of releases.

    The record needs the force, and the deflection or the computed one. Raises InputError with
    `file` if one is missing, a cell is empty, a deflection is in another unit, or the control
    hardly moves.
    """
    force_name, deflections = channel(control, "force"), ("deflection", "computed")
    names = [channel(control, each) for each in deflections]
    there = [name for name in names if name in record.channels]
    if force_name not in record.channels or not there:
        lacking = force_name if force_name not in record.channels else names[0]
        problem = f"is missing: a first rig needs the force and a deflection of the {control}"
        raise InputError(file, lacking, problem)
    check_samples(record, file)
    force, x = record[force_name], record[there[-1]]
    travel = float(np.max(np.abs(record[there[0]])))
    if travel <= 0.0 or float(np.ptp(force)) <= 0.0:
        raise InputError(file, there[0], f"the {control} does not move, or no force acts on it")
    for name in there:
        check_size(name, record[name], file)
    columns, found, errors = _fitted(record.time_s, x, force, travel, file)
    values = dict(zip(columns, found, strict=True))
    limits = dict.fromkeys(columns, 0.0)
    most = float(np.max(np.abs(force)))
    limits |= {"breakout_N": _SURE * most, "friction_N": _SURE * most}
    sure = {
        name
        for name, value, error in zip(columns, found, errors, strict=True)
        if 2.0 * error <= max(_SURE * value, 0.2 * limits[name])
    }
    bend = 0.0
    if len(there) == 2:
        bent = record[names[0]] - record[names[1]]
        bent, pulled = bent - np.mean(bent), force - np.mean(force)
        bend = max(0.0, float(np.dot(bent, pulled) / np.dot(pulled, pulled)))
        if bend * most > _BENT * travel:
            sure.add("bend")
    return LogNumbers(
        travel=travel,
        mass=values["mass"],
        damping=values["damping"],
        gradient=felt_gradient(values["gradient"], bend),
        breakout_N=values["breakout_N"],
        friction_N=values["friction_N"],
        bend=bend,
        sure=frozenset(sure),
    )


def _fitted(
    time_s: Floats, x: Floats, force: Floats, travel: float, file: object
) -> tuple[list[str], Floats, Floats]:
    """Return the names of the numbers, their values, and their standard errors."""
    h = float(np.median(np.diff(time_s)))
    width = max(3, round(_SMOOTHED_s / h) | 1)
    calm = np.convolve(x, np.full(width, 1.0 / width), mode="same")
    rate = np.gradient(calm, h)
    speed = np.abs(rate)
    moving = speed > _MOVES * float(np.median(speed[speed > _STILL * np.max(speed)]))
    # The mean sign over a sampling interval: a step between two samples counts in part.
    side = np.clip(2.0 * x / np.maximum(np.abs(np.gradient(x)), 1e-9 * travel), -1.0, 1.0)
    signals = (np.sign(rate), side)
    rows = list(_windows(h, x, force, signals, moving))
    if len(rows) < _LEAST_WINDOWS:
        problem = f"moves the control for {len(rows)} windows of {_WINDOWS_s[0]} s and more only"
        raise InputError(file, "", f"{problem}; give at least {_LEAST_WINDOWS}: sweep it slowly,")
    table = np.array(rows)
    a, b = table[:, :-1], table[:, -1]
    scale = np.linalg.norm(a, axis=0)
    scale[scale == 0.0] = 1.0
    # A zero of the force may have either sign; all other numbers are not negative.
    both = np.column_stack((a / scale, -a[:, -1] / scale[-1]))
    solved, _ = nnls(both, b)
    residual = b - both @ solved
    used = a / scale
    freedom = max(1, len(b) - used.shape[1])
    covariance = np.linalg.pinv(used.T @ used) * float(residual @ residual) / freedom
    errors = np.sqrt(np.diag(covariance))[:-1] / scale[:-1]
    names = ["mass", "damping", "gradient", "friction_N", "breakout_N"]
    return names, solved[:5] / scale[:5], errors


def _windows(
    h: float,
    x: Floats,
    force: Floats,
    signals: tuple[Floats, Floats],
    moving: NDArray[np.bool_],
) -> Iterator[list[float]]:
    """Yield one least squares row per window: m, c, G, F_f, F_bo, F_0, and the right side."""
    for length_s in _WINDOWS_s:
        n = max(8, round(length_s / h))
        s = np.linspace(-1.0, 1.0, n + 1)
        half = 0.5 * n * h
        phi = (1.0 - s**2) ** 4
        slope = -8.0 * s * (1.0 - s**2) ** 3 / half
        bow = (-8.0 * (1.0 - s**2) ** 3 + 48.0 * s**2 * (1.0 - s**2) ** 2) / half**2
        weight = 1.0 / float(np.sum(phi))
        for start in range(0, len(x) - n, max(1, n // 2)):
            part = slice(start, start + n + 1)
            if not moving[part].all():
                continue
            dry, preload = (float(phi @ each[part]) for each in signals)
            terms = [float(bow @ x[part]), float(-slope @ x[part]), float(phi @ x[part])]
            row = [*terms, dry, preload, float(np.sum(phi)), float(phi @ force[part])]
            yield [weight * each for each in row]
