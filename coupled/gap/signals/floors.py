"""The noise of a channel: from its spectrum, or from the rig file if the log was filtered."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.noise.quiet import noise_of_input, quiet_noise
from coupled.gap.noise.smooth import Smoother
from coupled.gap.signals.output import estimate_noise, rounding
from coupled.gap.thresholds import LEAST_NOISE, LOUDER
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


def noise_in(rig: Rig, channel: str, signal: Floats) -> Noise:
    """Return the noise of a channel; at least `given_noise` if its log was filtered."""
    found = estimate_noise(signal)
    if not found.filtered:
        return found
    return replace(found, rms=max(found.rms, given_noise(rig, channel, signal).rms))


def given_noise(rig: Rig, channel: str, signal: Floats) -> Noise:
    """Return the noise of a channel in the rig file; by default the least that a sensor has."""
    known = rig.noise.get(channel, 0.0)
    least = LEAST_NOISE * float(np.sqrt(np.mean(signal**2)))
    return Noise(known or max(least, rounding(signal, np.inf)))


def input_noise(estimated: Noise, signal: Floats) -> Noise:
    """Return the noise of a stage's input; at least its rounding."""
    found = None if estimated.filtered else noise_of_input(signal)
    return estimated if found is None else _no_less(found, signal)


def left_noise(
    estimated: Noise, signal: Floats, left: Floats, judged: NDArray[np.bool_] | None = None
) -> Noise:
    """Return a channel's noise from the residual of its stage; at least its rounding.

    `estimated` is the noise estimated from the signal alone. It is kept for a filtered log, for a
    short record, and if the residual is far larger: a signal that jumps elsewhere than predicted is
    a gap, not noise. Frames that are not `judged` have no residual. The noise is estimated from the
    others, and its rms taken over all frames; if no frame is judged, `estimated` is kept.
    """
    rows = np.ones(len(left), dtype=bool) if judged is None else judged
    found = None if estimated.filtered else quiet_noise(left[rows])
    if found is not None and found.rms <= LOUDER * estimated.rms:
        estimated = _no_less(found, signal)
    share = float(np.mean(rows)) or 1.0
    return replace(estimated, rms=estimated.rms * math.sqrt(share))


def remove_projection(left: Floats, onto: Floats | None) -> Floats:
    """Return a residual without the part that repeats another channel's noise, same shape.

    A host's product of δc as read contains the noise of that reading. It shows how the product is
    computed and must not count as the product's own noise.
    """
    power = 0.0 if onto is None else float(onto @ onto)
    return left if onto is None or power == 0.0 else left - float(left @ onto) / power * onto


def _no_less(found: Noise, signal: Floats) -> Noise:
    """Return a noise that is at least a signal's rounding."""
    rough = float(np.sqrt(np.mean(np.diff(signal, 4) ** 2) / 70.0))
    return replace(found, rms=max(found.rms, rounding(signal, rough)))


def with_error(signal: Floats, k: int, level: Noise) -> Floats:
    """Return a smoothed signal with a sample of its error: noise passed and signal lost."""
    rng = np.random.default_rng([41, k])
    raw = signal + level.sample(len(signal), rng)
    return signal + Smoother.of(raw, noise=level).wiener_error(level, len(signal), rng)


def unsmoothed(signal: Floats, k: int, level: Noise) -> Floats:
    """Return a signal that is used as recorded, with as much noise again."""
    return signal + level.sample(len(signal), np.random.default_rng([41, k]))


def floor_from(rig: Rig, channel: str, signal: Floats) -> str:
    """Return the source of a channel's noise floor if its log was filtered, in words."""
    if estimate_noise(signal).rms > given_noise(rig, channel, signal).rms:
        return "the level at its highest frequencies"
    if rig.noise.get(channel, 0.0) > 0.0:
        return "the rig file"
    return f"1/{1.0 / LEAST_NOISE:g} of the signal's RMS, since the rig file does not give it"
