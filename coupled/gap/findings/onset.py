"""Since when a gap is there, by windows at the same excitation: amplitude is no onset.

A gap that grows with the motion is quiet while the motion is small, and that is no onset. So a
quiet window counts as evidence only by the loud ones that were excited no more than it, in every
signal that drives the stage. If they are nearly all loud and it is not, something has changed in
between. Under the hypothesis that excitation alone decides, the chance that all windows before are
quiet is the product of (1 − q), q being the share that is loud of those excited no more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.thresholds import ONSET_CHANCE, ONSET_LIKELY, WHERE_LOUD, WHERE_WINDOW_s

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
DRIVES = 3  # signals, by which two windows are excited alike


@dataclass(frozen=True)
class Span:
    """A time in s from the record's start, and between which two it surely lies."""

    at_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True)
class InTime:
    """When a residual is loud: in what share of the windows, from when on, and until when.

    None where that is not sure: it may be as the excitation is.
    """

    loud: float
    begins: Span | None
    ends: Span | None


def in_time(left: Floats, drives: Mapping[str, Floats], rate_Hz: float) -> InTime:
    """Return when a residual in floors is loud; `drives` are the signals that excite its stage."""
    frames = max(1, round(WHERE_WINDOW_s * rate_Hz))
    rms = _rms(left, frames)
    loud = rms > WHERE_LOUD
    excited = np.array([_rms(x - np.median(x), frames) for x in list(drives.values())[:DRIVES]])
    window_s, last = frames / rate_Hz, len(loud)
    share = float(np.mean(loud)) if last else 0.0
    if not last or not loud.any() or not len(excited):
        return InTime(share, None, None)
    begins = _begins(loud, excited)
    turned = _begins(loud[::-1], excited[:, ::-1])
    return InTime(
        share,
        None if begins is None else Span(*(window_s * k for k in begins)),
        None if turned is None else _turned(Span(*(last - k for k in turned)), window_s),
    )


def _turned(span: Span, window_s: float) -> Span:
    return Span(window_s * span.at_s, window_s * span.high_s, window_s * span.low_s)


def _begins(loud: Mask, excited: Floats) -> tuple[int, int, int] | None:
    """Return the first loud window, and the windows between which it began; None if unsure."""
    first, last = int(np.argmax(loud)), len(loud) - int(np.argmax(loud[::-1]))
    chance, last_quiet = 0.0, 0
    for i in range(first):
        alike = np.all(excited[:, first:last] <= excited[:, i : i + 1], axis=0)
        count, of = int(np.sum(loud[first:last][alike])), int(np.sum(alike))
        if not of:
            continue
        likely = (count + 0.5) / (of + 1.0)
        chance += math.log1p(-likely)
        if likely >= ONSET_LIKELY:
            last_quiet = i + 1
    if chance > math.log(ONSET_CHANCE):
        return None
    return first, last_quiet, first + 1


def _rms(signal: Floats, frames: int) -> Floats:
    count = len(signal) // frames
    return np.asarray(
        np.sqrt(np.mean(signal[: count * frames].reshape(count, frames) ** 2, axis=1))
    )
