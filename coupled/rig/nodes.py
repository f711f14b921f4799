"""Signals between the frames: the cubic spline through the samples, on the loader's own steps."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


def on_nodes(rig: Rig, samples: Floats) -> Floats:
    """Return a signal on the loader's nodes: `rig.substeps` a frame, and the last.

    Not to be written to: who asks for the same again has the same array.
    """
    return _on_nodes(np.ascontiguousarray(samples, dtype=np.float64).tobytes(), rig.substeps)


class Nodes:
    """A signal on the nodes of any rig of its frame rate, however finely its loader is stepped."""

    def __init__(self, samples: Floats) -> None:
        self._samples = samples
        self._known: dict[int, Floats] = {}

    def of(self, rig: Rig) -> Floats:
        """Return the signal on a rig's nodes, as `on_nodes`."""
        found = self._known.get(rig.substeps)
        if found is None:
            found = self._known[rig.substeps] = on_nodes(rig, self._samples)
        return found


@lru_cache(maxsize=8)
def _on_nodes(samples: bytes, substeps: int) -> Floats:
    values = np.frombuffer(samples)
    cubic, square, slope, start = CubicSpline(np.arange(len(values)), values).c[:, :, None]
    share = np.arange(substeps) / substeps
    inner = ((cubic * share + square) * share + slope) * share + start
    return np.append(inner, values[-1])
