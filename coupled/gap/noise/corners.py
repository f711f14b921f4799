"""The corners of a force that a script or a test stand gives.

A smoother rounds a corner or rings beside it, by several times the noise, and dry friction keeps
the error of the peak. Corners are therefore found, taken out before a signal is smoothed, and added
again (`smooth`).

A corner is a change of slope, far above those elsewhere in the signal, that is as large over few
frames as over many; that of a bend grows with the frames. Two straight lines that meet at it leave
noise alone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter1d

from coupled.gap.noise.noise import Floats
from coupled.gap.thresholds import CORNER_FRAMES, FAR_SIGMAS, PARTLY, ROUNDING_SPAN, SIGMAS


@dataclass(frozen=True)
class Corners:
    """Changes of slope, each by a size in the signal's unit a frame at a time in frames."""

    each: tuple[tuple[float, float], ...] = ()

    def over(self, frames: Floats) -> Floats:
        """Return the polygon of the corners, zero before the first, at times in frames."""
        found = np.zeros(len(frames))
        for time, size in self.each:
            found += size * np.maximum(frames - time, 0.0)
        return found


def corners_in(signal: Floats) -> Corners:
    """Return the corners of a signal, in their order.

    Corners that a few frames show are taken out first, since others may lie beside them. At the end
    each is fitted again over more frames, up to the next corner, which excludes bends.
    """
    frames, corners = np.arange(len(signal), dtype=np.float64), dict[int, tuple[float, float]]()
    noise = float(np.median(np.abs(np.diff(signal, 2)))) / 0.6745 / math.sqrt(6.0)
    noise = max(noise, ROUNDING_SPAN * float(np.ptp(signal)))
    for most in CORNER_FRAMES[1:]:
        if len(signal) < 4 * most:
            break
        rest = signal - Corners(tuple(corners.values())).over(frames)
        seen = [reach for reach in CORNER_FRAMES if reach <= most]
        turns = {reach: _turns(rest, reach) for reach in seen}
        usual = {n: float(np.median(np.abs(turn))) / 0.6745 for n, turn in turns.items()}
        size = np.abs(turns[most])
        sharp = (size > FAR_SIGMAS * usual[most]) & (size == maximum_filter1d(size, 2 * most + 1))
        for reach in seen[:-1]:
            doubt = 0.0 if reach == seen[-2] else SIGMAS * usual[reach]
            least = (1.0 - PARTLY) * size - doubt
            sharp &= turns[reach] * np.sign(turns[most]) >= least
        for at in (np.flatnonzero(sharp[most:-most]) + most).tolist():
            apart = all(abs(at - other) >= most for other in corners)
            found = _corner(rest, at, most, noise) if apart else None
            if found is not None:
                corners[at] = found
    rest, kept = signal - Corners(tuple(corners.values())).over(frames), list[tuple[float, float]]()
    ends = [0, *sorted(corners), len(signal) - 1]
    for before, at, after in zip(ends, ends[1:], ends[2:], strict=False):
        reach = min(at - before, after - at, CORNER_FRAMES[-1])
        own = rest + Corners((corners[at],)).over(frames)
        found = _corner(own, at, reach, noise) if reach >= CORNER_FRAMES[2] else None
        kept += [] if found is None else [found]
    return Corners(tuple(kept))


def _turns(signal: Floats, reach: int) -> Floats:
    """Return the change of slope at each frame over so many frames to either side, same shape.

    By least squares with a straight line; zero at the ends.
    """
    shape = np.abs(np.arange(-reach, reach + 1.0))
    shape -= shape.mean()
    found = np.zeros(len(signal))
    found[reach:-reach] = np.correlate(signal, 2.0 * shape / (shape @ shape), mode="valid")
    return found


def _corner(signal: Floats, at: int, reach: int, noise: float) -> tuple[float, float] | None:
    """Return time and size of the corner within a frame of the given one; None if it is none."""
    near, best = np.arange(-reach, reach + 1.0), (np.inf, (0.0, 0.0))
    window = signal[at - reach : at + reach + 1]
    line = np.column_stack([np.ones(len(near)), near])
    for places in ([0], [-1, 0], [0, 1]):
        given = np.hstack([line, np.maximum(near[:, None] - places, 0.0)])
        found = np.linalg.lstsq(given, window, rcond=None)[0]
        left, sizes = float(np.sum((window - given @ found) ** 2)), found[2:]
        if sizes[0] * sizes[-1] > 0.0 and left < best[0]:
            size = float(np.sum(sizes))
            best = left, (at + float(np.dot(places, sizes)) / size, size)
    freedom = len(near) - 4
    most = noise**2 * (freedom + FAR_SIGMAS * math.sqrt(2.0 * freedom))  # of χ²
    return best[1] if best[0] <= most else None
