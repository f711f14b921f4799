"""Which of two positions is the grip's and which the computed one, if names do not decide it.

A structure bends under a force: δ − δc = K·F, K > 0. This decides if neither name does. If the
numbers contradict a name, or show nothing, the proposal has a question.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import CONTROL_NAMES, channel
from coupled.record.importing.plausible import bend_sign
from coupled.record.importing.suggest.columns import Column
from coupled.units import parse_unit

Floats = NDArray[np.float64]
ALIGNED = 0.3  # correlation of force and motion from which the force's sign is known


def settle_ends(chosen: Mapping[str, Column]) -> tuple[dict[str, Column], dict[str, str]]:
    """Return the columns by channel, positions exchanged if the numbers require it, and questions.

    The key of a question is the channel whose column is in question.
    """
    settled, asked = dict(chosen), dict[str, str]()
    for control in CONTROL_NAMES:
        ends = [channel(control, quantity) for quantity in ("computed", "deflection")]
        there = [name for name in ends if name in settled]
        if not any(settled[name].reading.either_end for name in there) and len(there) < 2:
            continue
        if len(there) == 1:
            name, other = there[0], next(end for end in ends if end != there[0])
            column = settled[name].name
            asked[name] = f"{column!r}, if this is its end; else call the section channels.{other}"
            continue
        computed, deflection = (settled[name] for name in ends)
        named = _named(computed, deflection)
        sign = _yields(computed, deflection, settled.get(channel(control, "force")))
        if sign < 0 and not named:
            settled[ends[0]], settled[ends[1]] = deflection, computed
        elif sign < 0 or (sign == 0 and not named):
            says = "its name contradicts the force" if sign else "the names do not show it"
            both = f"{computed.name!r} or {deflection.name!r}"
            asked[ends[0]] = f"{both}: which is on the actuator's side? {says}"
            asked[ends[1]] = f"{both}: which is at the grip? {says}"
    return settled, asked


def _named(computed: Column, deflection: Column) -> bool:
    """Tell whether one of two names identifies its end, and thereby the other's."""
    return not (computed.reading.either_end and deflection.reading.either_end)


def _yields(computed: Column, deflection: Column, force: Column | None) -> int:
    """Return the sign of the slope of δ − δc on the force that moves them, or 0 if unknown."""
    if force is None or any(c.kind != "numbers" for c in (computed, deflection, force)):
        return 0
    same = {(c.log, c.values.size) for c in (computed, deflection, force)}
    first, second = (parse_unit(c.reading.unit or "1") for c in (computed, deflection))
    if len(same) > 1 or first is None or second is None or first.dimension != second.dimension:
        return 0
    at_motor, at_grip = computed.values * first.factor, deflection.values * second.factor
    there = np.isfinite(at_motor) & np.isfinite(at_grip) & np.isfinite(force.values)
    if np.count_nonzero(there) < 10:
        return 0
    at_motor, at_grip, pull = at_motor[there], at_grip[there], force.values[there]
    return bend_sign(_direction(pull, at_motor + at_grip) * pull, at_motor, at_grip)


def _direction(force: Floats, moved: Floats) -> float:
    """Return the sign that aligns a force with the motion; 0 if unknown."""
    a, b = force - force.mean(), moved - moved.mean()
    scale = float(np.sqrt((a @ a) * (b @ b)))
    share = float(a @ b) / scale if scale > 0.0 else 0.0
    return float(np.sign(share)) if abs(share) >= ALIGNED else 0.0
