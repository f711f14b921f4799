"""The parts of a diagnosis: the controls that the records move, and the airframe.

This module alone decides which part judges the airframe. If the records move one control, its part
does. If they move several, the airframe is a part of its own: its motion is predicted once, from
all measured surfaces.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coupled.gap.chain import Part
from coupled.gap.signals.output import Floats, estimate_noise
from coupled.gap.stages.airframe import needs
from coupled.gap.thresholds import MOVES_LEAST, MOVES_NOISE
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig

Records = Mapping[str, Record]


def parts_of(
    rig: Rig, records: Records, control: ControlName | None
) -> tuple[dict[Part, Records], tuple[ControlName, ...]]:
    """Return the records of each part, by their files' names, and the controls held at rest.

    They are the parts of one control, or of all that the rig has and the records move. A control is
    held at rest if a force acts on it and does not move it in any record.
    """
    if control is not None:
        return {Part(control): records}, ()
    moving = {
        name: {file: one for file, one in records.items() if moves(rig, one, name)}
        for name in rig.controls
    }
    held = tuple(
        name
        for name, ours in moving.items()
        if not ours and any(_pulled(rig, one, name) for one in records.values())
    )
    moved = {name: ours for name, ours in moving.items() if ours}
    if len(moved) < 2:
        recorded = [name for name in rig.controls if any(_way(r, name) for r in records.values())]
        first = next(iter([*moved, *held, *recorded, *rig.controls]))
        return {Part(first): records}, tuple(name for name in held if name != first)
    first = next(iter(moved))
    parts: dict[Part, Records] = {
        Part(name, airframe=False): ours for name, ours in moved.items() if name != first
    }
    flown = rig.flight is not None
    if flown and any(all(n in one for n in needs(rig, one)) for one in records.values()):
        parts[Part(first, own=False)] = records
        flown = False
    # An airframe that cannot be judged is listed with the first control, and what it lacks.
    return {Part(first, airframe=flown): moved[first], **parts}, held


def moves(rig: Rig, record: Record, control: ControlName) -> bool:
    """Tell whether a record has a control, and moves it by more than noise.

    By its deflections; by the force if neither is recorded.
    """
    travel = MOVES_LEAST * rig.controls[control].travel
    way = _way(record, control)
    if not way:
        return _pulled(rig, record, control)
    return any(_beyond_noise(signal, travel) for signal in way)


def _way(record: Record, control: ControlName) -> list[Floats]:
    names = (channel(control, quantity) for quantity in ("computed", "deflection"))
    return [record[name] for name in names if name in record]


def _pulled(rig: Rig, record: Record, control: ControlName) -> bool:
    name = channel(control, "force")
    return name in record and _beyond_noise(record[name])


def _beyond_noise(signal: Floats, least: float = 0.0) -> bool:
    """Tell whether the standard deviation of a signal is well above its noise, and above `least`.

    Also true of a signal that holds no number, since the record is then refused with the row.
    """
    if not np.all(np.isfinite(signal)):
        return True
    spread = float(np.std(signal))
    if len(signal) < 5 or spread <= least:
        return False
    return spread > MOVES_NOISE * estimate_noise(signal).rms
