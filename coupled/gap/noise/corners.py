"""Corners of a signal: of a scripted input, or of a motion at a stop.

A smoother rounds a corner or rings beside it, by several times the noise, and dry friction keeps
the error of the peak. Corners are therefore found, taken out before a signal is smoothed, and added
again (`smooth`).

A corner is a change of slope, far above those elsewhere in the signal, that is as large over few
frames as over many. That of a bend grows with the frames.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.ndimage import maximum_filter1d

from coupled.gap.noise.noise import Floats
from coupled.gap.thresholds import CORNER_FRAMES, FAR_SIGMAS, PARTLY, SIGMAS

_BESIDE = (-1, 0, 1)  # a corner between two frames is one in each


def corners_in(signal: Floats) -> Floats:
    """Return the polygon of a signal's corners, zero before the first; same shape.

    Corners that a few frames show are taken out first, since others may lie beside them. At the end
    each is fitted again, up to the next corner.
    """
    corners = dict[int, Floats]()
    for most in CORNER_FRAMES[1:]:
        if len(signal) < 4 * most:
            break
        rest = signal - _polygon(corners, len(signal))
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
            if all(abs(at - other) >= CORNER_FRAMES[1] for other in corners):
                corners[at] = _corner(rest[at - most : at + most + 1])
    rest = signal - _polygon(corners, len(signal))
    ends = [0, *sorted(corners), len(signal) - 1]
    for before, at, after in zip(ends, ends[1:], ends[2:], strict=False):
        reach = min(at - before, after - at, CORNER_FRAMES[-1])
        own = _hinges(reach) @ corners[at]
        corners[at] = _corner(rest[at - reach : at + reach + 1] + own)
    return _polygon(corners, len(signal))


def _polygon(corners: Mapping[int, Floats], frames: int) -> Floats:
    """Return the sum of corners, given by their changes of slope about their frames."""
    turns = np.zeros(frames)
    for at, sizes in corners.items():
        turns[at - 1 : at + 2] += sizes
    return np.concatenate(([0.0], np.cumsum(np.cumsum(turns))[:-1]))


def _hinges(reach: int) -> Floats:
    """Return unit changes of slope in the frames `_BESIDE` a window's middle, shape (frames, 3)."""
    return np.maximum(np.arange(-reach, reach + 1.0)[:, None] - _BESIDE, 0.0)


def _turns(signal: Floats, reach: int) -> Floats:
    """Return the change of slope at each frame over so many frames to either side, same shape.

    By least squares with a straight line; zero at the ends.
    """
    shape = np.abs(np.arange(-reach, reach + 1.0))
    shape -= shape.mean()
    found = np.zeros(len(signal))
    found[reach:-reach] = np.correlate(signal, 2.0 * shape / (shape @ shape), mode="valid")
    return found


def _corner(window: Floats) -> Floats:
    """Return the changes of slope of the corner in the middle of a window, shape (3,)."""
    reach = len(window) // 2
    hinges, best = _hinges(reach), (np.inf, np.zeros(3))
    line = np.column_stack([np.ones(len(window)), np.arange(-reach, reach + 1.0)])
    for columns in ([1], [0, 1], [1, 2]):
        given = np.hstack([line, hinges[:, columns]])
        found = np.linalg.lstsq(given, window, rcond=None)[0]
        left = float(np.sum((window - given @ found) ** 2))
        if found[2] * found[-1] > 0.0 and left < best[0]:
            sizes = np.zeros(3)
            sizes[columns] = found[2:]
            best = left, sizes
    return best[1]
