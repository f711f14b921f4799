"""Recorder: channels of a record with late or early time stamps, and with wrong zeros.

A channel stamped late has earlier values; between frames they are interpolated by the cubic through
the four nearest. The host is not affected. Before the first frame and after the last a channel is
constant.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ELEVATOR, PRESSURE, channel, motion_channels
from coupled.rig.compiled import long_entry
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
# The channels of the motion that may read other than 0 at zero, and the fields of their readings.
ZEROS: Mapping[str, str] = {
    "elevator_rad": "elevator_zero",
    "alpha_rad": "alpha_zero",
    "sideslip_rad": "sideslip_zero",
    "pitch_rad": "pitch_zero",
    "load_factor": "load_factor_zero",
    "pitch_rate_rad_per_s": "pitch_rate_zero",
    "roll_rate_rad_per_s": "roll_rate_zero",
    "yaw_rate_rad_per_s": "yaw_rate_zero",
}


def zero_of(flight: Flight, channel: str) -> float:
    """Return the reading of a channel of the motion at zero, SI."""
    return float(getattr(flight, ZEROS[channel])) if channel in ZEROS else 0.0


def stamped(signal: Floats, late: float) -> Floats:
    """Return a signal as recorded, stamped `late` frames late; shape (frames,), four or more."""
    if late == 0.0:
        return signal
    given = np.ascontiguousarray(signal, dtype=np.float64)
    return _moved(given, late, np.empty_like(given))


@long_entry
def _moved(signal: Floats, late: float, out: Floats) -> Floats:
    """Return a signal delayed by `late` frames."""
    last = len(signal) - 1
    for i in range(last + 1):
        at = min(max(i - late, 0.0), float(last))
        k = min(max(int(at), 1), last - 2)
        u = at - k
        out[i] = (
            -u * (u - 1.0) * (u - 2.0) / 6.0 * signal[k - 1]
            + (u + 1.0) * (u - 1.0) * (u - 2.0) / 2.0 * signal[k]
            - (u + 1.0) * u * (u - 2.0) / 2.0 * signal[k + 1]
            + (u + 1.0) * u * (u - 1.0) / 6.0 * signal[k + 2]
        )
    return out


def moved_channels(controls: Sequence[str]) -> tuple[str, ...]:
    """Return the channels of the aircraft's motion except q̄ and surfaces."""
    every = motion_channels(controls, flown=True)
    return tuple(
        name
        for i, name in enumerate(every)
        if i not in (PRESSURE, ELEVATOR) and name not in ("aileron_rad", "rudder_rad")
    )


def lateness(rig: Rig) -> dict[str, float]:
    """Return the delay of each channel's stamps, frames, if not zero."""
    late: dict[str, float] = {}
    for name, control in rig.controls.items():
        late[channel(name, "force")] = control.sensing.force_stamp * rig.frame_rate
    if rig.flight is not None:
        moved = moved_channels([str(name) for name in rig.controls])
        late |= dict.fromkeys(moved, rig.flight.motion_stamp * rig.frame_rate)
    return {name: frames for name, frames in late.items() if frames != 0.0}


def is_exact(rig: Rig) -> bool:
    """Tell whether the recorder changes no channel."""
    zeros = [] if rig.flight is None else [zero_of(rig.flight, name) for name in ZEROS]
    return not any(zeros) and not lateness(rig)


def stamp(rig: Rig, channels: Sequence[str], data: Floats, noise: Floats) -> None:
    """Stamp a record's channels, shape (frames, channels), in place, without their noise.

    The readings at zero are added.
    """
    for at, name in enumerate(channels if rig.flight is not None else ()):
        assert rig.flight is not None
        data[:, at] += zero_of(rig.flight, name)
    for name, late in lateness(rig).items():
        at = channels.index(name)
        data[:, at] = stamped(data[:, at] - noise[:, at], late) + noise[:, at]
