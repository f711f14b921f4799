"""Command: the servo's input from δc, continuous or as set points, with its delay.

A digital servo takes a set point once a frame and holds it; a bus and the servo's cycle delay it.
"""

from __future__ import annotations

from typing import Protocol

from coupled.rig.compiled import stage
from coupled.rig.delay import DelayParameters, DelayState, delayed, start_delay


class CommandParameters(DelayParameters, Protocol):
    """The servo's command; `delay_substeps` is its dead time over the substep."""

    held: int  # as set points, each held over a frame


class CommandState(DelayState, Protocol):
    """The servo's input; `delayed` is the latest, d."""

    set_point: float  # of this frame, d


@stage
def start_command(p: CommandParameters, s: CommandState, computed: float) -> None:
    """Start with the servo at rest at δc, d."""
    s.set_point = computed
    start_delay(p, s, computed, computed)


@stage
def take_set_point(p: CommandParameters, s: CommandState, computed: float) -> None:
    """Set the servo's set point for a frame, d."""
    s.set_point = computed


@stage
def commanded(
    p: CommandParameters, s: CommandState, computed_before: float, computed: float
) -> tuple[float, float]:
    """Return the servo's input at both ends of a substep, d, linear between them.

    A new set point is reached over the first substep of its frame.
    """
    if p.held == 0 and p.delay_substeps == 0.0:
        return computed_before, computed
    before = s.delayed
    s.delayed = delayed(p, s, s.set_point if p.held else computed)
    return before, s.delayed
