"""Curves in the kernels: piecewise linear functions, continued at their last segments' slopes.

A curve is a table of three rows, nodes, values and the slope of the segment from each node on. An
odd one is stored to both sides. That of a map is the difference of value and signal, so that the
identity adds exactly 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import seldom, stage
from coupled.rig.curves import MOST_NODES, Curve, FrictionCurve

Floats = NDArray[np.float64]
SLOTS = 2 * MOST_NODES - 1  # of an odd curve, to both sides
SHAPE = (3, SLOTS)
_ABSENT = np.zeros(SHAPE)


def count_of(curve: Curve) -> int:
    """Return how many nodes a curve has in the kernels, 0 for an absent one."""
    count = len(curve.nodes)
    return 2 * count - 1 if curve.odd else count


def table_of(curve: Curve) -> Floats:
    """Return a curve's table for the kernels."""
    if not curve.nodes:
        return _ABSENT
    nodes, values = np.array(curve.nodes), np.array(curve.values)
    values = values - nodes if curve.MAP else values
    return _table(*_to_both_sides(nodes, values, values)) if curve.odd else _table(nodes, values)


def damping_table(curve: FrictionCurve) -> Floats:
    """Return the table over the signed rate of a friction curve, without its dry friction."""
    if not curve.nodes:
        return _ABSENT
    nodes, ahead = np.array(curve.nodes), np.array(curve.values)
    back = np.array(curve.forward)
    return _table(*_to_both_sides(nodes, ahead - ahead[0], back - back[0]))


def _to_both_sides(nodes: Floats, ahead: Floats, back: Floats) -> tuple[Floats, Floats]:
    """Return nodes and values from the largest negative signal on, of a curve that begins at 0."""
    return np.append(-nodes[:0:-1], nodes), np.append(-back[:0:-1], ahead)


def _table(nodes: Sequence[float] | Floats, values: Sequence[float] | Floats) -> Floats:
    table, count = np.zeros(SHAPE), len(nodes)
    table[0, :count], table[1, :count] = nodes, values
    table[2, : count - 1] = np.diff(values) / np.diff(nodes)
    return table


@stage
def segment(table: Floats, count: int, x: float) -> int:
    """Return the number of the segment of a table with `count` nodes at a signal."""
    low, high = 0, count - 1
    while high - low > 1:
        middle = (low + high) // 2
        if x < table[0, middle]:
            high = middle
        else:
            low = middle
    return low


@seldom
def along(table: Floats, count: int, x: float) -> float:
    """Return a curve's value at a signal."""
    i = segment(table, count, x)
    return float(table[1, i] + table[2, i] * (x - table[0, i]))


@seldom
def slope_along(table: Floats, count: int, x: float) -> float:
    """Return a curve's slope at a signal."""
    return float(table[2, segment(table, count, x)])


@seldom
def solve_along(
    table: Floats, count: int, gain: float, factor: float, wanted: float, begin: float
) -> tuple[float, float]:
    """Return the signal x ≥ `begin` at which gain·x + factor·f(x) has a value, and the slope there.

    It rises from `begin` on, where it is at most the value. Where its last segment is level and
    does not reach the value, x is infinite.
    """
    i = segment(table, count, begin)
    while i + 2 < count and gain * table[0, i + 1] + factor * table[1, i + 1] <= wanted:
        i += 1
    rise = gain + factor * table[2, i]
    if rise <= 0.0:
        return math.inf, 0.0
    return float((wanted - factor * (table[1, i] - table[2, i] * table[0, i])) / rise), rise
