"""Springs: forces against δc that depend on its position, and on its history.

    spring      G_B·δc + k₃·δc³
    ripple      + r·sin(2π·δc/period + phase)        cogging, teeth, a ball screw
    curve       + f(δc)                              piecewise linear (`curves`)
    gravity     + g·sin(δc + angle)                  a link on a wheel, hanging at −angle
    F_mod       limited to the actuator's force: −limit ≤ F_mod ≤ limit
    relaxation  + y,  y' = k·δc' − y/τ               a spring k in series with a damper k·τ

All but gravity act about the neutral of a trim. The loader's step uses their mean over the step.
That of the relaxing spring is exact for a uniform motion: with a = τ·(1 − e^(−h/τ))/h it is
a·y + (1 − a)·k·τ·u, u being the mean rate, so it enters the implicit step as a force and a damping.
The others are evaluated at the step's middle.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import stage
from coupled.rig.declaration import Given, first_order_gain
from coupled.rig.modification import ModificationState, modifying_force, slope, smooth_force
from coupled.rig.piecewise import along, count_of, slope_along, table_of


class SpringParameters(Protocol):
    """The loader's springs; d is m, or rad for a wheel. 0 leaves a part out."""

    basic_gradient: float  # G_B, N/d
    cubic: float  # k₃, N/d³
    ripple: float  # N
    ripple_wave: float  # 2π over the period, 1/d
    ripple_phase: float  # rad
    gravity: float  # weight of a link on a wheel, at a right angle to the vertical, N
    gravity_angle: float  # of the link at δc = 0 from where it hangs, rad
    force_limit: float  # of the actuator's F_mod, N
    relaxing: float  # stiffness of the spring that relaxes, N/d
    relaxing_time: float  # τ, s
    digital: int  # F_mod is held over the frame
    lag_gain: float  # step response of F_mod's lag in half a substep; 0 without lag
    held: int  # F_mod does not follow δc within a substep: it is digital, or lags
    curve_nodes: int  # of the spring's curve; 0 without one
    curve: NDArray[np.float64]  # N over d


class SpringState(Protocol):
    """The state of the springs."""

    applied: float  # F_mod on the loader if it is held, N
    relaxed: float  # y, N
    neutral: float  # x₀, about which the springs act, d (`services`)


def _half_step_gain(given: Given) -> float:
    """Return the step response of F_mod's lag in half a substep, 0 without lag."""
    lag_s = given.control.loader.modifying_lag
    return first_order_gain(lag_s, 0.5 * given.substep_s) if lag_s > 0.0 else 0.0


DERIVED: dict[str, Callable[[Given], Any]] = {
    "ripple": lambda g: g.control.loader.ripple,
    "ripple_wave": lambda g: 2.0 * math.pi / g.control.loader.ripple_period,
    "ripple_phase": lambda g: g.control.loader.ripple_phase,
    "relaxing": lambda g: g.control.loader.relaxing_stiffness,
    "relaxing_time": lambda g: g.control.loader.relaxing_time,
    "digital": lambda g: g.control.loader.multiplier == "digital",
    "lag_gain": _half_step_gain,
    "held": lambda g: g.control.loader.multiplier == "digital" or _half_step_gain(g) > 0.0,
    "curve_nodes": lambda g: count_of(g.control.loader.force_curve),
    "curve": lambda g: table_of(g.control.loader.force_curve),
}


@stage
def ripple(p: SpringParameters, x: float) -> float:
    """Return the force that is periodic in δc = x, N."""
    return p.ripple * math.sin(p.ripple_wave * x + p.ripple_phase) if p.ripple != 0.0 else 0.0


@stage
def curved(p: SpringParameters, x: float) -> float:
    """Return the force of the spring's curve at δc = x, N."""
    return along(p.curve, p.curve_nodes, x) if p.curve_nodes > 0 else 0.0


@stage
def weight(p: SpringParameters, computed: float) -> float:
    """Return the force of gravity against δc, N; about the vertical, whatever the neutral."""
    return p.gravity * math.sin(computed + p.gravity_angle) if p.gravity != 0.0 else 0.0


@stage
def weight_slope(p: SpringParameters, computed: float) -> float:
    """Return the slope of `weight`, N/d."""
    return p.gravity * math.cos(computed + p.gravity_angle) if p.gravity != 0.0 else 0.0


@stage
def spring(p: SpringParameters, x: float) -> float:
    """Return the force of the electronics' own springs at δc = x, N: F_L of eq. (8)."""
    own = (p.basic_gradient + p.cubic * x * x) * x + ripple(p, x)
    return own + curved(p, x) if p.curve_nodes > 0 else own


@stage
def spring_slope(p: SpringParameters, x: float) -> float:
    """Return the slope of `spring`, N/d."""
    own = p.basic_gradient + 3.0 * p.cubic * x * x
    if p.ripple != 0.0:
        own += p.ripple * p.ripple_wave * math.cos(p.ripple_wave * x + p.ripple_phase)
    if p.curve_nodes > 0:
        own += slope_along(p.curve, p.curve_nodes, x)
    return own


@stage
def limited(p: SpringParameters, force: float) -> float:
    """Return a modifying force limited to the actuator's, N."""
    if p.force_limit > 0.0:
        return min(max(force, -p.force_limit), p.force_limit)
    return force


@stage
def elastic(p: SpringParameters, m: ModificationState, s: SpringState, x: float) -> float:
    """Return the smooth part of the force against δc, x from neutral, N: springs and F_mod."""
    force = spring(p, x) + weight(p, s.neutral + x)
    return force + (s.applied if p.held else limited(p, smooth_force(m, x)))


@stage
def stiffness(p: SpringParameters, m: ModificationState, s: SpringState, x: float) -> float:
    """Return the slope of `elastic`, N/d."""
    own = spring_slope(p, x) + weight_slope(p, s.neutral + x)
    if p.held or (p.force_limit > 0.0 and abs(smooth_force(m, x)) >= p.force_limit):
        return own
    return own + slope(m, x)


@stage
def apply_modification(
    p: SpringParameters, m: ModificationState, s: SpringState, computed: float
) -> None:
    """Apply a held F_mod to the loader: at once, or advanced by half a substep through its lag."""
    wanted = m.held if p.digital else modifying_force(m, computed)
    wanted = limited(p, wanted)
    if p.lag_gain > 0.0:
        wanted = s.applied + p.lag_gain * (wanted - s.applied)
    s.applied = wanted


@stage
def relaxed_after(p: SpringParameters, s: SpringState, span: float) -> float:
    """Return the relaxing spring's force after `span` seconds at rest, N."""
    return s.relaxed * math.exp(-span / p.relaxing_time)


@stage
def relaxing_mean(p: SpringParameters, s: SpringState, span: float) -> tuple[float, float]:
    """Return the mean of y over `span` seconds at rest, N, and its slope over speed, N·s/d."""
    kept = -math.expm1(-span / p.relaxing_time) * p.relaxing_time / span
    return kept * s.relaxed, (1.0 - kept) * p.relaxing * p.relaxing_time


@stage
def relax(p: SpringParameters, s: SpringState, way: float, span: float) -> None:
    """Advance the relaxing spring over `span` seconds of uniform motion by `way`, d."""
    if span <= 0.0:
        return
    steady = p.relaxing * p.relaxing_time * way / span
    s.relaxed = steady + (s.relaxed - steady) * math.exp(-span / p.relaxing_time)
