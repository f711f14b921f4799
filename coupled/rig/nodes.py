"""Signals between the frames: the cubic spline through the samples, at the loader's steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from coupled.rig.compiled import long_entry
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


def on_nodes(rig: Rig, samples: Floats) -> Floats:
    """Return a signal on the loader's nodes: `rig.substeps` for each frame, and the last.

    The array is cached and must not be written to.
    """
    return _on_nodes(np.ascontiguousarray(samples, dtype=np.float64).tobytes(), rig.substeps)


def coarsely(rig: Rig, samples: Floats) -> Floats:
    """Return a signal on the loader's nodes, by the spline through every other sample.

    The change of a replay with it bounds the interpolation error: Richardson's rule for order 1,
    that of a force that jumps between two frames.
    """
    last = len(samples) - 1
    kept = np.unique(np.append(np.arange(0, last, 2), last))
    nodes = np.arange(last * rig.substeps + 1) / rig.substeps
    return np.asarray(CubicSpline(kept, samples[kept])(nodes))


class Nodes:
    """A signal on the nodes of any rig of its frame rate, for any loader rate.

    `interpolate` is the spline (`on_nodes`), or `coarsely`.
    """

    def __init__(
        self, samples: Floats, interpolate: Callable[[Rig, Floats], Floats] = on_nodes
    ) -> None:
        self._samples, self._interpolate = samples, interpolate
        self._known: dict[int, Floats] = {}

    def of(self, rig: Rig) -> Floats:
        """Return the signal on a rig's nodes, as `on_nodes`."""
        found = self._known.get(rig.substeps)
        if found is None:
            found = self._known[rig.substeps] = self._interpolate(rig, self._samples)
        return found


@lru_cache(maxsize=8)
def _on_nodes(samples: bytes, substeps: int) -> Floats:
    values = np.frombuffer(samples)
    out = np.empty((len(values) - 1) * substeps + 1)
    _splined(values, np.empty((2, len(values))), substeps, out)
    return out


@long_entry
def _splined(y: Floats, work: Floats, substeps: int, out: Floats) -> None:
    """Write a cubic spline's values, so many for each sample, and the last; four samples or more.

    Not-a-knot conditions at both ends. The slopes at the samples solve a tridiagonal system (de
    Boor, A Practical Guide to Splines, 1978, ch. IV), by elimination in order.
    """
    last = len(y) - 1
    slope, above = work[0], work[1]
    slope[0], above[0] = 0.5 * (5.0 * (y[1] - y[0]) + (y[2] - y[1])), 2.0
    for i in range(1, last):
        above[i] = 1.0 / (4.0 - above[i - 1])
        slope[i] = (3.0 * (y[i + 1] - y[i - 1]) - slope[i - 1]) * above[i]
    end = 0.5 * (5.0 * (y[last] - y[last - 1]) + (y[last - 1] - y[last - 2]))
    slope[last] = (end - 2.0 * slope[last - 1]) / (1.0 - 2.0 * above[last - 1])
    out[last * substeps] = y[last]
    step = 1.0 / substeps
    for i in range(last - 1, -1, -1):
        slope[i] -= above[i] * slope[i + 1]
        rise = y[i + 1] - y[i]
        cubic = slope[i] + slope[i + 1] - 2.0 * rise
        square = rise - slope[i] - cubic
        for node in range(substeps):
            share = node * step
            out[i * substeps + node] = ((cubic * share + square) * share + slope[i]) * share + y[i]
