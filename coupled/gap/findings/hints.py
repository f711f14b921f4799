"""What to check in a record whose gap no effect explains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.errors import joined
from coupled.gap.chain import AIRFRAME
from coupled.gap.signals.output import TRIM, Output
from coupled.gap.stages.surfaces import states_trim, surface_channel
from coupled.gap.thresholds import NEARLY_ALL, WINDOW_s
from coupled.record.channels import CONTROL_NAMES
from coupled.record.levers import levers_of
from coupled.record.record import Record
from coupled.rig.rig import Rig

_POSITIONS = tuple(map(surface_channel, CONTROL_NAMES))


def late_channels(outputs: Sequence[Output], rig: Rig) -> str:
    """Return a sentence on the channels that nearly agree with the model at another time."""
    flown = [one for one in outputs if one.stage == AIRFRAME and one.channel != TRIM]
    delays = {one.channel: _delay_s(one, rig) for one in flown if one.gap(rig) > one.limit}
    late = {name: delay for name, delay in delays.items() if delay != 0.0}
    if not late:
        return ""
    each = [f"{name} ({delay:.2g} s)" for name, delay in late.items()]
    verb = "is" if len(each) == 1 else "are"
    return f"{joined(each)} {verb} late, relative to the model: check the time stamps."


def _delay_s(output: Output, rig: Rig) -> float:
    """Return the delay of the model's motion that removes nearly all of a gap; 0 if none does."""
    most = round(WINDOW_s * output.frame_rate_Hz)
    if len(output.measured) <= 4 * most:
        return 0.0
    measured = output.measured[most:-most] / output.floor
    predicted = output.measured / output.floor - output.residual(rig)

    def excess(frames: int) -> float:
        shifted = predicted[most - frames : len(predicted) - most - frames]
        return max(float(np.mean((measured - shifted) ** 2)) - 1.0, 0.0)

    delay = min(range(-most, most + 1), key=excess)
    explains = excess(delay) <= (1.0 - NEARLY_ALL) * excess(0)
    return delay / output.frame_rate_Hz if explains else 0.0


def still_surfaces(records: Sequence[Record]) -> str:
    """Return a sentence on the recorded surfaces that never change."""
    values = {name: [one[name] for one in records if name in one] for name in _POSITIONS}
    still = [name for name, each in values.items() if each and not any(map(np.ptp, each))]
    verb = "never changes" if len(still) == 1 else "never change"
    return f"{joined(still)} {verb}: is a sensor stuck?" if still else ""


def unknown_conditions(records: Sequence[Record]) -> str:
    """Return a sentence on conditions that no record shows; empty if the flight was simulated."""
    if any(map(states_trim, records)):
        return ""
    recorded = {kind for one in records for kind, _ in levers_of(one.channels).values()}
    lacking = [kind for kind in ("throttle", "flap", "gear") if kind not in recorded]
    words = ""
    if lacking:
        names = joined([f"{kind}_norm" for kind in lacking])
        words = f"Not recorded, and in the model as in trim: {names}. "
    return words + (
        "In the model all engines run, and no wind changes the airspeed or rotates the "
        "aircraft: leave out the rows with an engine failure, wind shear or turbulence."
    )
