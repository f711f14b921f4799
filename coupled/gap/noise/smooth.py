"""Smoothing of inputs, with parameters from cross-validation.

A stage driven by a noisy input responds to noise that the rig never had, and a fit then mistakes
the missing response for more inertia or a lag (errors in variables). The inputs are smooth on the
scale of a frame, so the Whittaker smoother with n-th differences, n up to 3,

    H(ω) = 1/(1 + λ·(2·sin(ω/2))²ⁿ),

removes the noise. λ and n are from generalised cross-validation (Craven and Wahba, 1979), which
preserves sharp inputs. It assumes white noise, so the spectra are first divided by that of the
noise's colour, and λ is scaled likewise. A line (`lines`), such as mains hum, is not noise: it is
subtracted before and added again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from coupled.gap.noise.lines import Line, lines_in
from coupled.gap.noise.noise import Noise, noise_of
from coupled.gap.noise.quiet import noise_of_input
from coupled.gap.thresholds import BROAD

Floats = NDArray[np.float64]
_REMEMBERED = 64  # size of the cache of smoothers: the signals of one record, noise included


def rate_of(signal: Floats, frame_rate_Hz: float) -> Floats:
    """Return the rate of change of a smooth signal a second, same shape."""
    frames = np.arange(len(signal))
    return np.asarray(CubicSpline(frames, signal).derivative()(frames) * frame_rate_Hz)


@dataclass(frozen=True)
class Smoother:
    """A Whittaker smoother, with order and strength from cross-validation on one signal."""

    gain: Floats  # H at each frequency of the extended signal
    reach: int  # frames by which a signal is extended at either end
    lines: tuple[Line, ...] = ()

    @classmethod
    def of(
        cls, signal: Floats, orders: Sequence[int] = (3, 2, 1), noise: Noise | None = None
    ) -> Smoother:
        """Return the best smoother of a signal, with differences of one of these orders.

        `noise` gives the colour of the noise; by default it is estimated from the signal.
        """
        whole = np.ascontiguousarray(signal, dtype=np.float64).tobytes()
        return _known(whole, tuple(orders), noise)

    def smooth(self, signal: Floats) -> Floats:
        """Return a signal without its noise, same length, zero phase.

        The signal is that of the smoother, or one with the same lines.
        """
        lines = sum(line.over(len(signal)) for line in self.lines)
        long = _lengthened(signal - lines, self.reach)
        drift = np.linspace(long[0], long[-1], len(long))
        out = drift + np.fft.irfft(np.fft.rfft(long - drift) * self.gain, len(long))
        return np.asarray(out[self.reach : self.reach + len(signal)]) + lines

    def wiener_error(self, level: Noise, frames: int, rng: np.random.Generator) -> Floats:
        """Return a sample of the smoothing error, PSD H·Sₙ: noise passed and signal lost.

        It holds for a signal whose Wiener filter is this smoother; `level` is its noise.
        """
        noise = level.sample(frames + 2 * self.reach, rng)
        out = np.fft.irfft(np.fft.rfft(noise) * np.sqrt(self.gain), len(noise))
        return np.asarray(out[self.reach : self.reach + frames])


@lru_cache(maxsize=_REMEMBERED)
def _known(signal: bytes, orders: tuple[int, ...], noise: Noise | None) -> Smoother:
    """Return the smoother of a signal, cached."""
    plain = np.frombuffer(signal)
    lines = tuple(lines_in(plain))
    reach = min(len(plain) - 1, 200)
    without = plain - sum(line.over(len(plain)) for line in lines)
    gain = _gain(_lengthened(without, reach), orders, _colour(without, noise))
    gain.flags.writeable = False
    return Smoother(gain, reach, lines)


def _colour(signal: Floats, noise: Noise | None) -> float:
    """Return the noise's correlation from frame to frame, as given or as estimated.

    Zero for a filtered log, and for noise that is a large part of the signal, since its colour may
    then be the signal's.
    """
    if noise is None and not noise_of(signal).filtered:
        noise = noise_of_input(signal)
    clear = noise is not None and noise.rms <= BROAD * float(np.std(signal))
    return noise.memory if noise is not None and clear else 0.0


def _gain(long: Floats, orders: Sequence[int], memory: float) -> Floats:
    """Return the gain with the least generalised cross-validation score for an extended signal.

    The noise correlates from frame to frame by `memory`.
    """
    rate = 2.0 * np.sin(np.pi * np.fft.rfftfreq(len(long)))
    colour = (1.0 + memory) ** 2 / ((1.0 - memory) ** 2 + memory * rate**2)  # 1 at Nyquist
    power = np.abs(np.fft.rfft(long - np.linspace(long[0], long[-1], len(long)))) ** 2 / colour
    best, found, stopped = np.inf, (orders[0], 0.0), np.empty_like(power)
    for order in orders:
        steep = rate ** (2 * order) * colour
        for strength in np.logspace(-3, 12, 61).tolist():
            np.multiply(steep, strength, out=stopped)
            stopped /= 1.0 + stopped  # 1 − H
            share = float(stopped.sum())
            score = float(np.square(stopped, out=stopped) @ power) / share**2
            if score < best:
                best, found = score, (order, strength)
    order, strength = found
    return np.asarray(1.0 / (1.0 + strength * rate ** (2 * order) * colour))


def smoothed(signal: Floats, noise: Noise | None = None) -> Floats:
    """Return the signal without noise of a given or estimated colour; same shape, no lag."""
    return Smoother.of(signal, noise=noise).smooth(signal)


def _lengthened(signal: Floats, reach: int) -> Floats:
    """Return the signal extended by point reflection at its ends, without jump or kink."""
    before = 2.0 * signal[0] - signal[reach:0:-1]
    after = 2.0 * signal[-1] - signal[-2 : -reach - 2 : -1]
    return np.concatenate((before, signal, after))
