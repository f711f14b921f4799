"""A plan of readings: gradients, deflections and numbers.

The error of K follows from the design: with the information M = Σ Xᵀ·X over the readings' whitened
derivatives X by (a, b, S₃), its variance is cᵀ·M⁻¹·c, c being the derivative of K = −b/a. Only two
corners of the design matter: the softest gradient at full travel and the stiffest at full force.
Readings in between show whether the bend is straight. The interval has the degrees of freedom of a
fit to the design.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from coupled.calibration.accuracy import DEFLECTION_WITHIN
from coupled.calibration.assumedscales import real_scales
from coupled.calibration.errors_in_variables import expected_design
from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.readings import readings_of
from coupled.calibration.sandwich import sandwich
from coupled.errors import InputError
from coupled.record.channels import ControlName
from coupled.rig.equations import bend_loss, specified_gradient, volts, volts_of_computed
from coupled.rig.rig import Rig
from coupled.rig.statics import static_line, static_point

Floats = NDArray[np.float64]
STRONGEST_N = 150.0  # two thirds of what 14 CFR 25.143(d) allows one hand for a short time
NEAREST, FARTHEST = 0.4, 1.0  # deflections, as shares of what travel and force allow
FULL_TRAVEL = 0.95
_LEAVES = 1e-6  # of full travel, δc of a loader that has just left its breakout
MOST_READINGS = 400
FINEST = 100.0  # largest factor by which an instrument may be better: 3 µm for 0.3 mm
NORMAL_95 = 1.96
USUAL_LOSS = 0.1  # K·G at the stiffest gradient, if the host assumes no K yet


@dataclass(frozen=True)
class Station:
    """A point of a plan: gradient set, the q̄ that gives it, δ in d and F in N."""

    label: str
    pressure_Pa: float
    gradient: float
    deflection: float
    force: float


@dataclass(frozen=True)
class Precision:
    """The precision of a design: readings, and K's standard error and half 95 % interval.

    Both are relative to `bend`, the K in d/N that was assumed.
    """

    readings: int
    bend: float
    error: float
    half_width: float


def gradient_sets(rig: Rig, control: ControlName, count: int) -> list[tuple[float, float]]:
    """Return (q̄ in Pa, G_T in N/d) of evenly spaced gradients over the schedule's range."""
    table = rig.controls[control].schedule
    pressures, gradients = np.array(table.dynamic_pressure), np.array(table.gradients)
    low, high = int(np.argmin(gradients)), int(np.argmax(gradients))
    if gradients[high] <= gradients[low] * (1.0 + 1e-6):
        key = f"controls.{control}.schedule"
        problem = "has one gradient only, which does not separate S1 from K; give a second"
        raise InputError(rig.place, key, problem)
    way = slice(low, high + 1) if low < high else slice(high, low + 1)
    fine = np.linspace(pressures[way][0], pressures[way][-1], 4001)
    along = specified_gradient(table, fine)
    wanted = np.linspace(gradients[low], gradients[high], count)
    found = []
    for value in wanted:
        at = float(fine[int(np.argmin(np.abs(along - value)))])
        found.append((at, float(specified_gradient(table, at))))
    return found


def stations(
    rig: Rig,
    control: ControlName,
    gradients: int,
    deflections: int,
    strongest_N: float = STRONGEST_N,
) -> list[Station]:
    """Return a grid of gradients and deflections, as far as hand and travel allow."""
    grid = []
    for number, (pressure, gradient) in enumerate(gradient_sets(rig, control, gradients), start=1):
        full = _reach(rig, control, pressure, strongest_N)
        shares = np.linspace(NEAREST, FARTHEST, deflections) if deflections > 1 else [FARTHEST]
        for share in shares:
            point = static_point(rig, control, pressure, float(share * full))
            force = float(point.force[0])
            grid.append(Station(str(number), pressure, gradient, float(share * full), force))
    return grid


def _reach(rig: Rig, control: ControlName, pressure: float, strongest_N: float) -> float:
    """Return the largest deflection at which this force can hold a control, d."""
    full = FULL_TRAVEL * rig.controls[control].pull

    def excess(deflection: float) -> float:
        return float(static_point(rig, control, pressure, deflection).force[0]) - strongest_N

    if excess(full) <= 0.0:
        return full
    leaves = static_line(rig, control, pressure, np.array([_LEAVES * full]))
    if leaves.force[0] >= strongest_N:
        problem = f"{strongest_N:g} N does not overcome the breakout; give more"
        raise InputError(rig.place, "--strongest-N", problem)
    return float(brentq(excess, float(leaves.deflection[0]), full, rtol=1e-6))


def precision(
    rig: Rig,
    control: ControlName,
    design: Sequence[Station],
    instruments: Instruments,
    looks: int = 2,
) -> Precision:
    """Return the precision of a design, for the K that the host assumes or a usual one.

    `looks`: number of readings of ruler and scale.
    """
    rows, c, bend = _rows(rig, control, design, instruments, looks)
    return _precision(rows, c, bend)


def fewest(
    rig: Rig,
    control: ControlName,
    instruments: Instruments,
    share: float,
    strongest_N: float = STRONGEST_N,
    looks: int = 2,
) -> list[tuple[Station, int]]:
    """Return the fewest readings for a 95 % interval of K of ± this share, by station.

    Readings are added one by one, each with the largest gain. Raises InputError if
    `MOST_READINGS` are not enough.
    """
    grid = stations(rig, control, 5, 4, strongest_N)
    rows, c, bend = _rows(rig, control, grid, instruments, looks)
    counts = np.zeros(len(grid), dtype=int)
    counts[_ends(rows)] += 1
    while counts.sum() < MOST_READINGS:
        information = np.einsum("n,nmp,nmq->pq", counts, rows, rows)
        error = np.sqrt(c @ np.linalg.solve(information, c)) / bend
        if counts.sum() >= 4 and NORMAL_95 * error <= share:
            reached = _precision(np.repeat(rows, counts, axis=0), c, bend)
            if reached.half_width <= share:
                return [(s, int(n)) for s, n in zip(grid, counts, strict=True) if n]
        counts[_most_helpful(rows, information, c)] += 1
    problem = f"{MOST_READINGS} readings do not give K to ±{100 * share:g} %; ask for less"
    raise InputError(rig.place, "--precision", problem)


def _ends(rows: Floats) -> list[int]:
    """Return the two readings that determine a, b and S₃ best: far out, and at full force."""
    ends = [int(np.argmax(rows[:, 0, 0])), int(np.argmax(rows[:, 1, 2]))]
    if ends[0] != ends[1]:
        return ends
    # One station is both: the other one maximises the determinant of the information.
    own = np.einsum("nmp,nmq->npq", rows, rows)
    size = np.sqrt(np.diag(own[ends[0]])) + 1e-300
    together = np.linalg.det((own + own[ends[0]]) / np.outer(size, size))
    return [ends[0], int(np.argmax(together))]


def _most_helpful(rows: Floats, information: Floats, c: Floats) -> int:
    """Return the further reading that reduces K's variance most."""
    lifted = rows @ np.linalg.inv(information)
    pull = lifted @ c
    inner = np.eye(rows.shape[1]) + lifted @ rows.transpose(0, 2, 1)
    less = np.einsum("nm,nm->n", pull, np.linalg.solve(inner, pull[:, :, None])[:, :, 0])
    return int(np.argmax(less))


def _rows(
    rig: Rig,
    control: ControlName,
    design: Sequence[Station],
    instruments: Instruments,
    looks: int,
) -> tuple[Floats, Floats, float]:
    """Return the whitened derivatives by (a, b, S₃), c, and the K in d/N assumed."""
    data = rig.controls[control]
    scales = real_scales(data)
    bend = data.compensation.bend or USUAL_LOSS / max(data.schedule.gradients)
    delta = np.array([station.deflection for station in design])
    force = np.array([station.force for station in design])
    read = (volts_of_computed(scales.s1, delta, force, bend), volts(scales.s3, force))
    rise = np.full((2, len(design)), 0.0 if looks == 2 else np.nan)
    columns = np.stack((delta, force, *read, *rise))
    labels = [station.label for station in design]
    readings = readings_of(range(len(design)), labels, columns, [], np.empty((4, 0)))
    figures = (scales.s1, -scales.s1 * bend, scales.s3)
    c = np.array([-bend / scales.s1, -1.0 / scales.s1, 0.0])
    return expected_design(readings, instruments, figures), c, bend


def _precision(rows: Floats, c: Floats, bend: float) -> Precision:
    count = len(rows)
    if count < 3:
        return Precision(count, bend, np.inf, np.inf)
    errors = sandwich(rows, np.zeros(rows.shape[:2]))
    variance = float(np.sum((errors.back.T @ c) ** 2))
    found = Estimate(bend, float(np.sqrt(variance)), errors.freedom(c)).scaled(1.0 / bend)
    return Precision(count, bend, found.error, found.half_width)


@dataclass(frozen=True)
class DeflectionNeeds:
    """Requirements for a compensated rig's δ̂ to be within a share of δ, in 95 % of cases.

    `half_width` is that of the design, at the gradient where it is largest. Each of the rest alone
    reduces it to `wanted`: so many `readings`, distributed as in the design; a ruler with an error
    smaller by the factor `ruler`; or all instruments and the hand by `all`. None if it does not
    suffice.
    """

    wanted: float
    half_width: float
    readings: int | None
    ruler: float | None
    all: float | None


def deflection_needs(
    rig: Rig,
    control: ControlName,
    design: Sequence[Station],
    instruments: Instruments,
    looks: int = 2,
    wanted: float = DEFLECTION_WITHIN,
) -> DeflectionNeeds:
    """Return the precision of δ̂ with a design, and the requirements for `wanted`."""
    names = ("ruler", "ruler_step", "scale", "scale_step", "meter", "meter_step", "hand")

    def reached(times: int, factor: float = 1.0, finer: Sequence[str] = ()) -> float:
        better = {name: getattr(instruments, name) / factor for name in finer}
        rows, _, bend = _rows(rig, control, design, replace(instruments, **better), looks)
        return _deflection_half_width(rig, control, np.repeat(rows, times, axis=0), bend)

    def factor_of(finer: Sequence[str]) -> float | None:
        if reached(1, FINEST, finer) > wanted:
            return None
        return float(brentq(lambda f: reached(1, f, finer) - wanted, 1.0, FINEST, rtol=1e-3))

    now = reached(1)
    if now <= wanted:
        return DeflectionNeeds(wanted, now, len(design), 1.0, 1.0)
    most = MOST_READINGS // len(design) + 1
    enough = next((n * len(design) for n in range(2, most) if reached(n) <= wanted), None)
    return DeflectionNeeds(wanted, now, enough, factor_of(names[:2]), factor_of(names))


def _deflection_half_width(rig: Rig, control: ControlName, rows: Floats, bend: float) -> float:
    """Return half of the 95 % interval of δ̂/δ, at the gradient where it is largest."""
    if len(rows) < 3:
        return float("inf")
    errors, scales = sandwich(rows, np.zeros(rows.shape[:2])), real_scales(rig.controls[control])
    table = rig.controls[control].schedule.gradients
    widths = []
    for g in np.linspace(min(table), max(table), 9):
        lost = bend_loss(bend, float(g))
        # of δ̂/δ = (S₁/Ŝ₁)·(1 − K·G) + K̂·G·S₃/Ŝ₃ by a = S₁, b = −K·S₁ and S₃
        by_a = -(1.0 - lost) / scales.s1 - lost / scales.s1
        slope = np.array([by_a, -float(g) / scales.s1, -lost / scales.s3])
        variance = float(np.sum((errors.back.T @ slope) ** 2))
        found = Estimate(1.0, float(np.sqrt(variance)), errors.freedom(slope))
        widths.append(found.half_width)
    return max(widths)
