"""Speed and pitch attitude by multiple shooting: short flights restarted from the measured state.

Speed and attitude integrate every small error, so that an open-loop flight drifts away from the
record. The model is therefore restarted every few seconds from the measured speed, flow angles,
rates, attitude and altitude (Jategaonkar 2015; Klein and Morelli 2016). Within a segment drag,
thrust and the phugoid show. Engines and control laws are not restarted: their inputs are known.
States that are not recorded stay those of the model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.output import Floats, estimate_noise
from coupled.gap.thresholds import NEGLIGIBLE, SHORTEST_RECORD_s
from coupled.record.record import Record
from coupled.rig.recorder import stamped

States = Mapping[int, Mapping[str, float]]  # by row: the measured states, by channel
SLOW = ("true_airspeed_m_per_s", "pitch_rad")
NEEDS = (*SLOW, "alpha_rad", "pitch_rate_rad_per_s")
BESIDE = (
    *("sideslip_rad", "roll_rate_rad_per_s", "yaw_rate_rad_per_s"),
    *("roll_rad", "heading_rad", "altitude_m"),
)


@dataclass(frozen=True)
class Restarts:
    """The measured states of a record, by channel: as recorded, and smoothed."""

    recorded: Mapping[str, Floats]
    smooth: Mapping[str, Floats]
    every: int  # frames

    @classmethod
    def of(cls, record: Record, frame_rate_Hz: float) -> Restarts | None:
        """Return the restarts of a record; None if it lacks a channel or does not last for two."""
        every = round(SHORTEST_RECORD_s * frame_rate_Hz)
        if lacking(record) or len(record) <= every:
            return None
        names = (*NEEDS, *(one for one in BESIDE if one in record))
        read = {name: record[name] for name in names}
        if "heading_rad" in read:
            read["heading_rad"] = np.unwrap(read["heading_rad"])
        return cls(read, {name: smoothed(values) for name, values in read.items()}, every)

    def at(self, late: float = 0.0) -> States:
        """Return the states at the restarts; the motion is stamped so many frames `late`."""
        return self.rows({name: stamped(x, -late) for name, x in self.smooth.items()})

    def wrong(self, sample: int) -> States:
        """Return the states with a sample of their error, by its number."""
        rng = np.random.default_rng([53, sample])
        found = dict[str, Floats]()
        for name, read in self.recorded.items():
            noise = estimate_noise(read)
            error = Smoother.of(read).wiener_error(noise, len(read), rng)
            found[name] = self.smooth[name] + error
        return self.rows(found)

    def rows(self, each: Mapping[str, Floats]) -> States:
        """Return the states of some channels at the restarts."""
        rows = range(self.every, len(each[NEEDS[0]]), self.every)
        return {row: {name: float(values[row]) for name, values in each.items()} for row in rows}


def lacking(record: Record) -> tuple[str, ...]:
    """Return the channels that a record lacks to judge speed and attitude."""
    return tuple(name for name in NEEDS if name not in record)


def is_throttled(record: Record) -> bool:
    """Tell whether a throttle moves in a record; that of the model stays as in trim."""
    throttles = (record[name] for name in record.channels if "throttle" in name)
    return any(float(np.ptp(one)) > NEGLIGIBLE for one in throttles)


def not_judged(records: Sequence[Record]) -> str:
    """Return what the records do not show of the airframe, in a sentence; empty if one does."""
    if all(map(is_throttled, records)):
        return (
            "The throttle moves, and the model's stays as in trim: speed and attitude, which show "
            "drag and thrust, cannot be judged."
        )
    each = [lacking(record) for record in records]
    if not all(each):
        return ""
    fewest: tuple[str, ...] = min(each, key=len)
    names = ", ".join(fewest)
    return f"Without {names} speed and attitude are not judged, which show drag and thrust."
