"""Which readings to take: at which gradients and deflections, and how many.

The error of K follows from the design before anything is read: with information
M = Σ x·xᵀ/w over readings x = (δ, F), its variance is cᵀ·M⁻¹·c, c the derivative of K
= −b/a by (a, b). Only two corners matter to it, the softest gradient at full travel and the
stiffest at full force; what lies between shows whether the bend is straight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import t as student

from coupled.calibration.belief import real_scales
from coupled.calibration.estimate import COVERAGE, Instruments
from coupled.channels import ControlName, unit_of
from coupled.errors import InputError
from coupled.rig.parameters import Rig
from coupled.rig.statics import static_point

Floats = NDArray[np.float64]
STRONGEST_N = 150.0  # two thirds of what 14 CFR 25.143(d) allows one hand for a short time
NEAREST, FARTHEST = 0.4, 1.0  # deflections within what travel and force allow, as shares
FULL_TRAVEL = 0.95
MOST_READINGS = 400
USUAL_LOSS = 0.1  # K·G taken at the stiffest gradient where the host believes no K yet


@dataclass(frozen=True)
class Station:
    """Where a reading is taken: gradient set, the q̄ that gives it, δ in d and F in N there."""

    label: str
    pressure_Pa: float
    gradient: float
    deflection: float
    force: float


@dataclass(frozen=True)
class Precision:
    """What a design gives: readings, and K's standard error and half of its 95 % interval.

    Both as shares of `bend`, the K in d/N that was assumed.
    """

    readings: int
    bend: float
    error: float
    half_width: float


def gradient_sets(rig: Rig, control: ControlName, count: int) -> list[tuple[float, float]]:
    """Return (q̄ in Pa, G_T in N/d) of so many gradients, even from the schedule's least to most."""
    table = rig.controls[control].schedule
    pressures, gradients = np.array(table.dynamic_pressure), np.array(table.total_gradient)
    low, high = int(np.argmin(gradients)), int(np.argmax(gradients))
    if gradients[high] <= gradients[low] * (1.0 + 1e-6):
        key = f"controls.{control}.schedule"
        problem = "has one gradient only, and one cannot tell S1 from K; give it a second"
        raise InputError(rig.name, key, problem)
    way = slice(low, high + 1) if low < high else slice(high, low + 1)
    fine = np.linspace(pressures[way][0], pressures[way][-1], 4001)
    along = np.interp(fine, pressures, gradients)
    wanted = np.linspace(gradients[low], gradients[high], count)
    found = []
    for value in wanted:
        at = float(fine[int(np.argmin(np.abs(along - value)))])
        found.append((at, float(np.interp(at, pressures, gradients))))
    return found


def stations(
    rig: Rig,
    control: ControlName,
    gradients: int,
    deflections: int,
    strongest_N: float = STRONGEST_N,
) -> list[Station]:
    """Return a grid: so many gradients, each at as many deflections as hand and travel allow."""
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
    """Return how far out a control can be held with so many N, d."""
    full = FULL_TRAVEL * rig.controls[control].travel
    tiny = 1e-3 * full

    def excess(deflection: float) -> float:
        return float(static_point(rig, control, pressure, deflection).force[0]) - strongest_N

    if excess(full) <= 0.0:
        return full
    if excess(tiny) >= 0.0:
        problem = f"{strongest_N:g} N does not overcome the breakout; give more"
        raise InputError(rig.name, "--strongest-N", problem)
    return float(brentq(excess, tiny, full, rtol=1e-6))


def precision(
    rig: Rig, control: ControlName, design: Sequence[Station], instruments: Instruments
) -> Precision:
    """Return what a design gives, for the K that the host believes or a usual one."""
    rows, c, bend = _rows(rig, control, design, instruments)
    return _precision(rows.T @ rows, c, bend, len(design))


def fewest(
    rig: Rig,
    control: ControlName,
    instruments: Instruments,
    share: float,
    strongest_N: float = STRONGEST_N,
) -> list[tuple[Station, int]]:
    """Return the fewest readings whose 95 % interval of K is ± this share of it, by station.

    Each in turn is the one that helps most. Raises InputError where very many do not do.
    """
    grid = stations(rig, control, 5, 4, strongest_N)
    rows, c, bend = _rows(rig, control, grid, instruments)
    counts = np.zeros(len(grid), dtype=int)
    ends = [int(np.argmax(rows[:, 0])), int(np.argmax(rows[:, 1]))]
    counts[ends] += 1
    while counts.sum() < MOST_READINGS:
        information = (rows * counts[:, None]).T @ rows
        reached = _precision(information, c, bend, int(counts.sum()))
        if counts.sum() >= 4 and reached.half_width <= share:
            return [(s, int(n)) for s, n in zip(grid, counts, strict=True) if n]
        pull = rows @ np.linalg.solve(information, c)
        spread = np.einsum("ij,jk,ik->i", rows, np.linalg.inv(information), rows)
        counts[int(np.argmax(pull**2 / (1.0 + spread)))] += 1
    problem = f"{MOST_READINGS} readings do not give K to ±{100 * share:g} %; ask for less"
    raise InputError(rig.name, "--precision", problem)


def _rows(
    rig: Rig, control: ControlName, design: Sequence[Station], instruments: Instruments
) -> tuple[Floats, Floats, float]:
    """Return the whitened rows (δ, F)/√w, c, and the K in d/N assumed."""
    data = rig.controls[control]
    s1 = real_scales(data).s1
    bend = data.compensation.bend or USUAL_LOSS / max(data.schedule.total_gradient)
    delta = np.array([station.deflection for station in design])
    force = np.array([station.force for station in design])
    variance = (
        s1**2 * instruments.deflection_variance(delta)
        + (s1 * bend) ** 2 * instruments.force_variance(force)
        + instruments.voltage_variance(s1 * (delta - bend * force))
    )
    rows = np.column_stack((delta, force)) / np.sqrt(variance)[:, None]
    return rows, np.array([-bend / s1, -1.0 / s1]), bend


def _precision(information: Floats, c: Floats, bend: float, count: int) -> Precision:
    error = float(np.sqrt(c @ np.linalg.solve(information, c))) / bend
    wide = float(student.ppf(0.5 + 0.5 * COVERAGE, count - 2)) if count > 2 else np.inf
    return Precision(count, bend, error, wide * error)


def form(chosen: Sequence[tuple[Station, int]], control: str) -> str:
    """Return a plan as a CSV to be filled in: where to hold, and empty cells to write into."""
    unit = unit_of(control)
    lines = [f"gradient_set,deflection_{unit},force_N,v1_V,v3_V,v2_V,remark"]
    for station, count in chosen:
        where = f"hold at {station.deflection:.4g} {unit} and about {station.force:.3g} N"
        where += f" with the host told {station.pressure_Pa:.5g} Pa"
        lines += [f"{station.label},,,,,,{where}"] * count
    return "\n".join(lines) + "\n"
