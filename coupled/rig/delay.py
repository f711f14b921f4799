"""Delay: the pilot's force reaches the loader late, straight between past nodes."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import stage
from coupled.rig.parameters import DELAY_SLOTS


class DelayParameters(Protocol):
    """How late it is."""

    delay_substeps: float  # transport delay over the substep


class DelayState(Protocol):
    """What is on its way."""

    delayed: float  # the pilot's force as the loader has it, N
    node: int  # substeps since the start
    history: NDArray[np.float64]  # the pilot's force at past nodes, N


@stage
def start_delay(p: DelayParameters, s: DelayState, force: float) -> None:
    """Begin with the pilot's force at the first node, N, and none before it."""
    s.history[0] = force
    s.delayed = force if p.delay_substeps == 0.0 else 0.0


@stage
def delayed(p: DelayParameters, s: DelayState, force: float) -> float:
    """Return the force at the next node, N, as the loader gets it."""
    s.node += 1
    if p.delay_substeps == 0.0:
        return force
    s.history[s.node & (DELAY_SLOTS - 1)] = force
    whole = int(p.delay_substeps)
    share = p.delay_substeps - whole
    late = s.history[(s.node - whole) & (DELAY_SLOTS - 1)] if s.node >= whole else 0.0
    later = s.history[(s.node - whole - 1) & (DELAY_SLOTS - 1)] if s.node > whole else 0.0
    return (1.0 - share) * late + share * later
