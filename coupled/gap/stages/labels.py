"""Channels of the motion that have the opposite sign, or are exchanged for another.

Where the model predicts a channel worse than rest does, it is flown again beside the record with
each channel reversed, and with each two of a kind exchanged. If several surfaces turn
the aircraft, a rate does not show the sign of one of them.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np

from coupled.errors import InputError
from coupled.gap.signals.output import Floats, Output
from coupled.gap.signals.reading import Reading
from coupled.gap.stages.airframe import COMPARED, gusts_of
from coupled.gap.stages.surfaces import surface_channel
from coupled.gap.thresholds import LESSER
from coupled.record.channels import CONTROL_NAMES, RATE
from coupled.record.record import Record
from coupled.rig.rig import Rig

_KINDS = (
    tuple(map(surface_channel, CONTROL_NAMES)),
    tuple(RATE.values()),
    ("alpha_rad", "sideslip_rad"),
)


def check_labels(
    outputs: Sequence[Output], readers: Sequence[Reading], files: Collection[str]
) -> None:
    """Raise InputError if a reversed channel, or two exchanged ones, explain a record's gap.

    Then, corrected, the model predicts each channel better than rest does, and the gap is small.
    """
    for reader, file in zip(readers, files, strict=True):
        own = [one for one in outputs if one.record == reader.number and one.channel in COMPARED]
        _check(reader.rig, reader.record, {one.channel: one for one in own}, file)


def _check(rig: Rig, record: Record, judged: Mapping[str, Output], file: object) -> None:
    before = {name: one.residual(rig) for name, one in judged.items()}
    if not _is_beyond_motion(before, judged):
        return
    for name, problem, changed in _relabelled(record):
        after = _residuals(rig, changed, judged)
        gone = _rms(after) < LESSER * _rms(before)
        if gone and not _is_beyond_motion(after, judged):
            raise InputError(file, name, f"{problem}? So read, the record fits {rig.name}")


def _relabelled(record: Record) -> Iterator[tuple[str, str, Record]]:
    """Return each channel that may be wrong, the question about it, and the record corrected."""
    at = {name: i for i, name in enumerate(record.channels)}
    for kind in _KINDS:
        names = [name for name in kind if name in record]
        for name in names:
            signs = np.ones(len(at))
            signs[at[name]] = -1.0
            yield name, "is its sign reversed", replace(record, data=record.data * signs)
        for first, second in combinations(names, 2):
            order = list(range(len(at)))
            order[at[first]], order[at[second]] = at[second], at[first]
            changed = replace(record, data=record.data[:, order])
            yield first, f"is it exchanged with {second}", changed


def _residuals(rig: Rig, record: Record, judged: Mapping[str, Output]) -> dict[str, Floats]:
    """Return the residuals of a record's channels, in the floors of the judged outputs."""
    model = gusts_of(rig, record)
    assert model is not None and rig.flight is not None  # the airframe of the record is judged
    motion = model.fly(rig.flight, model.moved, channels=tuple(judged)).motion
    return {
        name: (record[name] - motion[:, i]) / judged[name].floor for i, name in enumerate(judged)
    }


def _is_beyond_motion(residuals: Mapping[str, Floats], judged: Mapping[str, Output]) -> bool:
    """Tell whether a residual varies more than its channel does."""
    return any(
        float(np.std(left)) * judged[name].floor > judged[name].does
        for name, left in residuals.items()
    )


def _rms(residuals: Mapping[str, Floats]) -> float:
    return float(np.sqrt(np.mean([np.mean(left**2) for left in residuals.values()])))
