"""The noise of a residual, from its quieter pieces of half a second.

The spectrum of a control that sticks, slips or closes its backlash falls as slowly as that of
coloured noise, and hides the noise. A stage's residual contains that only as far as the stage has a
gap. The spectrum is taken in short pieces, and at each frequency the 30 % quantile of the pieces
counts, so that rare events are left out; lines of the mains are rejected as outliers. The noise is
white, or that of a first-order lag, as in `noise`.

The noise of a force cannot be taken from a residual, since the force is an input. There the
signal's own spectrum, which falls with some power of frequency, is fitted together with the noise.
Among the models that fit about as well, the noise with the least power at low frequencies is
taken. `unsure` is how much more the best fit has there.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.thresholds import (
    BESIDE_BY,
    BESIDE_FROM,
    COLOURED_BY,
    COLOURS,
    NOISE_FROM,
    OUTLYING,
    PIECE,
    QUIET_FOLLOWS_ON,
    QUIET_FROM,
    QUIET_SHARE,
    STEEPNESSES,
    WHITE_FRAMES,
)

Floats = NDArray[np.float64]
_SHAPES = np.array(COLOURS)[:, None]
# Power of a signal at half the Nyquist frequency, over that of the noise at its end.
SIGNALS = np.concatenate(([0.0], np.exp(np.arange(-4.0, 8.0, 0.25))))


def quiet_noise(residual: Floats) -> Noise | None:
    """Return the noise of a residual, shape (frames,); None if it is short or has no noise."""
    if len(residual) < WHITE_FRAMES:
        return None
    omega, logs, variance = _levels(residual, 1)
    omega, logs = omega[QUIET_FROM - 1 :], logs[QUIET_FROM - 1 :]
    if not np.all(np.isfinite(logs)):
        return None
    first = int(np.searchsorted(omega, NOISE_FROM * math.pi))
    while True:
        memory, level, _ = _fitted(omega[first:], logs[first:], variance)
        if first == 0:
            break
        next_one = level + float(_shape(omega[first - 1], np.array(memory)))
        if logs[first - 1] - next_one > QUIET_FOLLOWS_ON * math.sqrt(variance):
            memory, level = _coloured_from_below(omega, logs, variance, first) or (memory, level)
            break
        first -= 1
    return Noise(math.sqrt(math.exp(level) / (1.0 - memory**2)), memory)


def _coloured_from_below(
    omega: Floats, logs: Floats, variance: float, first: int
) -> tuple[float, float] | None:
    """Return the colour and level that explain more frequencies than those from `first` on.

    Far above its corner frequency coloured noise looks white, and its part below like a signal.
    None if no colour fits up to the Nyquist frequency by χ².
    """
    for begin in range(first):
        memory, level, misfit = _fitted(omega[begin:], logs[begin:], variance)
        free = len(logs) - begin - 2
        if memory > 0.0 and misfit < free + QUIET_FOLLOWS_ON * math.sqrt(2.0 * free):
            return memory, level
    return None


def noise_of_input(signal: Floats) -> Noise | None:
    """Return the noise of a smooth signal, shape (frames,); None if it is short or has no noise."""
    if len(signal) < WHITE_FRAMES:
        return None
    omega, logs, variance = _levels(signal, 4)
    high = omega >= BESIDE_FROM * math.pi
    omega, logs = omega[high], logs[high]
    if not np.all(np.isfinite(logs)):
        return None
    shapes = _shape(omega, _SHAPES) - _shape(math.pi, _SHAPES)  # (colours, frequencies)
    each = []
    for steepness in STEEPNESSES:
        beside = np.outer(SIGNALS, (0.5 * math.pi / omega) ** steepness)
        left = logs - np.log(np.exp(shapes)[:, None, :] + beside)
        left -= np.median(left, axis=2, keepdims=True)
        misfit = np.sum(np.minimum(left**2 / variance, OUTLYING**2), axis=2)
        misfit += BESIDE_BY * (_SHAPES > 0.0) + BESIDE_BY * (SIGNALS > 0.0)
        each.append(misfit)
    misfits = np.array(each)

    def level(colour: int) -> float:
        """Return the power of the white input of noise of a colour, with the best signal."""
        best = int(misfits[:, colour].argmin())
        steep, size = np.unravel_index(best, misfits[:, colour].shape)
        power = (0.5 * math.pi / omega) ** STEEPNESSES[steep]
        left = logs - np.log(np.exp(shapes[colour]) + SIGNALS[size] * power)
        near_it = np.abs(left - np.median(left)) < OUTLYING * math.sqrt(variance)
        return float(np.exp(np.mean(left[near_it]))) * (1.0 + COLOURS[colour]) ** 2

    near = misfits < misfits.min() + BESIDE_BY
    least = int(np.argmax(near.any(axis=(0, 2))))
    likeliest = int(misfits.min(axis=(0, 2)).argmin())
    memory, driven = COLOURS[least], level(least)
    slow = driven / (1.0 - memory) ** 2
    most = level(likeliest) / (1.0 - COLOURS[likeliest]) ** 2
    unsure = max(0.0, most / slow - 1.0)
    return Noise(math.sqrt(driven / (1.0 - memory**2)), memory, unsure=unsure)


def _levels(signal: Floats, differences: int) -> tuple[Floats, Floats, float]:
    """Return frequencies, rad a frame, the logarithm of the noise's power there, and its variance.

    The signal is differenced to avoid leakage from low frequencies.
    """
    taper = np.hanning(PIECE)
    rough = np.diff(signal, differences)
    pieces = np.lib.stride_tricks.sliding_window_view(rough, PIECE)[:: PIECE // 2]
    power = np.abs(np.fft.rfft(pieces * taper, axis=1)) ** 2 / float(taper @ taper)
    omega = np.linspace(0.0, math.pi, power.shape[1])[1:-1]
    power = power[:, 1:-1] / (2.0 * np.sin(0.5 * omega)) ** (2 * differences)
    # The quantile q of exponentially distributed values is −ln(1 − q) times the mean.
    middle = -math.log(1.0 - QUIET_SHARE)
    with np.errstate(divide="ignore"):
        logs = np.log(np.quantile(power, QUIET_SHARE, axis=0) / middle)
    # Pieces overlap by half, and the taper correlates neighbouring frequencies.
    counted = 0.5 * len(power)
    return omega, logs, QUIET_SHARE / ((1.0 - QUIET_SHARE) * middle**2) / counted


def _shape(omega: Floats | float, memory: Floats) -> Floats:
    """Return the logarithm of the power of a first-order lag's noise over its white input's."""
    return np.asarray(-np.log(1.0 + memory**2 - 2.0 * memory * np.cos(omega)))


def _fitted(omega: Floats, logs: Floats, variance: float) -> tuple[float, float, float]:
    """Return the correlation by frames (0 if white noise fits about as well), level and χ²."""
    left = logs - _shape(omega, _SHAPES)
    middle = np.median(left, axis=1, keepdims=True)
    near = np.abs(left - middle) < OUTLYING * math.sqrt(variance)
    misfit = np.sum(np.minimum((left - middle) ** 2 / variance, OUTLYING**2), axis=1)
    best = int(np.argmin(misfit))
    if misfit[0] - misfit[best] < COLOURED_BY:
        best = 0
    level = float(np.mean(left[best][near[best]])) if near[best].any() else float(middle[best, 0])
    return COLOURS[best], level, float(misfit[best])
