"""Taking the noise off a smooth input, without a choice to make.

A stage driven by a noisy input answers to noise that the rig never felt, and a fit then
mistakes the missing answer for more inertia, or a lag (errors in variables). The inputs are
smooth on the scale of a frame, so the Whittaker smoother with n-th differences, n up to 3,

    H(ω) = 1/(1 + λ·(2·sin(ω/2))²ⁿ),

takes the noise off; λ and n are chosen by generalised cross-validation (Craven and Wahba, 1979),
which leaves sharp inputs sharp. It takes neighbours' noise for independent, and would keep what
coloured noise has more of at low frequencies: so the spectra are first divided by the noise's, and
λ rises with it. A line (`lines`), as the mains' hum, is no noise: it is taken off before, and put
back.
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
_REMEMBERED = 64  # signals whose smoother is known: those of one record, noise and all


def rate_of(signal: Floats, frame_rate_Hz: float) -> Floats:
    """Return the rate of change of a smooth signal a second, same shape."""
    frames = np.arange(len(signal))
    return np.asarray(CubicSpline(frames, signal).derivative()(frames) * frame_rate_Hz)


@dataclass(frozen=True)
class Smoother:
    """A Whittaker smoother, its order and strength found by cross-validation on one signal."""

    gain: Floats  # H at each frequency of the lengthened signal
    reach: int  # frames by which a signal is lengthened at either end
    lines: tuple[Line, ...] = ()

    @classmethod
    def of(
        cls, signal: Floats, orders: Sequence[int] = (3, 2, 1), noise: Noise | None = None
    ) -> Smoother:
        """Return the one that suits a signal best, with differences of one of these orders.

        `noise` has the colour of what is taken off; without it that is heard from the signal.
        """
        whole = np.ascontiguousarray(signal, dtype=np.float64).tobytes()
        return _known(whole, tuple(orders), noise)

    def smooth(self, signal: Floats) -> Floats:
        """Return a signal of the same length without its noise; zero phase.

        It is the one whose smoother this is, or one with the same lines.
        """
        lines = sum(line.over(len(signal)) for line in self.lines)
        long = _lengthened(signal - lines, self.reach)
        drift = np.linspace(long[0], long[-1], len(long))
        out = drift + np.fft.irfft(np.fft.rfft(long - drift) * self.gain, len(long))
        return np.asarray(out[self.reach : self.reach + len(signal)]) + lines

    def wiener_error(self, level: Noise, frames: int, rng: np.random.Generator) -> Floats:
        """Return a sample of the smoothing error, PSD H·Sₙ: noise passed and signal lost.

        For a signal of which this smoother is the Wiener filter; `level` is its noise.
        """
        noise = level.sample(frames + 2 * self.reach, rng)
        out = np.fft.irfft(np.fft.rfft(noise) * np.sqrt(self.gain), len(noise))
        return np.asarray(out[self.reach : self.reach + frames])


@lru_cache(maxsize=_REMEMBERED)
def _known(signal: bytes, orders: tuple[int, ...], noise: Noise | None) -> Smoother:
    """Return the smoother of a signal; a diagnosis smooths each of them several times."""
    plain = np.frombuffer(signal)
    lines = tuple(lines_in(plain))
    reach = min(len(plain) - 1, 200)
    without = plain - sum(line.over(len(plain)) for line in lines)
    gain = _gain(_lengthened(without, reach), orders, _colour(without, noise))
    gain.flags.writeable = False
    return Smoother(gain, reach, lines)


def _colour(signal: Floats, noise: Noise | None) -> float:
    """Return how the noise to take off correlates from frame to frame, as given or as heard.

    None in a log that was filtered, nor where it is a large part of the signal: its colour may then
    be the signal's own.
    """
    if noise is None and not noise_of(signal).filtered:
        noise = noise_of_input(signal)
    clear = noise is not None and noise.rms <= BROAD * float(np.std(signal))
    return noise.memory if noise is not None and clear else 0.0


def _gain(long: Floats, orders: Sequence[int], memory: float) -> Floats:
    """Return the gain by which a lengthened signal is best foretold from its own neighbours.

    Its noise correlates from frame to frame by `memory`.
    """
    rate = 2.0 * np.sin(np.pi * np.fft.rfftfreq(len(long)))
    colour = (1.0 + memory) ** 2 / ((1.0 - memory) ** 2 + memory * rate**2)  # 1 at the end
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
    """Return the signal without its noise, of a colour as given or heard; same shape, no lag."""
    return Smoother.of(signal, noise=noise).smooth(signal)


def _lengthened(signal: Floats, reach: int) -> Floats:
    """Return the signal reflected about its ends, where the transform then sees no jump or kink."""
    before = 2.0 * signal[0] - signal[reach:0:-1]
    after = 2.0 * signal[-1] - signal[-2 : -reach - 2 : -1]
    return np.concatenate((before, signal, after))
