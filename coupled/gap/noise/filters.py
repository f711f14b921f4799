"""Recursive filters over a whole record, each solved as a banded system.

They replace `scipy.signal`, which is slow to import.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

Floats = NDArray[np.float64]
Coefficients = Sequence[float] | Floats


def filtered(above: Coefficients, below: Coefficients, signal: Floats) -> Floats:
    """Return Σ above[i]·x[k−i] = Σ below[i]·y[k−i] solved for y, from rest; shape of x.

    The coefficients are those of z⁰, z⁻¹ and so on. Columns are filtered separately.
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
