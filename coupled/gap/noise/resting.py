"""Where a signal rests: there it is its mean, and what trembles about that is noise.

A smoother passes the noise that a channel has at low frequencies. A stage that remembers what drove
it is walked by that: dry friction whose contact yields, a grip within its play. The real one stands
still under a hand that rests, or that has let go. So a stretch that shows no more than noise about
one level is held at that level. Its windows scatter as noise does, their halves have one mean, and
so have all its parts, by χ².
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
    """Where a signal rests, 1 in `share`, and at which level, in its unit; shapes (frames,).

    `ends` are the first frame of each rest and the one after its last, `errors` the standard errors
    of their levels, in its unit.
    """

    share: Floats
    level: Floats
    ends: tuple[tuple[int, int], ...] = ()
    errors: tuple[float, ...] = ()

    def held(self, smooth: Floats) -> Floats:
        """Return a smoothed signal, held where it rests; same shape."""
        return self.share * self.level + (1.0 - self.share) * smooth

    def beside(self, error: Floats) -> Floats:
        """Return the error of a smoothed signal without that where it rests; same shape."""
        return (1.0 - self.share) * error

    def with_error(self, error: Floats, rng: np.random.Generator) -> Floats:
        """Return the error of a smoothed signal, and of its level where it rests; same shape."""
        whole = self.beside(error)
        for (start, end), size in zip(self.ends, self.errors, strict=True):
            whole[start:end] += self.share[start:end] * rng.normal(0.0, size)
        return whole


def rest_of(signal: Floats, noise: Noise) -> Rest:
    """Return where a signal with noise rests; nowhere, where it has none or is short.

    Nor where the noise is a large part of it: that may be the signal itself, which then moves.
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
    """Return the frames that lie in a window which shows no more than noise about one mean."""
    window, half = REST_FRAMES, REST_FRAMES // 2
    windows = np.lib.stride_tricks.sliding_window_view(signal, window)
    first, second = windows[:, :half].mean(axis=1), windows[:, half:].mean(axis=1)
    spread = REST_SPREAD * noise.rms
    apart = REST_CHANCE * noise.rms * math.sqrt(2.0 * _longer(noise) / half)
    still = (windows.std(axis=1) <= spread) & (np.abs(second - first) <= apart)
    begun = np.concatenate((still.astype(int), np.zeros(window, dtype=int)))
    begun[window:] -= still  # each still window is open for so many frames
    return np.asarray(np.cumsum(begun[: len(signal)]) > 0)


def _stretches(quiet: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first frame of each quiet stretch and the one after its last, without its ends."""
    turns = np.flatnonzero(np.diff(quiet.astype(int), prepend=0, append=0)).tolist()
    pairs = zip(turns[::2], turns[1::2], strict=True)
    inner = [(start + REST_FADES // 2, end - REST_FADES // 2) for start, end in pairs]
    return [(start, end) for start, end in inner if end - start >= REST_LEAST]


def _is_level(stretch: Floats, mean: float, noise: Noise) -> bool:
    """Tell whether the parts of a stretch scatter about its mean as noise does."""
    parts = np.array_split(stretch, max(3, len(stretch) // REST_PART))
    off = np.array([np.mean(part) - mean for part in parts])
    frames = np.array([len(part) for part in parts])
    freedom = len(parts) - 1
    square = float(np.sum(off**2 * frames)) / (noise.rms**2 * _longer(noise))
    return square <= freedom + REST_CHANCE * math.sqrt(2.0 * freedom)


def _longer(noise: Noise) -> float:
    """Return by how much the variance of a mean is that of white noise."""
    return (1.0 + noise.memory) / (1.0 - noise.memory)
