"""Smoothing of inputs, with parameters from cross-validation; at rest they are constant.

A smoother passes noise at low frequencies. A stage with memory (presliding friction, backlash)
creeps under that noise, while the real hardware stands still as long as the hand rests. A stretch
that shows only noise about one level is therefore held at that level. Its windows have the scatter
of noise and halves with equal means, and the means of all its parts agree by χ².

A stage driven by a noisy input responds to noise that the rig never had, and a fit then mistakes
the missing response for more inertia or a lag (errors in variables). The inputs are smooth on the
scale of a frame, so the Whittaker smoother with n-th differences, n up to 3,

    H(ω) = 1/(1 + λ·(2·sin(ω/2))²ⁿ),

removes the noise; of an imposed motion with n up to 6. λ and n are from generalised cross-
validation (Craven and Wahba, 1979), which preserves sharp inputs. It assumes white noise, so the
spectra are first divided by that of the noise's colour, and λ is scaled likewise. A line (`lines`),
such as mains hum, is not noise: it is subtracted before and added again.

The corners of a scripted force are also subtracted before and added again. A smoother rounds a
corner or rings beside it, by several times the noise, and dry friction keeps the error of the peak.
A corner is a change of slope, far above those elsewhere in the signal. The change is as large over
few frames as over many, whereas the change of slope of a smooth bend grows with the frames. The
residual of two straight lines that meet at a corner is noise alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from coupled.gap.noise.lines import lines_in
from coupled.gap.noise.noise import Floats, Noise, noise_of, noise_of_input
from coupled.gap.thresholds import (
    CORNER_FRAMES,
    FAR_SIGMAS,
    FEW_FRAMES,
    NEGLIGIBLE,
    PARTLY,
    PIECE,
    ROUNDING_SPAN,
    SIGMAS,
    SMALL,
)

# Of an imposed motion. With n = 3 the acceleration of `wiener_error` is √6 times that of `passed`.
MOTION_ORDERS = (6, 5, 4, 3, 2, 1)
REST_FRAMES = PIECE // 2  # of a window at rest


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
    """Return the rests of a signal; none if it is short or its noise is zero or large."""
    share, level = np.zeros(len(signal)), np.zeros(len(signal))
    ends, errors = list[tuple[int, int]](), list[float]()
    clear = 0.0 < noise.rms <= SMALL * float(np.std(signal))
    if clear and len(signal) > 2 * REST_FRAMES:
        for start, end in _stretches(_quiet(signal, noise)):
            mean = float(np.mean(signal[start:end]))
            if _is_level(signal[start:end], mean, noise):
                frames = np.arange(1, end - start + 1)
                near = np.minimum(frames, frames[::-1]) / FEW_FRAMES
                share[start:end], level[start:end] = np.minimum(1.0, near), mean
                ends.append((start, end))
                errors.append(noise.rms * math.sqrt(noise.mean_variance / (end - start)))
    return Rest(share, level, tuple(ends), tuple(errors))


def _quiet(signal: Floats, noise: Noise) -> NDArray[np.bool_]:
    """Return the frames in a window that shows only noise about one mean."""
    window, half = REST_FRAMES, REST_FRAMES // 2
    windows = np.lib.stride_tricks.sliding_window_view(signal, window)
    first, second = windows[:, :half].mean(axis=1), windows[:, half:].mean(axis=1)
    spread = noise.rms * (1.0 + SIGMAS / math.sqrt(2.0 * window))  # of an estimated rms
    apart = SIGMAS * noise.rms * math.sqrt(2.0 * noise.mean_variance / half)
    still = (windows.std(axis=1) <= spread) & (np.abs(second - first) <= apart)
    begun = np.concatenate((still.astype(int), np.zeros(window, dtype=int)))
    begun[window:] -= still  # each still window covers so many frames
    return np.asarray(np.cumsum(begun[: len(signal)]) > 0)


def _stretches(quiet: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the bounds of the quiet stretches, shortened at both ends."""
    turns = np.flatnonzero(np.diff(quiet.astype(int), prepend=0, append=0)).tolist()
    pairs = zip(turns[::2], turns[1::2], strict=True)
    inner = [(start + FEW_FRAMES // 2, end - FEW_FRAMES // 2) for start, end in pairs]
    return [(start, end) for start, end in inner if end - start >= (6 * REST_FRAMES // 5)]


def _is_level(stretch: Floats, mean: float, noise: Noise) -> bool:
    """Tell whether the means of a stretch's parts scatter as noise does (χ² test)."""
    parts = np.array_split(stretch, max(3, len(stretch) // (2 * REST_FRAMES // 3)))
    off = np.array([np.mean(part) - mean for part in parts])
    frames = np.array([len(part) for part in parts])
    freedom = len(parts) - 1
    square = float(np.sum(off**2 * frames)) / (noise.rms**2 * noise.mean_variance)
    return square <= freedom + SIGMAS * math.sqrt(2.0 * freedom)


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

    Corners that a few frames show are subtracted first, since others may lie beside them. At the
    end each is fitted again over more frames, up to the next corner, which excludes bends.
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
    """Return the change of slope over so many frames to either side, fitted; 0 at the ends."""
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
    lines: Floats  # of the signal, shape (frames,), and its corners: neither is smoothed
    corners: Corners

    @classmethod
    def of(
        cls,
        signal: Floats,
        orders: Sequence[int] = (3, 2, 1),
        noise: Noise | None = None,
        with_corners: bool = False,
        inside: bool = False,
    ) -> Smoother:
        """Return the best smoother of a signal, with differences of one of these orders.

        `noise` gives the colour of the noise; by default it is estimated from the signal. A signal
        may have corners if it is no motion of a mass. `inside`: the ends do not count.
        """
        whole = np.ascontiguousarray(signal, dtype=np.float64).tobytes()
        return _known(whole, tuple(orders), noise, with_corners, inside)

    @classmethod
    def of_imposed(cls, signal: Floats, noise: Noise) -> Smoother:
        """Return the best smoother of an imposed motion, whose ends are not judged.

        The loader's force follows from the second derivative, so noise above the bandwidth of the
        motion must be removed. The extension of the signal has a step of curvature at the ends,
        which would raise the cutoff frequency.
        """
        return cls.of(signal, MOTION_ORDERS, noise, inside=True)

    def smooth(self, signal: Floats) -> Floats:
        """Return the signal of the smoother without its noise, same shape, zero phase."""
        kept = self.lines + self.corners.over(np.arange(len(signal), dtype=np.float64))
        return self.passed(signal - kept) + kept

    def passed(self, noise: Floats) -> Floats:
        """Return what passes of noise, same shape."""
        long = _lengthened(noise, self.reach)
        drift = np.linspace(long[0], long[-1], len(long))
        out = drift + np.fft.irfft(np.fft.rfft(long - drift) * self.gain, len(long))
        return np.asarray(out[self.reach : self.reach + len(noise)])

    @classmethod
    def imposed(cls, signal: Floats, noise: Noise) -> tuple[Floats, Callable[[int], Floats]]:
        """Return an imposed motion without its noise, and with a numbered sample of its error.

        The error is that of the smoother of a motion with this noise, which a filtered log lacks.
        """
        frames = len(signal)
        smooth = cls.of_imposed(signal, noise).smooth(signal)
        noisy = smooth + noise.sample(frames, np.random.default_rng(41))

        def with_error(k: int) -> Floats:
            known = cls.of_imposed(noisy, noise)
            return smooth + known.wiener_error(noise, frames, np.random.default_rng([41, k]))

        return smooth, with_error

    def wiener_error(self, level: Noise, frames: int, rng: np.random.Generator) -> Floats:
        """Return a sample of the smoothing error, PSD H·Sₙ: noise passed and signal lost.

        For a signal whose Wiener filter is this smoother; `level` is its noise.
        """
        return self._sample(level, frames, rng, self.gain)

    def lost(self, level: Noise, frames: int, rng: np.random.Generator) -> Floats:
        """Return a sample of the signal that is lost, PSD H·(1 − H)·Sₙ."""
        return self._sample(level, frames, rng, self.gain * (1.0 - self.gain))

    def _sample(self, level: Noise, frames: int, rng: np.random.Generator, power: Floats) -> Floats:
        noise = level.sample(frames + 2 * self.reach, rng)
        out = np.fft.irfft(np.fft.rfft(noise) * np.sqrt(power), len(noise))
        return np.asarray(out[self.reach : self.reach + frames])


@lru_cache(maxsize=_REMEMBERED)
def _known(
    signal: bytes,
    orders: tuple[int, ...],
    noise: Noise | None,
    with_corners: bool,
    inside: bool,
) -> Smoother:
    """Return the smoother of a signal, cached."""
    plain = np.frombuffer(signal)
    lines = sum((line.over(len(plain)) for line in lines_in(plain)), np.zeros(len(plain)))
    corners = corners_in(plain - lines) if with_corners else Corners()
    rest = plain - lines - corners.over(np.arange(len(plain), dtype=np.float64))
    reach = min(len(plain) - 1, 200)
    gain = _gain(_lengthened(rest, reach), orders, _colour(rest, noise), reach if inside else None)
    for array in (gain, lines):
        array.flags.writeable = False
    return Smoother(gain, reach, lines, corners)


def _colour(signal: Floats, noise: Noise | None) -> float:
    """Return the noise's correlation from frame to frame, as given or as estimated.

    Zero for a filtered log, and for large noise, whose colour may be the signal's.
    """
    if noise is None and not noise_of(signal).filtered:
        noise = noise_of_input(signal)
    clear = noise is not None and noise.rms <= SMALL * float(np.std(signal))
    return noise.memory if noise is not None and clear else 0.0


def _gain(long: Floats, orders: Sequence[int], memory: float, inside: int | None) -> Floats:
    """Return the gain with the least generalised cross-validation score for an extended signal.

    The noise correlates from frame to frame by `memory`. `inside` is the extension of an imposed
    motion, of which only the judged frames count.
    """
    rate = 2.0 * np.sin(np.pi * np.fft.rfftfreq(len(long)))
    colour = (1.0 + memory) ** 2 / ((1.0 - memory) ** 2 + memory * rate**2)  # 1 at Nyquist
    whole = np.fft.rfft(long - np.linspace(long[0], long[-1], len(long)))
    power = np.abs(whole) ** 2 / colour
    best, found, stopped = np.inf, (orders[0], 0.0), np.empty_like(power)
    for order in orders:
        steep, span = rate ** (2 * order) * colour, max(order, 3)
        for strength in np.logspace(-span, 4 * span, 61).tolist():
            np.multiply(steep, strength, out=stopped)
            stopped /= 1.0 + stopped  # 1 − H
            share = float(stopped.sum())
            if inside is None:
                score = float(np.square(stopped, out=stopped) @ power) / share**2
            else:
                left = np.fft.irfft(stopped * whole / np.sqrt(colour), len(long))[inside:-inside]
                ends = unjudged(1.0 - stopped, len(left))
                score = float(np.mean(left[ends : len(left) - ends] ** 2)) / share**2
            if score < best:
                best, found = score, (order, strength)
    order, strength = found
    return np.asarray(1.0 / (1.0 + strength * rate ** (2 * order) * colour))


def unjudged(gain: Floats, frames: int) -> int:
    """Return the number of frames at each end where smoothing distorts a moving signal.

    Beyond so many frames the impulse response is below `NEGLIGIBLE` in sum.
    """
    size = np.abs(np.fft.irfft(gain))[: len(gain)]
    beyond = np.cumsum(size[::-1])[::-1]
    return min(int(np.argmax(beyond <= NEGLIGIBLE * beyond[0])), int(SMALL * frames))


def smoothed(signal: Floats, noise: Noise | None = None) -> Floats:
    """Return the signal without noise of a given or estimated colour; same shape, no lag."""
    return Smoother.of(signal, noise=noise).smooth(signal)


def _lengthened(signal: Floats, reach: int) -> Floats:
    """Return the signal extended by point reflection at its ends, without jump or kink."""
    before = 2.0 * signal[0] - signal[reach:0:-1]
    after = 2.0 * signal[-1] - signal[-2 : -reach - 2 : -1]
    return np.concatenate((before, signal, after))
