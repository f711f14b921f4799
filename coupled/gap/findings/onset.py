"""The onset and end of a gap, by comparison of windows with the same excitation.

A gap that grows with the motion is small while the motion is small, which is no onset. So a quiet
window is evidence only in comparison with the loud windows that were excited no more, in every
signal that drives the stage. If nearly all of these are loud, something has changed in between.
If excitation alone decided, all windows before would be quiet with probability Π(1 − q), where q
is the loud share of the windows excited no more.
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
DRIVES = 3  # signals by which the excitation of two windows is compared


@dataclass(frozen=True)
class Span:
    """A time in s from the record's start, with its bounds."""

    at_s: float
    low_s: float
    high_s: float


@dataclass(frozen=True)
class InTime:
    """The share of the windows in which a residual is loud, and its onset and end.

    Onset or end is None if the excitation can explain it.
    """

    loud: float
    begins: Span | None
    ends: Span | None


def in_time(left: Floats, drives: Mapping[str, Floats], rate_Hz: float) -> InTime:
    """Return when a residual, in noise floors, is loud; `drives` are the stage's excitations."""
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
    """Return the first loud window and the bounds of the onset, in windows; None if unsure."""
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
