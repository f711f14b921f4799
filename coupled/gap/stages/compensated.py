"""The output of the compensation: δ̂ by the host's equations, from δc and F as read."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coupled.gap.signals.floors import unsmoothed
from coupled.gap.signals.output import Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import ROUNDING_SPAN
from coupled.rig.hosted import held_over
from coupled.rig.replay import replay_compensation
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


def compensated(reading: Reading) -> tuple[str, Floats, Predict, float, float]:
    """Return the channel, δ̂ as recorded, its prediction by a rig, its floor, and F's part of it, d.

    The floor is the noise of δc, although the host reads the same noise, because F may be stamped
    slightly late. If the rig's F is late, the record's noise of F may differ from the host's.
    """
    computed, recorded = reading.as_read("computed"), reading.as_read("force")
    control, others = reading.control, reading.others(as_read=True)
    assumed = reading.assumed()

    def made(rig: Rig, force: Floats) -> Floats:
        missed = reading.missed.under(rig, control)
        made = replay_compensation(rig, control, computed, force, others, missed)
        return made if assumed is None else made + held_over(assumed.estimate * force, missed)

    def predict(rig: Rig) -> Floats:
        return made(rig, reading.sensed(rig).as_the_host_had_it(recorded))

    own = max(reading.channel_noise("computed").rms, ROUNDING_SPAN * float(np.ptp(computed)))
    rig, carried = reading.rig, 0.0
    if rig.controls[control].sensing.force_stamp != 0.0:
        level, late = reading.driving("force"), reading.sensed(rig).as_the_host_had_it
        shaken = late(unsmoothed(recorded, 0, level)), unsmoothed(late(recorded), 0, level)
        carried = math.hypot(*(float(np.std(made(rig, f) - predict(rig))) for f in shaken))
    floor, name = math.hypot(own, carried), reading.name_of("estimate")
    return name, reading.signal("estimate"), predict, floor, carried
