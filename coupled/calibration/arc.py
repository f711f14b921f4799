"""Deflections on an arc: a ruler held level reads less than the grip has moved.

    δ_ruler = L·sin θ    eq. (15)        δ = L·θ    eq. (16)        sin θ ≈ θ − θ³/6    eq. (17)

The linkage turns with θ, so v₁ follows the arc. The correction is the exact L·arcsin(δ_ruler/L);
eq. (17) gives its relative size, θ²/6: 1 % at 14°, 2 % at 20°.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.units import DEGREE_rad

Floats = NDArray[np.float64]
LIMIT_rad = 14.0 * DEGREE_rad


def along_arc(level: Floats, length: float) -> Floats:
    """Return the deflection along an arc from a level ruler's reading, in m: eqs. (15) and (16)."""
    return np.asarray(length * np.arcsin(level / length))


def angle(level: Floats, length: float) -> Floats:
    """Return the angle θ in rad for readings of a level ruler in m, on an arc of `length`."""
    return np.asarray(np.arcsin(level / length))


def shortfall(theta_rad: Floats) -> Floats:
    """Return the relative error of a level ruler on the arc: θ²/6, eq. (17)."""
    return np.asarray(theta_rad**2 / 6.0)
