"""The noise of a channel, of a residual and of an input.

Of a channel, it is estimated from the part of the spectrum above the signal. Above 0.4 of the
Nyquist frequency the motion of a rig is far below sensor noise. There the noise is white, or that
of a first-order lag, whose power falls as 1/(1 + a² − 2a·cos ω), a being the correlation from frame
to frame. This model extrapolates to lower frequencies. Of each band only the lowest nine tenths of
the spectrum count, so that a line (mains hum) is not taken for noise. A log that was filtered or
resampled has almost no power there, and its noise cannot be estimated.

Of a residual, it is estimated with the same models. The spectrum of a control that sticks, slips or
closes its backlash falls as slowly as that of coloured noise, and a residual contains it only as
far as the stage has a gap. The spectrum is taken in pieces of half a second, and at each frequency
the 30 % quantile of the pieces counts, so that rare events are left out; lines are outliers.

The noise of a force cannot be taken from a residual, since the force is an input. There the
signal's own spectrum, which falls with some power of frequency, is fitted together with the noise.
Among the models that fit about as well, the noise with the least power at low frequencies is taken.
`unsure` is how much more the best fit has there.

Filters are solved as banded systems; `scipy.signal` is slow to import.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

from coupled.gap.thresholds import (
    BESIDE_BY,
    BESIDE_FROM,
    COLOUR_FITS,
    COLOURS,
    FOLLOWS_ON,
    LEVELS,
    MINOR,
    MOST,
    NEARLY_ALL,
    NOISE_BANDS,
    NOISE_FROM,
    PIECE,
    QUIET_FROM,
    QUIET_SHARE,
    SIGMAS,
    STEEPNESSES,
    WHITE_FRAMES,
)

Floats = NDArray[np.float64]
Coefficients = Sequence[float] | Floats


def rms_of(signal: Floats) -> float:
    """Return the root of a signal's mean square."""
    return float(np.sqrt(np.mean(signal**2)))


def filtered(above: Coefficients, below: Coefficients, signal: Floats) -> Floats:
    """Return Σ above[i]·x[k−i] = Σ below[i]·y[k−i] solved for y, from rest; shape of x.

    The coefficients are those of z⁰, z⁻¹ and so on; columns of x are filtered separately.
    """
    driven = above[0] * signal
    for lag, share in enumerate(above[1:], 1):
        driven[lag:] += share * signal[:-lag]
    bands = np.repeat(np.asarray(below, dtype=np.float64)[:, None], len(signal), axis=1)
    return np.asarray(solve_banded((len(below) - 1, 0), bands, driven))


def of_second_order(
    mass: float, damping: float, stiffness: float, rate_Hz: float
) -> tuple[Floats, Floats]:
    """Return the coefficients, above and below, of 1/(m·s² + c·s + k) by Tustin's rule, SI."""
    step = 2.0 * rate_Hz
    inert, damped = mass * step**2, damping * step
    below = np.array(
        [inert + damped + stiffness, 2.0 * (stiffness - inert), inert - damped + stiffness]
    )
    return np.array([1.0, 2.0, 1.0]) / below[0], below / below[0]


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

    @property
    def mean_variance(self) -> float:
        """The variance of a mean relative to that with white noise."""
        return (1.0 + self.memory) / (1.0 - self.memory)

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
    sure = levels[high]
    # Of the logarithm of a band's mean: with the taper about two of three bins are independent.
    variance = 1.5 / (len(rough) / 2.0 / NOISE_BANDS)
    least = float(np.median(sure[-3:]))
    if least < MINOR * float(np.median(sure[:3])):
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
    return usual < MOST * rms_of(rough)


def between_jumps(signal: Floats) -> Noise:
    """Return the noise of a signal that may jump, from the median of its fourth differences."""
    known, rough = noise_of(signal), np.abs(np.diff(signal, 4))
    usual = float(np.median(rough)) / 0.6745 / math.sqrt(70.0) if len(rough) else 0.0
    return known if known.rms <= usual / MOST else Noise(usual)


def _bands(rough: Floats) -> tuple[Floats, Floats]:
    """Return the middle frequencies of bands, rad a frame, and the noise's variance in each.

    `rough` are fourth differences, with the gain |2 sin(ω/2)|⁸ of power. The mean of a band is
    that of its lower part, corrected for the bias with an exponential distribution.
    """
    taper = np.hanning(len(rough))
    power = np.abs(np.fft.rfft(rough * taper)) ** 2 / float(taper @ taper)
    omega = np.linspace(0.0, math.pi, len(power))
    keep = (omega >= math.pi / NOISE_BANDS) & (omega < 0.99 * math.pi)
    power, omega = power[keep] / (2.0 * np.sin(0.5 * omega[keep])) ** 8, omega[keep]
    parts = np.array_split(np.arange(len(power)), NOISE_BANDS - 1)
    rest = 1.0 - NEARLY_ALL
    biased = (NEARLY_ALL + rest * math.log(rest)) / NEARLY_ALL
    levels = []
    for part in parts:
        quiet = np.sort(power[part])[: max(1, round(NEARLY_ALL * len(part)))]
        levels.append(float(np.mean(quiet)) / biased)
    return np.array([float(np.mean(omega[part])) for part in parts]), np.array(levels)


def _shape(at: Floats, memory: float) -> Floats:
    """Return the power of a first-order lag's noise over that of its white input."""
    return 1.0 / (1.0 + memory**2 - 2.0 * memory * np.cos(at))


def _memory(at: Floats, levels: Floats, first: int, variance: float) -> float:
    """Return the correlation of the noise by frames; 0 if white noise explains it as well.

    Lower bands than those from `first` on are added while they agree with the extrapolation. A
    signal's spectrum is much steeper than a first-order lag's, so it departs at once.
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
    better = misfit[0] - misfit[best] > (2.0 * BESIDE_BY)
    fits = misfit[best] < COLOUR_FITS * (len(at) - 2)
    return COLOURS[best] if better and fits else 0.0


_SHAPES = np.array(COLOURS)[:, None]
# Power of a signal at half the Nyquist frequency, over that of the noise at its end.
SIGNALS = np.concatenate(([0.0], np.exp(LEVELS)))


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
        memory, level, _ = _fitted_levels(omega[first:], logs[first:], variance)
        if first == 0:
            break
        next_one = level + float(_log_shape(omega[first - 1], np.array(memory)))
        if logs[first - 1] - next_one > SIGMAS * math.sqrt(variance):
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
        memory, level, misfit = _fitted_levels(omega[begin:], logs[begin:], variance)
        free = len(logs) - begin - 2
        if memory > 0.0 and misfit < free + SIGMAS * math.sqrt(2.0 * free):
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
    shapes = _log_shape(omega, _SHAPES) - _log_shape(math.pi, _SHAPES)  # (colours, frequencies)
    each = []
    for steepness in STEEPNESSES:
        beside = np.outer(SIGNALS, (0.5 * math.pi / omega) ** steepness)
        left = logs - np.log(np.exp(shapes)[:, None, :] + beside)
        left -= np.median(left, axis=2, keepdims=True)
        misfit = np.sum(np.minimum(left**2 / variance, SIGMAS**2), axis=2)
        misfit += BESIDE_BY * (_SHAPES > 0.0) + BESIDE_BY * (SIGNALS > 0.0)
        each.append(misfit)
    misfits = np.array(each)

    def level(colour: int) -> float:
        """Return the power of the white input of noise of a colour, with the best signal."""
        best = int(misfits[:, colour].argmin())
        steep, size = np.unravel_index(best, misfits[:, colour].shape)
        power = (0.5 * math.pi / omega) ** STEEPNESSES[steep]
        left = logs - np.log(np.exp(shapes[colour]) + SIGNALS[size] * power)
        near_it = np.abs(left - np.median(left)) < SIGMAS * math.sqrt(variance)
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


def _log_shape(omega: Floats | float, memory: Floats) -> Floats:
    """Return the logarithm of the power of a first-order lag's noise over its white input's."""
    return np.asarray(-np.log(1.0 + memory**2 - 2.0 * memory * np.cos(omega)))


def _fitted_levels(omega: Floats, logs: Floats, variance: float) -> tuple[float, float, float]:
    """Return the correlation by frames (0 if white noise fits about as well), level and χ²."""
    left = logs - _log_shape(omega, _SHAPES)
    middle = np.median(left, axis=1, keepdims=True)
    near = np.abs(left - middle) < SIGMAS * math.sqrt(variance)
    misfit = np.sum(np.minimum((left - middle) ** 2 / variance, SIGMAS**2), axis=1)
    best = int(np.argmin(misfit))
    if misfit[0] - misfit[best] < (2.0 * BESIDE_BY):
        best = 0
    level = float(np.mean(left[best][near[best]])) if near[best].any() else float(middle[best, 0])
    return COLOURS[best], level, float(misfit[best])
