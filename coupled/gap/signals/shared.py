"""What one channel has of another's noise, or of its roughness: by fourth differences of both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.gap.signals.output import rounding
from coupled.gap.thresholds import ECHO_FRAMES, FELT_FRAMES

Floats = NDArray[np.float64]


def echoed(signal: Floats, made: Floats) -> tuple[float, float]:
    """Return how much of a signal's white noise is that of what it was made from, and the rest.

    The share is of the noise's power, 0 to 1, the rest an rms. `made` is the signal as it should
    be, with the noise of its source: where that comes late or filtered, it echoes over frames.
    """
    noise, source = np.diff(signal, 4)[ECHO_FRAMES:], np.diff(made, 4)
    echo = np.column_stack([source[ECHO_FRAMES - k : len(source) - k] for k in range(ECHO_FRAMES)])
    left = noise - echo @ np.linalg.lstsq(echo, noise, rcond=None)[0]
    power = float(noise @ noise)
    share = 1.0 - float(left @ left) / power if power > 0.0 else 0.0
    rest = float(np.sqrt(np.mean(left**2) / 70.0))
    return share, max(rest, rounding(signal, float(np.sqrt(power / len(noise) / 70.0))))


def felt(force: Floats, answer: Floats) -> float:
    """Return how much of a force's roughness its answer shows, 0 to 1, as a share of the power.

    What is rough in a force, and no noise, is in what answers to it: fourth differences of the
    force are regressed on those of the answer about the same frame, without a model of what lies
    between.
    """
    rough, shown = np.diff(force, 4)[FELT_FRAMES:-FELT_FRAMES], np.diff(answer, 4)
    last = len(shown) - 2 * FELT_FRAMES
    near = np.column_stack([shown[k : k + last] for k in range(2 * FELT_FRAMES + 1)])
    left = rough - near @ np.linalg.lstsq(near, rough, rcond=None)[0]
    power = float(rough @ rough)
    return 1.0 - float(left @ left) / power if power > 0.0 else 0.0
