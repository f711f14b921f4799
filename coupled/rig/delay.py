"""Delay: a stage's input with a dead time, linear between past nodes."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import stage
from coupled.rig.parameters import DELAY_SLOTS


class DelayParameters(Protocol):
    """The dead time."""

    delay_substeps: float  # the delay over the substep


class DelayState(Protocol):
    """The history of the delayed signal."""

    delayed: float  # latest output
    before_start: float  # value before the first node
    node: int  # substeps since the start
    history: NDArray[np.float64]  # at past nodes


@stage
def start_delay(p: DelayParameters, s: DelayState, given: float, before: float) -> None:
    """Start with the input at the first node, and the value before it."""
    s.history[0] = given
    s.before_start = before
    s.delayed = given if p.delay_substeps == 0.0 else before


@stage
def delayed(p: DelayParameters, s: DelayState, given: float) -> float:
    """Return the delayed input at the next node."""
    s.node += 1
    if p.delay_substeps == 0.0:
        return given
    s.history[s.node & (DELAY_SLOTS - 1)] = given
    whole = int(p.delay_substeps)
    share = p.delay_substeps - whole
    late = s.history[(s.node - whole) & (DELAY_SLOTS - 1)] if s.node >= whole else s.before_start
    later = (
        s.history[(s.node - whole - 1) & (DELAY_SLOTS - 1)] if s.node > whole else s.before_start
    )
    return (1.0 - share) * late + share * later
