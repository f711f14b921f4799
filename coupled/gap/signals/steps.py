"""Wider steps of the loader, by which the search finds its way.

A loader runs at 2 kHz or more, for the pilot's hand. What a record holds of it is read off a few
steps a frame nearly as well: at 480 Hz a replay of 60 s differs from that at 2 kHz by hundredths
of a floor, and costs a quarter. What a fit ends at, and all that is judged, is by the rig's own
steps.
"""

from __future__ import annotations

from coupled.gap.thresholds import WIDE_STEPS_Hz
from coupled.rig.rig import Rig
from coupled.schema import quantity


class WideRig(Rig):
    """A rig of which the loader may be stepped more widely than any real one is."""

    loader_rate: float = quantity("Hz", WIDE_STEPS_Hz, gt=0)


def widely_stepped(rig: Rig) -> Rig:
    """Return a rig whose loader takes no more steps than a search needs."""
    if rig.loader_rate <= WIDE_STEPS_Hz:
        return rig
    given = {name: getattr(rig, name) for name in Rig.model_fields}
    return WideRig.model_construct(**{**given, "loader_rate": WIDE_STEPS_Hz})
