"""The noise of a channel, from the part of its spectrum above the signal.

Above 0.4 of the Nyquist frequency the motion of a rig is far below sensor noise. There the noise is
white, or that of a first-order lag, whose power falls as 1/(1 + a² − 2a·cos ω), a being the
correlation from frame to frame. This model extrapolates to lower frequencies. Of each band only the
lowest nine tenths of the spectrum count, so that a line (mains hum) is not taken for noise. A log
that was filtered or resampled has almost no power there, and its noise cannot be estimated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.filters import filtered
from coupled.gap.thresholds import (
    COLOUR_FITS,
    COLOURED_BY,
    COLOURS,
    FILTERED,
    FOLLOWS_ON,
    JUMPS,
    NOISE_BANDS,
    NOISE_FROM,
    QUIETER,
    WHITE_FRAMES,
)

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Noise:
    """Noise of a level, rms in the channel's unit; `memory` is its correlation by frames, 0 to 1.

    `filtered`: the spectrum falls up to the Nyquist frequency, so `rms` is an upper bound of what
    remains of the noise. `unsure` is the possible additional power at low frequencies, relative.
    """

    rms: float
    memory: float = 0.0
    filtered: bool = False
    unsure: float = 0.0

    def sample(self, frames: int, rng: np.random.Generator) -> Floats:
        """Return a sample, shape (frames,)."""
        white = rng.normal(0.0, self.rms, frames)
        if self.memory == 0.0 or not frames:
            return white
        gain = math.sqrt(1.0 - self.memory**2)
        white[1:] *= gain  # from its steady state
        return filtered([1.0], [1.0, -self.memory], white)


def noise_of(signal: Floats) -> Noise:
    """Return the noise of a smooth signal; if short, from the rms of fourth differences by √70."""
    rough = np.diff(signal, 4)
    plain = Noise(float(np.sqrt(np.mean(rough**2) / 70.0)) if len(rough) else 0.0)
    if len(rough) < WHITE_FRAMES or jumps(signal):  # jumps hide the colour
        return plain
    at, levels = _bands(rough)
    high = at >= NOISE_FROM * math.pi
    if not np.all(levels[high] > 0.0):
        return plain
    sure, variance = levels[high], _log_variance(rough)
    least = float(np.median(sure[-3:]))
    if least < FILTERED * float(np.median(sure[:3])):
        return Noise(math.sqrt(least), filtered=True)
    memory = _memory(at, levels, int(np.argmax(high)), variance)
    logs = np.log(sure / _shape(at[high], memory))
    white = float(np.exp(np.mean(logs) + 0.5 * variance))
    return Noise(math.sqrt(white / (1.0 - memory**2)), memory)


def jumps(signal: Floats) -> bool:
    """Tell whether a signal jumps: its fourth differences are concentrated in few frames."""
    rough = np.diff(signal, 4)
    if not len(rough):
        return False
    usual = float(np.median(np.abs(rough))) / 0.6745
    return usual < JUMPS * float(np.sqrt(np.mean(rough**2)))


def between_jumps(signal: Floats) -> Noise:
    """Return the noise of a signal that may jump, from the median of its fourth differences."""
    known, rough = noise_of(signal), np.abs(np.diff(signal, 4))
    usual = float(np.median(rough)) / 0.6745 / math.sqrt(70.0) if len(rough) else 0.0
    return known if known.rms <= usual / JUMPS else Noise(usual)


def _bands(rough: Floats) -> tuple[Floats, Floats]:
    """Return the middle frequencies of bands, rad a frame, and the noise's variance in each.

    `rough` are fourth differences, with the gain |2 sin(ω/2)|⁸ of power. The mean of each band is
    that of its lower part, corrected for the bias with an exponential distribution.
    """
    taper = np.hanning(len(rough))
    power = np.abs(np.fft.rfft(rough * taper)) ** 2 / float(taper @ taper)
    omega = np.linspace(0.0, math.pi, len(power))
    keep = (omega >= math.pi / NOISE_BANDS) & (omega < 0.99 * math.pi)
    power, omega = power[keep] / (2.0 * np.sin(0.5 * omega[keep])) ** 8, omega[keep]
    parts = np.array_split(np.arange(len(power)), NOISE_BANDS - 1)
    rest = 1.0 - QUIETER
    biased = (QUIETER + rest * math.log(rest)) / QUIETER
    levels = []
    for part in parts:
        quiet = np.sort(power[part])[: max(1, round(QUIETER * len(part)))]
        levels.append(float(np.mean(quiet)) / biased)
    return np.array([float(np.mean(omega[part])) for part in parts]), np.array(levels)


def _log_variance(rough: Floats) -> float:
    """Return the variance of the logarithm of a band's mean.

    With the taper about two of three bins are independent.
    """
    bins = len(rough) / 2.0 / NOISE_BANDS
    return 1.5 / bins


def _shape(at: Floats, memory: float) -> Floats:
    """Return the power of a first-order lag's noise over that of its white input."""
    return 1.0 / (1.0 + memory**2 - 2.0 * memory * np.cos(at))


def _memory(at: Floats, levels: Floats, first: int, variance: float) -> float:
    """Return the correlation of the noise by frames; 0 if white noise explains it as well.

    The bands from `first` on are noise. Lower bands are added as long as they agree with the
    extrapolation. A signal's spectrum is much steeper than a first-order lag, so it departs at
    once.
    """
    memory, logs = 0.0, np.log(np.maximum(levels, 1e-300))
    while True:
        memory = _fitted(at[first:], logs[first:], variance)
        if first == 0:
            return memory
        level = float(np.mean(logs[first:] - np.log(_shape(at[first:], memory))))
        expected = level + math.log(float(_shape(at[first - 1 : first], memory)[0]))
        if abs(logs[first - 1] - expected) > FOLLOWS_ON * math.sqrt(variance):
            return memory
        first -= 1


def _fitted(at: Floats, logs: Floats, variance: float) -> float:
    """Return the correlation that fits some bands; 0 if white noise fits about as well."""
    tries = np.array([logs - np.log(_shape(at, a)) for a in COLOURS])
    misfit = np.sum((tries - tries.mean(axis=1, keepdims=True)) ** 2, axis=1) / variance
    best = int(np.argmin(misfit))
    better = misfit[0] - misfit[best] > COLOURED_BY
    fits = misfit[best] < COLOUR_FITS * (len(at) - 2)
    return COLOURS[best] if better and fits else 0.0
