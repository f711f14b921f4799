"""Compensation: the host's own arithmetic, held against what a record says that it read."""

from __future__ import annotations

import numpy as np

from coupled.gap.output import white
from coupled.gap.sensed import Sensed
from coupled.gap.stages import Reader
from coupled.gap.thresholds import ROUNDING_SPAN
from coupled.rig.replay import replay_compensation
from coupled.rig.rig import Rig


def compensation_gap(reader: Reader, rig: Rig) -> float:
    """Return the rms departure of the host's δ̂ from its own arithmetic, over δc's noise.

    `rig` says how late F was stamped.
    """
    computed, force = reader.signal("computed"), reader.signal("force")
    force = Sensed(rig, reader.control).as_the_host_had_it(force)
    made = replay_compensation(reader.rig, reader.control, computed, force, reader.others())
    floor = max(white(computed), ROUNDING_SPAN * float(np.ptp(computed)))
    return float(np.sqrt(np.mean((reader.signal("estimate") - made) ** 2))) / floor
