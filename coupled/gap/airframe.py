"""The airframe's residuals: the JSBSim model, driven from trim by the measured surfaces.

The surfaces' positions are taken back to commands (`surfaces`), and the model flown by those, open
loop. The rates, angle of attack, sideslip and load factor are compared: they hold up, since
what they owe to the surfaces fades within seconds; attitude, speed and height integrate every small
error and are left to the kinematics. How the air moved is found by `air`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from coupled.flight.aircraft import make_aircraft
from coupled.flight.gusts import Gusts
from coupled.gap.air import Air, vertical_air
from coupled.gap.output import Output, spread, white
from coupled.gap.surfaces import commands, surface_channel
from coupled.gap.thresholds import FLIGHT_KNOWN, LOST_MOTION
from coupled.record.channels import SPEED, motion_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.recorder import stamped
from coupled.rig.rig import Rig
from coupled.schema import changed

Floats = NDArray[np.float64]
RATE = "pitch_rate_rad_per_s"
COMPARED = (
    RATE,
    "alpha_rad",
    "load_factor",
    "roll_rate_rad_per_s",
    "yaw_rate_rad_per_s",
    "sideslip_rad",
)
_KEPT = 4  # flights remembered


@dataclass
class Model:
    """The aircraft of one record, flown by its surfaces; remembers its last flights."""

    rig: Rig
    commands: Floats  # about trim, shape (frames, 3)
    compared: tuple[str, ...]
    air: Air | None
    _flown: list[tuple[Flight, Floats]] = field(default_factory=list)

    def motion(self, rig: Rig) -> Floats:
        """Return the compared channels as `rig` has them, shape (frames, channels)."""
        flight = rig.flight
        assert flight is not None
        flight = changed(flight, {"motion_stamp_s": 0.0}, self.rig.name, "flight")
        for known, flown in self._flown:
            if known == flight:
                return flown
        flown = self.fly(flight, self.commands)
        self._flown[:] = [*self._flown[1 - _KEPT :], (flight, flown)]
        return flown

    def fly(self, flight: Flight, asked: Floats, with_error: bool = False) -> Floats:
        """Return the motion that the surfaces' commands make.

        `with_error` adds to the air a sample of its error.
        """
        still = changed(flight, {"gust_rms_m_per_s": 0.0}, self.rig.name, "flight")
        air = None
        if flight.gust_rms > 0.0 and self.air is not None and self.air.rms > 0.0:
            moves = self.air.speed * (flight.gust_rms / self.air.rms)
            moves = moves + self.air.error if with_error else moves
            air = (*moves[1:].tolist(), 0.0)  # row k + 1 holds the air over the frame before
        frame_s, controls = 1.0 / self.rig.frame_rate, list(self.rig.controls)
        gusts = Gusts(still, frame_s, air_m_per_s=air)
        airframe = make_aircraft(still, frame_s, controls, [aircraft_folder()], gusts=gusts)
        every = motion_channels(controls, flown=True)
        at = [every.index(name) for name in self.compared]
        motion = np.full((len(asked), len(at)), np.nan)
        rows = [(a, b, c) for a, b, c in asked.tolist()]
        for k in range(len(rows)):
            now = airframe.motion()
            motion[k] = [now[i] for i in at]
            if not math.isfinite(motion[k, 0]) or abs(motion[k, 0]) > LOST_MOTION:
                motion[k:] = motion[max(k - 1, 0)]
                break
            # Row k + 1 is the answer to the command of row k.
            airframe.step(rows[min(k + 1, len(rows) - 1)])
        return motion


def needs(rig: Rig) -> tuple[str, ...]:
    """Return the channels without which the airframe cannot be judged."""
    return (RATE, surface_channel("column")) if "column" in rig.controls else (RATE,)


def airframe_outputs(rig: Rig, record: Record, number: int = 0) -> list[Output]:
    """Return the airframe's outputs; none for a bench or where its channels lack."""
    if rig.flight is None or any(name not in record for name in needs(rig)):
        return []
    known = motion_channels(list(rig.controls), flown=True)
    compared = tuple(n for n in COMPARED if n in known and n in record and np.ptp(record[n]) > 0.0)
    rng = np.random.default_rng(43)
    given, wrong = commands(rig, record, rng)
    model = Model(rig, given, compared, vertical_air(record, 1.0 / rig.frame_rate))
    flown = model.motion(rig)
    carried = model.fly(rig.flight, wrong, with_error=True) - flown
    outputs = []
    for i, name in enumerate(compared):
        own = float(np.hypot(white(record[name]), FLIGHT_KNOWN * np.ptp(record[name])))
        floor = float(np.hypot(own, np.sqrt(np.mean(carried[:, i] ** 2))))
        loose = spread([carried[:, i]], own)

        def predict(other: Rig, i: int = i) -> Floats:
            assert other.flight is not None
            late = other.flight.motion_stamp * other.frame_rate
            return stamped(np.asarray(model.motion(other)[:, i]), late)

        outputs.append(
            Output("airframe", name, record[name], predict, floor, rig.frame_rate, number, loose)
        )
    return outputs


def trim_speed(rig: Rig) -> float:
    """Return the true airspeed at which the rig's aircraft is trimmed, m/s."""
    assert rig.flight is not None
    frame_s = 1.0 / rig.frame_rate
    airframe = make_aircraft(rig.flight, frame_s, ["column"], [aircraft_folder()])
    return airframe.motion()[SPEED]
