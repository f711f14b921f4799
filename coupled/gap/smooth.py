"""Taking the white noise off a smooth input, without a choice to make.

A stage driven by a noisy input answers to noise that the rig never felt, and a fit then
mistakes the missing answer for more inertia, or a lag (errors in variables). The inputs are
smooth on the scale of a frame, so the Whittaker smoother with third differences,

    H(ω) = 1/(1 + λ·(2·sin(ω/2))⁶),

takes the noise off; λ is chosen by generalised cross-validation (Craven and Wahba, 1979), which
leaves sharp inputs sharp.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

Floats = NDArray[np.float64]


def rate_of(signal: Floats, frame_rate_Hz: float) -> Floats:
    """Return the rate of change of a smooth signal a second, same shape."""
    frames = np.arange(len(signal))
    return np.asarray(CubicSpline(frames, signal).derivative()(frames) * frame_rate_Hz)


def smoothed(signal: Floats) -> Floats:
    """Return the signal without its white noise, same shape; zero phase."""
    # Reflected about its ends, so that the transform sees neither jump nor kink there.
    reach = min(len(signal) - 1, 200)
    before = 2.0 * signal[0] - signal[reach:0:-1]
    after = 2.0 * signal[-1] - signal[-2 : -reach - 2 : -1]
    long = np.concatenate((before, signal, after))
    drift = np.linspace(long[0], long[-1], len(long))
    spectrum = np.fft.rfft(long - drift)
    sharpness = (2.0 * np.sin(np.pi * np.fft.rfftfreq(len(long)))) ** 6
    power = np.abs(spectrum) ** 2
    best, gain = np.inf, np.ones_like(power)
    for strength in np.logspace(-3, 12, 61):
        passed = 1.0 / (1.0 + strength * sharpness)
        score = np.mean((1.0 - passed) ** 2 * power) / np.mean(1.0 - passed) ** 2
        if score < best:
            best, gain = score, passed
    out = drift + np.fft.irfft(spectrum * gain, len(long))
    return np.asarray(out[reach : reach + len(signal)])
