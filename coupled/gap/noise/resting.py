"""Where a signal rests: there it is constant, and its variation is noise.

A smoother passes noise at low frequencies. A stage with memory (presliding friction, backlash)
creeps under that noise, while the real hardware stands still as long as the hand rests. A stretch
that shows only noise about one level is therefore held at that level. Its windows have the scatter
of noise and halves with equal means, and the means of all its parts agree by χ².
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.thresholds import (
    BROAD,
    REST_CHANCE,
    REST_FADES,
    REST_FRAMES,
    REST_LEAST,
    REST_PART,
    REST_SPREAD,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Rest:
    """The rests of a signal: `share` is 1 at rest, `level` the value there; shapes (frames,).

    `ends` are the first frame of each rest and the one after its last, `errors` the standard errors
    of the levels, in the signal's unit.
    """

    share: Floats
    level: Floats
    ends: tuple[tuple[int, int], ...] = ()
    errors: tuple[float, ...] = ()

    def held(self, smooth: Floats) -> Floats:
        """Return a smoothed signal, constant at rest; same shape."""
        return self.share * self.level + (1.0 - self.share) * smooth

    def beside(self, error: Floats) -> Floats:
        """Return the error of a smoothed signal, zero at rest; same shape."""
        return (1.0 - self.share) * error

    def with_error(self, error: Floats, rng: np.random.Generator) -> Floats:
        """Return the error of a smoothed signal, at rest that of its level; same shape."""
        whole = self.beside(error)
        for (start, end), size in zip(self.ends, self.errors, strict=True):
            whole[start:end] += self.share[start:end] * rng.normal(0.0, size)
        return whole


def rest_of(signal: Floats, noise: Noise) -> Rest:
    """Return the rests of a signal; none if it has no noise or is short.

    None either if the noise is a large part of the signal, since that may be motion.
    """
    share, level = np.zeros(len(signal)), np.zeros(len(signal))
    ends, errors = list[tuple[int, int]](), list[float]()
    clear = 0.0 < noise.rms <= BROAD * float(np.std(signal))
    if clear and len(signal) > 2 * REST_FRAMES:
        for start, end in _stretches(_quiet(signal, noise)):
            mean = float(np.mean(signal[start:end]))
            if _is_level(signal[start:end], mean, noise):
                frames = np.arange(1, end - start + 1)
                near = np.minimum(frames, frames[::-1]) / REST_FADES
                share[start:end], level[start:end] = np.minimum(1.0, near), mean
                ends.append((start, end))
                errors.append(noise.rms * math.sqrt(_longer(noise) / (end - start)))
    return Rest(share, level, tuple(ends), tuple(errors))


def _quiet(signal: Floats, noise: Noise) -> NDArray[np.bool_]:
    """Return the frames in a window that shows only noise about one mean."""
    window, half = REST_FRAMES, REST_FRAMES // 2
    windows = np.lib.stride_tricks.sliding_window_view(signal, window)
    first, second = windows[:, :half].mean(axis=1), windows[:, half:].mean(axis=1)
    spread = REST_SPREAD * noise.rms
    apart = REST_CHANCE * noise.rms * math.sqrt(2.0 * _longer(noise) / half)
    still = (windows.std(axis=1) <= spread) & (np.abs(second - first) <= apart)
    begun = np.concatenate((still.astype(int), np.zeros(window, dtype=int)))
    begun[window:] -= still  # each still window covers so many frames
    return np.asarray(np.cumsum(begun[: len(signal)]) > 0)


def _stretches(quiet: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the bounds of the quiet stretches, shortened at both ends."""
    turns = np.flatnonzero(np.diff(quiet.astype(int), prepend=0, append=0)).tolist()
    pairs = zip(turns[::2], turns[1::2], strict=True)
    inner = [(start + REST_FADES // 2, end - REST_FADES // 2) for start, end in pairs]
    return [(start, end) for start, end in inner if end - start >= REST_LEAST]


def _is_level(stretch: Floats, mean: float, noise: Noise) -> bool:
    """Tell whether the means of a stretch's parts scatter as noise does (χ² test)."""
    parts = np.array_split(stretch, max(3, len(stretch) // REST_PART))
    off = np.array([np.mean(part) - mean for part in parts])
    frames = np.array([len(part) for part in parts])
    freedom = len(parts) - 1
    square = float(np.sum(off**2 * frames)) / (noise.rms**2 * _longer(noise))
    return square <= freedom + REST_CHANCE * math.sqrt(2.0 * freedom)


def _longer(noise: Noise) -> float:
    """Return the variance of a mean relative to that with white noise."""
    return (1.0 + noise.memory) / (1.0 - noise.memory)
