"""Frames that the host missed: all of its outputs repeat.

A host that misses a frame holds δ̂ and G_T. Rounded values also repeat by chance. A repeat
therefore counts only if G_T never repeats otherwise, or if δ̂ differs from the host's equation,
δc + ΣK̂·F, fitted to the other frames.

The host misses frames at random. For replays each frame has a number from 0 to 1, and is missed if
that is below the rig's share, as in a flight (`rig/compensation`). The numbers are assigned so that
the record's share gives the record's missed frames.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import FAR_SIGMAS, FEW, MORE
from coupled.record.channels import CONTROL_NAMES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Missed:
    """The missed frames of a record, shape (frames,), and those of a rig with another share."""

    seen: Mask

    @property
    def share(self) -> float:
        """The share of missed frames."""
        return float(np.mean(self.seen))

    def under(self, rig: Rig, control: ControlName) -> Mask | None:
        """Return the frames that a rig's host would miss; None if it misses none."""
        share = rig.controls[control].compensation.missed_share
        if share == 0.0:
            return None
        rng, frames = np.random.default_rng(17), len(self.seen)
        missed = rng.permutation(np.flatnonzero(self.seen))
        others = rng.permutation(np.flatnonzero(~self.seen[1:]) + 1)
        chances = np.ones(frames)  # the first frame is never missed
        chances[np.concatenate((missed, others))] = (np.arange(frames - 1) + 0.5) / frames
        return np.asarray(chances < share)


def missed_in(record: Record) -> Missed:
    """Return the frames that a record's host missed, from all of its controls."""
    estimates = _channels(record, "estimate")
    gradients = _channels(record, "gradient")
    frames = len(record)
    both = np.ones(frames, dtype=bool)
    for name in (*estimates, *gradients):
        both &= _repeats(record[name])
    if not (estimates or gradients) or not both.any():
        return Missed(np.zeros(frames, dtype=bool))
    lively = [name for name in gradients if _lively(record[name], both)]
    if estimates and not lively:
        both &= _off_arithmetic(record, both)
    elif not lively:
        both[:] = False
    return Missed(both)


def shares_missed(
    outputs: Sequence[Output], rig: Rig, control: ControlName
) -> list[dict[str, float]]:
    """Return the share of missed frames in the records of these outputs; empty if zero."""
    by_record = {output.record: output.missed for output in outputs if output.missed is not None}
    seen = np.concatenate([*by_record.values(), np.zeros(0, dtype=bool)])
    return [{"share": float(np.mean(seen))}] if seen.any() else []


def times_missed(record: Record) -> Floats:
    """Return the times of the missed frames, in s from the record's start."""
    return np.asarray((record.time_s - record.time_s[0])[missed_in(record).seen])


def spread_of_missed(rig: Rig, record: Record) -> float:
    """Return the relative sampling error of the share of missed frames, √((1 − share)/n) of n."""
    missed = missed_in(record)
    count = int(np.sum(missed.seen))
    return math.sqrt((1.0 - missed.share) / count) if count else 0.0


def _channels(record: Record, quantity: str) -> list[str]:
    names = [channel(control, quantity) for control in CONTROL_NAMES]
    return [name for name in names if name in record]


def _repeats(signal: Floats) -> Mask:
    """Return which frames repeat the previous one."""
    return np.concatenate(([False], np.diff(signal) == 0.0))


def _lively(gradient: Floats, both: Mask) -> bool:
    """Tell whether a gradient repeats only in missed frames, and its steps exceed its rounding."""
    moves = np.abs(np.diff(gradient))
    moves = moves[moves > 0.0]
    if not moves.size or moves.min() > FEW * np.median(moves):
        return False
    return int(np.sum(_repeats(gradient))) <= MORE * int(np.sum(both)) + 1


def _off_arithmetic(record: Record, both: Mask) -> Mask:
    """Return the frames in which a control's δ̂ differs from the host's equation."""
    off = np.zeros(len(record), dtype=bool)
    forces = [record[name] for name in _channels(record, "force")]
    for control in CONTROL_NAMES:
        computed, estimate = (channel(control, q) for q in ("computed", "estimate"))
        if computed not in record or estimate not in record:
            continue
        bent = record[estimate] - record[computed]
        columns = np.column_stack((np.ones(len(record)), *forces))
        fresh = ~both
        left = bent - columns @ np.linalg.lstsq(columns[fresh], bent[fresh], rcond=None)[0]
        usual = float(np.median(np.abs(left[fresh])))
        off |= np.abs(left) > FAR_SIGMAS * max(usual, 1e-12)
    return off
