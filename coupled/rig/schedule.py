"""Schedule: from dynamic pressure to the specified gradient, or to the specified curve.

G_T(q̄) is interpolated linearly in the rig's table and constant beyond its ends. A second table
gives the gradient beyond a break in deflection (appendix C of the report). A curve is a table of
forces over q̄ and deflection; the force at each of its deflections is interpolated in the same way.
Faults: the schedule's pressure lags or is wrong by a factor, or the table's rise above its value at
q̄ = 0 is, or a curve over q̄ adds to the gradient of every segment (`curves`).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration, Given, first_order_gain
from coupled.rig.parameters import MAX_NODES, MAX_ROWS
from coupled.rig.piecewise import SHAPE, along, count_of, table_of

Table = NDArray[np.float64]


class ScheduleParameters(Protocol):
    """The table, and the faults of its use."""

    rows: int
    dynamic_pressure: Table  # Pa, rising
    total_gradient: Table  # G_T, N/d
    second_gradient: Table  # slope beyond the break, N/d; equal to the first if there is none
    nodes: int  # deflections of the curve; 0 without one
    deflection: Table  # of the curve, d, rising; from zero if it is odd
    force: Table  # of the curve, N, a row for each deflection over the pressures
    pressure_scale: float  # q̄ in the schedule over the real one
    pressure_lag_gain: float  # 1 − exp(−T/τ) over a frame; 1 without lag
    slope: float  # factor on the rise above the value at q̄ = 0
    added_nodes: int  # of the curve that adds to G_T; 0 without one
    added: Table  # N/d over Pa


class ScheduleState(Protocol):
    """The lagged pressure."""

    started: int
    pressure: float  # Pa


def _rows(values: list[float], length: int = MAX_ROWS) -> Table:
    """Return a table's column at its full length, with zeros after its last row."""
    column = np.zeros(length)
    column[: len(values)] = values
    return column


def _forces(given: Given) -> Table:
    """Return a curve's forces, N, a row for each deflection."""
    force = given.control.schedule.force
    if force is None:
        return _NO_FORCES
    table = np.zeros((MAX_NODES, MAX_ROWS))
    table[: len(force[0]), : len(force)] = np.transpose(force)
    return table


_NO_FORCES = np.zeros((MAX_NODES, MAX_ROWS))
_SHAPES: dict[str, tuple[int, ...]] = {
    **dict.fromkeys(("dynamic_pressure", "total_gradient", "second_gradient"), (MAX_ROWS,)),
    **{"deflection": (MAX_NODES,), "force": (MAX_NODES, MAX_ROWS), "added": SHAPE},
}
SCHEDULE = Declaration(
    layout(ScheduleParameters, **_SHAPES),
    section="control.schedule",
    derived={
        "rows": lambda g: len(g.control.schedule.dynamic_pressure),
        "dynamic_pressure": lambda g: _rows(g.control.schedule.dynamic_pressure),
        "total_gradient": lambda g: _rows(g.control.schedule.total_gradient),
        "second_gradient": lambda g: _rows(
            g.control.schedule.second_gradient or g.control.schedule.total_gradient
        ),
        "nodes": lambda g: len(g.control.schedule.deflection or ()),
        "deflection": lambda g: _rows(g.control.schedule.deflection or [], MAX_NODES),
        "force": _forces,
        "added_nodes": lambda g: count_of(g.control.schedule.gradient_curve),
        "added": lambda g: table_of(g.control.schedule.gradient_curve),
        "pressure_lag_gain": lambda g: first_order_gain(g.control.schedule.pressure_lag, g.frame_s),
    },
    state=layout(ScheduleState),
    fixed=("pressure",),
)


@stage
def read_pressure(p: ScheduleParameters, s: ScheduleState, dynamic_pressure: float) -> float:
    """Return the schedule's pressure at this frame, Pa."""
    scaled = p.pressure_scale * dynamic_pressure
    if s.started == 0:
        s.started = 1
        s.pressure = scaled
    s.pressure += p.pressure_lag_gain * (scaled - s.pressure)
    return s.pressure


@stage
def gradients(p: ScheduleParameters, pressure: float) -> tuple[float, float]:
    """Return G_T below and beyond the break, N/d, at the schedule's pressure in Pa."""
    first = _interpolate(p, p.total_gradient, pressure)
    second = _interpolate(p, p.second_gradient, pressure)
    if p.added_nodes > 0:
        added = along(p.added, p.added_nodes, pressure)
        return first + added, second + added
    return first, second


@stage
def force_at(p: ScheduleParameters, node: int, pressure: float) -> float:
    """Return the curve's force at one of its deflections, N, at the schedule's pressure in Pa."""
    force = _interpolate(p, p.force[node], pressure)
    if p.added_nodes > 0:
        force += along(p.added, p.added_nodes, pressure) * p.deflection[node]
    return force


@stage
def _interpolate(p: ScheduleParameters, table: Table, pressure: float) -> float:
    at_rest = _look_up(p, table, 0.0)
    return at_rest + p.slope * (_look_up(p, table, pressure) - at_rest)


@stage
def _look_up(p: ScheduleParameters, table: Table, pressure: float) -> float:
    q = p.dynamic_pressure
    if pressure <= q[0]:
        return float(table[0])
    for row in range(1, p.rows):
        if pressure < q[row]:
            share = (pressure - q[row - 1]) / (q[row] - q[row - 1])
            return float(table[row - 1] + share * (table[row] - table[row - 1]))
    return float(table[p.rows - 1])
