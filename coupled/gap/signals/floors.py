"""The noise of channels, and measured signals as inputs of the stages.

The noise of a channel is estimated from its spectrum, or taken from the rig file if the log was
filtered; that of two channels in common from a regression of their fourth differences. A measured
signal is smoothed as the input of a stage, constant at rest, with its error.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise, jumps, quiet_noise, rms_of
from coupled.gap.noise.smooth import Corners, Rest, Smoother, rest_of
from coupled.gap.signals.output import Floats, above_rounding, estimate_noise, rounding
from coupled.gap.thresholds import FEW_FRAMES, SHORT_FRAMES, SIGMAS, TINY
from coupled.rig.nodes import coarsely, on_nodes
from coupled.rig.rig import Rig


def noise_in(rig: Rig, channel: str, signal: Floats) -> Noise:
    """Return the noise of a channel; at least `given_noise` if its log was filtered."""
    found = estimate_noise(signal)
    if not found.filtered:
        return found
    return replace(found, rms=max(found.rms, given_noise(rig, channel, signal).rms))


def given_noise(rig: Rig, channel: str, signal: Floats) -> Noise:
    """Return the noise of a channel in the rig file; by default the least that a sensor has."""
    known = rig.noise.get(channel, 0.0)
    least = TINY * rms_of(signal)
    return Noise(known or max(least, rounding(signal, np.inf)))


def left_noise(
    estimated: Noise, signal: Floats, left: Floats, judged: NDArray[np.bool_] | None = None
) -> Noise:
    """Return a channel's noise from the residual of its stage; at least its rounding.

    `estimated` is that from the signal alone. It is kept for a filtered log, a short record, and if
    the residual is far larger: a signal that jumps elsewhere than predicted is a gap, not noise.
    Frames that are not `judged` have no residual: the noise is estimated from the others, and its
    rms taken over all frames.
    """
    rows = np.ones(len(left), dtype=bool) if judged is None else judged
    found = None if estimated.filtered else quiet_noise(left[rows])
    if found is not None and found.rms <= SIGMAS * estimated.rms:
        estimated = above_rounding(found, signal)
    share = float(np.mean(rows)) or 1.0
    return replace(estimated, rms=estimated.rms * math.sqrt(share))


def remove_projection(left: Floats, onto: Floats | None) -> Floats:
    """Return a residual without the part that repeats another channel's noise, same shape.

    A host's product of δc as read contains the noise of that reading, and not as its own.
    """
    power = 0.0 if onto is None else float(onto @ onto)
    return left if onto is None or power == 0.0 else left - float(left @ onto) / power * onto


def with_error(signal: Floats, k: int, level: Noise, with_corners: bool = False) -> Floats:
    """Return a smoothed signal with a sample of its error: noise passed and signal lost."""
    rng = np.random.default_rng([41, k])
    raw = signal + level.sample(len(signal), rng)
    smoother = Smoother.of(raw, noise=level, with_corners=with_corners)
    if not smoother.corners.each:
        return signal + smoother.wiener_error(level, len(signal), rng)
    return smoother.smooth(raw) + smoother.lost(level, len(signal), rng)


def unsmoothed(signal: Floats, k: int, level: Noise) -> Floats:
    """Return a signal that is used as recorded, with as much noise again."""
    return signal + level.sample(len(signal), np.random.default_rng([41, k]))


def floor_from(rig: Rig, channel: str, signal: Floats) -> str:
    """Return the source of a channel's noise floor if its log was filtered, in words."""
    if estimate_noise(signal).rms > given_noise(rig, channel, signal).rms:
        return "the level at its highest frequencies"
    if rig.noise.get(channel, 0.0) > 0.0:
        return "the rig file"
    return f"1/{1.0 / TINY:g} of the signal's RMS, since the rig file does not give it"


def share_from_source(signal: Floats, made: Floats) -> tuple[float, float]:
    """Return the share of a signal's white noise that comes from its source, and the rest.

    The share is of power, 0 to 1, the rest an rms. `made` is the signal computed with the noise of
    its source; delays and filters of the source over some frames are allowed for.
    """
    noise, rest = _regressed(signal, made, range(SHORT_FRAMES))
    return 1.0 - rest**2 / noise**2 if noise else 0.0, max(rest, rounding(signal, noise))


def share_in_response(force: Floats, answer: Floats) -> float:
    """Return the share of a force's high-frequency power that its response shows, 0 to 1.

    It is signal, not noise. Fourth differences of the force are regressed on those of the response
    about the same frame, without a model between them.
    """
    half = FEW_FRAMES // 2
    noise, rest = _regressed(force, answer, range(-half, half + 1))
    return 1.0 - rest**2 / noise**2 if noise else 0.0


def _regressed(signal: Floats, onto: Floats, delays: range) -> tuple[float, float]:
    """Return the rms of a signal's white noise, before and after regression on another signal.

    Fourth differences are regressed on those of the other signal, delayed by `delays` frames.
    """
    rough, other = np.diff(signal, 4), np.diff(onto, 4)
    inner = slice(max(delays.stop, 0), len(rough) + min(delays.start, 0))
    moved = np.column_stack([np.roll(other, k)[inner] for k in delays])
    left = rough[inner] - moved @ np.linalg.lstsq(moved, rough[inner], rcond=None)[0]
    before, after = (float(np.sqrt(np.mean(x**2) / 70.0)) for x in (rough[inner], left))
    return before, after


@dataclass(frozen=True)
class Drive:
    """A signal that drives a stage: as recorded and as used, its noise, rests and corners."""

    recorded: Floats
    smooth: Floats
    noise: Noise
    rest: Rest
    corners: Corners

    @classmethod
    def of(cls, signal: Floats, noise: Noise, with_corners: bool = False) -> Drive:
        """Return a signal smoothed, and held constant at rest; unchanged if it has no noise.

        Also if the smoother would remove far more than noise, as of a hand that moves in steps.
        """
        rest = rest_of(signal, noise)
        smoother = Smoother.of(signal, noise=noise, with_corners=with_corners)
        smooth = rest.held(smoother.smooth(signal)) if noise.rms else signal
        made = cls(signal, smooth, noise, rest, smoother.corners)
        taken = rms_of(signal - smooth)
        return made.unsmoothed(noise) if taken > SIGMAS * noise.rms else made

    def on_nodes(self, rig: Rig, samples: Floats, otherwise: bool = False) -> Floats:
        """Return this signal, or one with other errors, on the loader's nodes.

        Corners are joined by straight lines, beside which a spline would ring. `otherwise`: jumps
        beside them are interpolated more coarsely, for the error of the interpolation.
        """
        rest = samples - self.corners.over(np.arange(len(samples), dtype=np.float64))
        at = np.arange((len(samples) - 1) * rig.substeps + 1) / rig.substeps
        between = coarsely if otherwise and jumps(rest) else on_nodes
        return between(rig, rest) + self.corners.over(at)

    def unsmoothed(self, noise: Noise) -> Drive:
        """Return the signal as recorded, without smoothing."""
        none = np.zeros(len(self.recorded))
        return replace(self, smooth=self.recorded, noise=noise, rest=Rest(none, none))

    def with_error(self, k: int) -> Floats:
        """Return the signal with a sample of its error, number k; shape (frames,)."""
        if self.smooth is self.recorded:
            return unsmoothed(self.smooth, k, self.noise)
        error = with_error(self.smooth, k, self.noise, bool(self.corners.each)) - self.smooth
        return self.smooth + self.rest.with_error(error, np.random.default_rng([43, k]))

    def passed(self, rng: np.random.Generator) -> Floats:
        """Return a sample of the noise that passes the smoother, shape (frames,)."""
        sample = self.noise.sample(len(self.recorded), rng)
        known = Smoother.of(self.recorded, noise=self.noise, with_corners=bool(self.corners.each))
        return self.rest.beside(known.passed(sample))
