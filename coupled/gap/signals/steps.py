"""Wider steps of the loader, for the search.

A loader runs at 2 kHz or more for the pilot's hand. A replay of a record needs only a few steps a
frame: at 480 Hz a replay of 60 s differs from that at 2 kHz by hundredths of a noise floor, at a
quarter of the cost. Final fits and all results use the rig's own steps.
"""

from __future__ import annotations

from coupled.gap.thresholds import COARSE_STEPS_Hz
from coupled.rig.rig import Rig
from coupled.schema import quantity


class CoarseRig(Rig):
    """A rig whose loader may be stepped more widely than the schema of a rig file allows."""

    loader_rate: float = quantity("Hz", COARSE_STEPS_Hz, gt=0)


def coarsely_stepped(rig: Rig) -> Rig:
    """Return a rig whose loader takes no more steps than the search needs."""
    if rig.loader_rate <= COARSE_STEPS_Hz:
        return rig
    given = {name: getattr(rig, name) for name in Rig.model_fields}
    return CoarseRig.model_construct(**{**given, "loader_rate": COARSE_STEPS_Hz})
