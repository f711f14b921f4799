"""Dry friction of the loader: Coulomb, and Stribeck with its breakaway.

Running friction opposes the motion; from rest the control holds until the net
force exceeds the breakaway. Between the two, friction falls with speed as
F_c + (F_s − F_c)·exp(−(v/v_s)²) (Armstrong-Hélouvry, Dupont and Canudas de Wit,
Automatica 30, 1994, their Stribeck term with exponent 2). It is set-valued at rest:
a control left inside the band stays exactly where it is.
"""

from __future__ import annotations

import math
from typing import Protocol

from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration


class FrictionParameters(Protocol):
    """Friction's levels, and the speed over which breakaway fades."""

    running: float  # F_c, N
    breakaway: float  # F_s ≥ F_c, N
    stribeck_rate: float  # v_s, d/s


FRICTION = Declaration(
    layout(FrictionParameters),
    section="control.loader",
    derived={
        "running": lambda g: g.control.loader.friction,
        "breakaway": lambda g: max(g.control.loader.friction, g.control.loader.breakaway),
    },
)


@stage
def running_friction(p: FrictionParameters, rate: float) -> float:
    """Return the friction's size in N when sliding at `rate` in d/s."""
    if p.breakaway <= p.running:
        return p.running
    ratio = rate / p.stribeck_rate
    return p.running + (p.breakaway - p.running) * math.exp(-ratio * ratio)
