"""Why an aircraft does not trim, in words: the accelerations that stay, and the controls' limits.

Angle of attack, throttle and elevator are varied within their limits until the accelerations of the
plane of symmetry are least, lift and pitch before thrust. What stays of them, and the control at
its limit, is the reason, for each method of trim.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from coupled.units import FOOT_m

Floats = NDArray[np.float64]
Accelerations = Callable[[Floats], Floats]  # ft/s² twice and rad/s², of the three controls
_STAYS = np.array([0.02 / FOOT_m, 0.02 / FOOT_m, 0.002])  # smaller ones count as none
_FIRST = np.array([1.0, 10.0, 10.0])  # weights: lift and pitch are balanced before thrust
_SMALL = 0.25  # of the largest, by what counts as none: not reported
_AT_LIMIT = 1e-3
_EVALUATIONS = 40
_STEP = np.array([1e-4, 1e-3, 1e-3])
_CONTROL = (1, 0, 2)  # throttle, angle of attack and elevator balance the accelerations in order
# Of each acceleration, its unit and its words by sign.
_WORDS = (
    ("m/s²", "forwards", "backwards"),
    ("m/s²", "downwards", "upwards"),
    ("rad/s²", "nose up", "nose down"),
)


def imbalance(accelerations: Accelerations, low: Floats, high: Floats) -> str:
    """Return the accelerations that stay and the controls at their limits, for a sentence.

    Empty if the accelerations vanish within the limits. `accelerations` are those along the nose
    and down the body's axis, ft/s², and of pitch, rad/s², for angle of attack in rad, throttle
    and elevator command. `low` and `high` are the limits of the three.
    """
    starts = (np.array([0.07, 0.7, 0.0]), np.array([0.25, 1.0, -0.3]))
    found = [_least(accelerations, low, high, start) for start in starts]
    point = min(found, key=lambda x: float(np.sum((accelerations(x) / _STAYS) ** 2)))
    left = accelerations(point)
    if not np.all(np.isfinite(left)):
        return "its state is not finite"
    sizes = np.abs(left) / _STAYS
    if sizes.max() <= 1.0:
        return ""
    large = [i for i in range(3) if sizes[i] > max(1.0, _SMALL * sizes.max())]
    stays = " and ".join(_named(i, left[i]) for i in large)
    by = [_CONTROL[i] for i in large]
    limits = [_limit(i, left[i], point[k], low[k], high[k]) for i, k in zip(large, by, strict=True)]
    at = " and ".join(limit for limit in limits if limit)
    return f"{stays} remain{f' with {at}' if at else ''}"


def _limit(i: int, left: float, at: float, low: float, high: float) -> str:
    """Return the limit of the control that should remove an acceleration; empty if it has none."""
    near = _AT_LIMIT * (high - low)
    if i == 1:
        if at > high - near or at < low + near:
            return f"the angle of attack at its limit, {at:.2g} rad"
        return f"the lift at its greatest (angle of attack {at:.2g} rad)" if left > 0.0 else ""
    if i == 0:
        if left < 0.0:
            return "the throttle full" if at > high - near else "no more thrust from the throttle"
        return "the throttle closed" if at < low + near else ""
    sides = (("full up", at < low + near), ("full down", at > high - near))
    return next((f"the elevator {side}" for side, reached in sides if reached), "")


def _least(accelerations: Accelerations, low: Floats, high: Floats, start: Floats) -> Floats:
    """Return the controls at which the accelerations are least, from a start."""
    from scipy.optimize import least_squares  # only an aircraft that does not trim needs it

    def left(point: Floats) -> Floats:
        values = _FIRST * accelerations(point) / _STAYS
        return np.where(np.isfinite(values), np.clip(values, -1e6, 1e6), 1e6)

    inside = np.clip(start, low + 1e-6, high - 1e-6)
    found = least_squares(
        left,
        inside,
        bounds=(low, high),
        x_scale=np.array([0.1, 0.5, 0.5]),
        diff_step=_STEP,
        max_nfev=_EVALUATIONS,
    )
    point: Floats = found.x
    return point


def _named(i: int, value: float) -> str:
    unit, positive, negative = _WORDS[i]
    size = abs(value) * (FOOT_m if i < 2 else 1.0)
    return f"{size:.2g} {unit} {positive if value > 0.0 else negative}"
