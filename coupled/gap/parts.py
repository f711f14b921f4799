"""The parts of a diagnosis: the controls that the records move, and the airframe.

This module alone decides which part judges the airframe. If the records move one control, its part
does. If they move several, the airframe is a separate part: its motion is predicted once, from
all measured surfaces. It is the only part of a rig without controls.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from coupled.errors import InputError
from coupled.gap.chain import AIRFRAME, STAGES, Part
from coupled.gap.signals.output import Floats, estimate_noise
from coupled.gap.signals.reading import Reading
from coupled.gap.stages.airframe import needs
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import DOUBLED, TINY
from coupled.record.channels import CONTROL_NAMES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig

Records = Mapping[str, Record]


def parts_of(
    rig: Rig, records: Records, control: ControlName | None
) -> tuple[dict[Part, Records], tuple[str, ...]]:
    """Return the records of each part, by their files' names, and what is not judged, in words.

    They are the parts of one control, or of all that the rig has and the records move.
    """
    if not rig.controls:
        if control is not None:
            problem = f"the rig is an aircraft alone, without a {control}; leave it out"
            raise InputError(rig.name, "--control", problem)
        return {Part("column", own=False): records}, ()
    if control is not None:
        return {Part(control): records}, ()
    moved = {
        name: {file: one for file, one in records.items() if moves(rig, one, name)}
        for name in rig.controls
    }
    judged = {name: ours for name, ours in moved.items() if _judges(rig, ours, name)}
    words = {
        name: _why_not(name, bool(ours))
        for name, ours in moved.items()
        if name not in judged and any(_pulled(one, name) for one in records.values())
    }
    if len(judged) < 2:
        known = [name for name in rig.controls if any(_way(one, name) for one in records.values())]
        first = next(iter([*judged, *words, *known, *rig.controls, *CONTROL_NAMES]))
        words.pop(first, None)
        return {Part(first): records}, tuple(words.values())
    first = next(iter(judged))
    parts: dict[Part, Records] = {
        Part(name, airframe=False): ours for name, ours in judged.items() if name != first
    }
    flown = rig.flight is not None
    if flown and any(all(n in one for n in needs(rig, one)) for one in records.values()):
        parts[Part(first, own=False)] = records
        flown = False
    # An airframe that cannot be judged is listed with the first control, and what it lacks.
    return {Part(first, airframe=flown): judged[first], **parts}, tuple(words.values())


def moves(rig: Rig, record: Record, control: ControlName) -> bool:
    """Tell whether a record has a control of a rig, and moves it by more than noise."""
    least = TINY * rig.controls[control].travel
    return any(_beyond_noise(signal, least) for signal in _way(record, control))


def _way(record: Record, control: ControlName) -> list[Floats]:
    names = (channel(control, quantity) for quantity in ("computed", "deflection", "estimate"))
    return [record[name] for name in names if name in record]


def _judges(rig: Rig, records: Records, control: ControlName) -> bool:
    """Tell whether some of the records have the channels of a stage of a control."""
    readings = (Reading(rig, one, control, surface_points) for one in records.values())
    return any({*STAGES} - {AIRFRAME, "sensing"} - one.missing().keys() for one in readings)


def _why_not(control: ControlName, moved: bool) -> str:
    """Return why a control on which a force acts is not judged."""
    be, they = ("are", "them") if control == "pedals" else ("is", "it")
    why = "the records lack its channels" if moved else f"no record moves {they}"
    return f"The {control} {be} not judged: {why}."


def _pulled(record: Record, control: ControlName) -> bool:
    """Tell whether a force acts on a control whose motion is recorded."""
    name = channel(control, "force")
    return name in record and bool(_way(record, control)) and _beyond_noise(record[name])


def _beyond_noise(signal: Floats, least: float = 0.0) -> bool:
    """Tell whether the standard deviation of a signal is well above its noise, and above `least`.

    Also true of a signal that holds no number, since the record is then refused with the row.
    """
    if not np.all(np.isfinite(signal)):
        return True
    spread = float(np.std(signal))
    if len(signal) < 5 or spread <= least:
        return False
    return spread > DOUBLED * estimate_noise(signal).rms
