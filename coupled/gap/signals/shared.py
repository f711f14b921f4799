"""Common noise of two channels, by regression of their fourth differences."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.gap.signals.output import rounding
from coupled.gap.thresholds import RESPONSE_FRAMES, SOURCE_FRAMES

Floats = NDArray[np.float64]


def share_from_source(signal: Floats, made: Floats) -> tuple[float, float]:
    """Return the share of a signal's white noise that comes from its source, and the rest.

    The share is of the noise's power, 0 to 1, the rest an rms. `made` is the signal computed with
    the noise of its source; delays and filters of the source over some frames are allowed for.
    """
    noise, source = np.diff(signal, 4)[SOURCE_FRAMES:], np.diff(made, 4)
    delayed = np.column_stack(
        [source[SOURCE_FRAMES - k : len(source) - k] for k in range(SOURCE_FRAMES)]
    )
    left = noise - delayed @ np.linalg.lstsq(delayed, noise, rcond=None)[0]
    power = float(noise @ noise)
    share = 1.0 - float(left @ left) / power if power > 0.0 else 0.0
    rest = float(np.sqrt(np.mean(left**2) / 70.0))
    return share, max(rest, rounding(signal, float(np.sqrt(power / len(noise) / 70.0))))


def share_in_response(force: Floats, answer: Floats) -> float:
    """Return the share of a force's high-frequency power that its response shows, 0 to 1.

    A response shows what is signal in the force, not noise. Fourth differences of the force are
    regressed on those of the response about the same frame, without a model between them.
    """
    rough, shown = np.diff(force, 4)[RESPONSE_FRAMES:-RESPONSE_FRAMES], np.diff(answer, 4)
    last = len(shown) - 2 * RESPONSE_FRAMES
    near = np.column_stack([shown[k : k + last] for k in range(2 * RESPONSE_FRAMES + 1)])
    left = rough - near @ np.linalg.lstsq(near, rough, rcond=None)[0]
    power = float(rough @ rough)
    return 1.0 - float(left @ left) / power if power > 0.0 else 0.0
