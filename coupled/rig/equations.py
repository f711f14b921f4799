"""The report's equations as closed forms, each in one place.

    (1)  δc = δ − K·F              (2)  v₁ = S₁·δc           (3)  v₁ = S₁·(δ − K·F)
    (6)  F = G_T·δ                 (7)  δc = δ·(1 − K·G_T)   (7a) Δδc = −δ·K·G_T
    (8)  F_L = G_B·δc              (9)  F_mod = F − F_L      (10) F_mod = G_T·δ − G_B·δc
    (11) F_mod = ΔG·δc             (12) ΔG = G_T/(1 − K·G_T) − G_B

Each works on numbers and on arrays. The kernels compile the same functions (`stage`), so that each
equation is in one place only. d is m, or rad for a wheel: δ and δc in d, F in N, gradients in N/d,
K in d/N. This module needs no compiler, so that it is imported quickly.
"""

from __future__ import annotations

from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ControlName
from coupled.rig.parameters import Schedule
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
N = TypeVar("N", float, Floats)


def specified_gradient(schedule: Schedule, pressure_Pa: N) -> N:
    """Return the G_T in N/d of a rig's table at q̄; of the shape of q̄.

    Linear between the table's rows and constant beyond; below the break, if there is one, and the
    steepest of a curve. The table as filed: faults of its use (`slope`, `pressure_scale`) are left
    out.
    """
    return _looked_up(schedule.dynamic_pressure, schedule.gradients, pressure_Pa)


def gradient_at_neutral(schedule: Schedule, pressure_Pa: N) -> N:
    """Return G_T in N/d at q̄ beside neutral: of a curve, on the softer side.

    As `specified_gradient`, which it is without a curve.
    """
    nodes, segments = schedule.deflection, schedule.segments
    beside = [0] if nodes is None else [max(nodes.index(0.0) - 1, 0), nodes.index(0.0)]
    softer = [min(row) for row in zip(*(segments[k] for k in beside), strict=True)]
    return _looked_up(schedule.dynamic_pressure, softer, pressure_Pa)


def second_gradient(schedule: Schedule, pressure_Pa: N) -> N:
    """Return the slope in N/d of the table beyond the break; G_T if there is one segment."""
    table = schedule.second_gradient or schedule.total_gradient
    return _looked_up(schedule.dynamic_pressure, table, pressure_Pa)


def specified_force(
    rig: Rig, control: str, pressure_Pa: float | Floats, deflection: Floats
) -> Floats:
    """Return the force in N specified at δ in d: eq. (6), with breakout and two segments.

    F_BO + G₁·δ up to the break δ₁, and the slope G₂ beyond (appendix C), odd in δ; or F_BO and the
    curve.
    """
    data = rig.controls[cast(ControlName, control)]
    pressure = np.asarray(pressure_Pa, dtype=float)
    if data.schedule.curved:
        preload = np.sign(deflection) * data.loader.breakout
        return np.asarray(preload + curve_force(data.schedule, pressure, deflection))
    first = specified_gradient(data.schedule, pressure)
    second = second_gradient(data.schedule, pressure)
    size, at = np.abs(deflection), data.schedule.break_deflection
    beyond = np.maximum(size - at, 0.0) if at else 0.0
    slope_part = first * (size - beyond) + second * beyond
    return np.asarray(np.sign(deflection) * (data.loader.breakout + slope_part))


def curve_force(schedule: Schedule, pressure_Pa: float | Floats, deflection: Floats) -> Floats:
    """Return the force in N beyond the breakout that a curve specifies at δ in d.

    Linear between the deflections, and beyond them at the slope of the last segment. The table as
    filed: faults of its use are left out.
    """
    nodes, rows = np.array(schedule.deflection or []), np.array(schedule.force or [])
    size = np.abs(deflection) if nodes[0] == 0.0 else np.asarray(deflection)
    pressure, size = np.broadcast_arrays(np.asarray(pressure_Pa, dtype=float), size)
    node = np.clip(np.searchsorted(nodes, size, "right") - 1, 0, len(nodes) - 2)
    share = (size - nodes[node]) / np.diff(nodes)[node]
    at_rows = rows[:, node] + share * np.diff(rows, axis=1)[:, node]
    pressures = np.array(schedule.dynamic_pressure)
    place = np.interp(pressure, pressures, np.arange(len(pressures)))
    row = np.minimum(place.astype(int), max(len(pressures) - 2, 0))
    above = np.minimum(row + 1, len(pressures) - 1)
    low, high = (np.take_along_axis(at_rows, r[None], 0)[0] for r in (row, above))
    force = low + (place - row) * (high - low)
    return np.asarray(np.sign(deflection) * force if nodes[0] == 0.0 else force)


def _looked_up(pressures: list[float], gradients: list[float], pressure_Pa: N) -> N:
    found: N = np.interp(pressure_Pa, pressures, gradients)
    return found


def computed_deflection(deflection: N, force: N, bend: float) -> N:
    """Return δc in d of a control at δ in d under F in N: eq. (1)."""
    return deflection - bend * force


def true_deflection(computed: N, force: N, bend: float) -> N:
    """Return δ in d at δc in d under F in N: eq. (1) solved for δ."""
    return computed + bend * force


def seen_deflection(deflection: N, bend: float, gradient: float) -> N:
    """Return δc in d if the pilot feels F = `gradient`·δ: eq. (7)."""
    return computed_deflection(deflection, gradient * deflection, bend)


def volts(scale: float, quantity: N) -> N:
    """Return a quantity as a voltage, by its scale in V per unit: eq. (2)."""
    return scale * quantity


def volts_of_computed(scale: float, deflection: N, force: N, bend: float) -> N:
    """Return v₁ in V at δ in d under F in N, for S₁ in V/d: eq. (3), which is (1) in (2)."""
    return volts(scale, computed_deflection(deflection, force, bend))


def bend_loss(bend: float, gradient: N) -> N:
    """Return the lost share of the deflection if the pilot feels `gradient`: eq. (7a).

    K in d/N, G_T in N/d, without unit; the host takes δc for δ.
    """
    return bend * gradient


def low_calibration_loss(bend: float, gradient: N, low: float) -> N:
    """Return the lost share for a host whose S₁ was calibrated at a low gradient: eq. (7a).

    At a felt gradient `low` G₀, v₁ = S₁·(1 − K·G₀)·δ; taken for the scale of δ, it includes the
    bend at G₀. At a felt `gradient` G_T the share K·(G_T − G₀)/(1 − K·G₀) of δ is lost: zero at G₀,
    and negative below, where the surface exceeds the command. Without unit, for K in d/N and
    felt gradients in N/d; with G₀ = 0 it is `bend_loss`.
    """
    return bend_loss(bend, gradient - low) / (1.0 - bend_loss(bend, low))


def uncompensated_loss(bend: float, gradient: N) -> N:
    """Return the lost share if the loader holds F = G_T·δc: K·G_T/(1 + K·G_T)."""
    return bend * felt_gradient(gradient, bend)


def felt_gradient(gradient: N, bend: float) -> N:
    """Return F/δ in N/d if the loader holds F = `gradient`·δc: eqs. (1) and (8)."""
    return gradient / (1.0 + bend * gradient)


def total_to_computed(gradient: N, bend: float) -> N:
    """Return the gradient on δc, N/d, that is felt as `gradient` on δ: eq. (12)'s first term."""
    return gradient / (1.0 - bend * gradient)


def modifying_gradient(gradient: N, bend: float, basic: float) -> N:
    """Return ΔG in N/d for G_T and G_B in N/d: eq. (12); with K = 0 that of figure 2."""
    return total_to_computed(gradient, bend) - basic


def modifying_force(gradient: N, bend: float, basic: float, computed: N) -> N:
    """Return F_mod in N at δc in d for G_T and G_B in N/d: eq. (11)."""
    return modifying_gradient(gradient, bend, basic) * computed


def basic_force(basic: float, computed: N) -> N:
    """Return the loader's own force, N: eq. (8)."""
    return basic * computed


def added_force(force: N, available: N) -> N:
    """Return the required F_mod, N, for a wanted force and the available one: eq. (9)."""
    return force - available


def needed_force(gradient: N, deflection: N, basic: float, computed: N) -> N:
    """Return the required F_mod at δ with the loader at δc, N: eq. (10)."""
    return added_force(gradient * deflection, basic_force(basic, computed))
