"""Stops within the travel, as a record shows them: where a fit begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.gap.signals.output import Output
from coupled.record.channels import ControlName, channel
from coupled.rig.rig import Rig

BEYOND = 0.02  # of the motion's range: the nominal rig passes a stop by at least so much


def stops(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return where the control stops aft and forward, d, in one entry; none where nothing stops it.

    A stop is met where the nominal rig goes beyond every measured place. There the control rests
    at it, and the median of what is measured is the stop. A side that is not met has the travel.
    """
    travels = (rig.controls[control].pull, rig.controls[control].push)
    names = [channel(control, quantity) for quantity in ("computed", "deflection")]
    ours = [o for o in outputs if o.stage == "loader" and o.channel in names]
    found: dict[str, float] = {}
    sides = (("aft_{d}", 1.0), ("forward_{d}", -1.0))
    for (name, side), travel in zip(sides, travels, strict=True):
        places = [_met(output, rig, side) for output in ours]
        met = [place for place in places if place is not None]
        found[name] = min([*met, travel])
    return [found] if ours and tuple(found.values()) != travels else []


def _met(output: Output, rig: Rig, side: float) -> float | None:
    """Return how far out a record's stop on one side lies, d; None where it meets none."""
    measured = side * output.measured
    predicted = measured - side * output.residual(rig) * output.floor
    furthest = float(np.max(measured))
    held = predicted > furthest + BEYOND * float(np.ptp(measured))
    if furthest <= 0.0 or not held.any():
        return None
    return max(float(np.median(measured[held])), 0.0) or None
