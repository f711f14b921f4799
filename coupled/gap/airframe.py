"""The airframe's residuals: the JSBSim model, driven from trim by the measured surface.

The surface's position is taken back to the command that the model's own map needs for it, and
the model is flown by that, open loop. Pitch rate, angle of attack and load factor are compared:
they hold up, since what they owe to the elevator fades within seconds; attitude, speed and
height integrate every small error and are left to the kinematics.
How the air moved over them, `air` tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from coupled.channels import LONGITUDINAL
from coupled.flight.airframe import SPEED, JSBSimAirframe
from coupled.flight.altered import UNALTERED
from coupled.gap.air import LOAD, Air, vertical_air
from coupled.gap.output import Output, white
from coupled.gap.smooth import smoothed
from coupled.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight, Rig

Floats = NDArray[np.float64]
RATE, ALPHA = "pitch_rate_rad_per_s", "alpha_rad"
COMPARED = (RATE, ALPHA, LOAD)
NEEDS = ("elevator_rad", RATE)
_KEPT = 4  # flights remembered


@dataclass
class Model:
    """The aircraft of one record, flown by its measured surface; remembers its last flights."""

    rig: Rig
    elevator: Floats
    points: tuple[Floats, Floats]
    air: Air | None
    _flown: list[tuple[Flight, Floats]] = field(default_factory=list)

    def motion(self, rig: Rig) -> Floats:
        """Return the compared channels as `rig` has them, shape (frames, 3)."""
        flight = rig.flight
        assert flight is not None
        for known, flown in self._flown:
            if known == flight:
                return flown
        flown = self.fly(flight, self.elevator)
        self._flown[:] = [*self._flown[1 - _KEPT :], (flight, flown)]
        return flown

    def fly(self, flight: Flight, elevator: Floats, astray: bool = False) -> Floats:
        """Return the motion while the elevator stands as given, rad.

        `astray` adds to the air what is wrong with it.
        """
        commands, positions = self.points
        order = np.argsort(positions)
        wanted = np.interp(elevator, positions[order], commands[order])
        still = flight.model_copy(update={"gust_rms": 0.0})
        air = None
        if flight.gust_rms > 0.0 and self.air is not None and self.air.rms > 0.0:
            moves = self.air.speed * (flight.gust_rms / self.air.rms)
            moves = moves + self.air.error if astray else moves
            air = (*moves[1:].tolist(), 0.0)  # row k + 1 tells of the air over the frame before
        frame_s = 1.0 / self.rig.frame_rate
        airframe = JSBSimAirframe(still, frame_s, ["column"], [aircraft_folder()], air_m_per_s=air)
        at = [LONGITUDINAL.index(name) for name in COMPARED]
        motion = np.full((len(elevator), len(COMPARED)), np.nan)
        for k in range(len(elevator)):
            now = airframe.motion()
            motion[k] = [now[i] for i in at]
            if not math.isfinite(motion[k, 0]) or abs(motion[k, 0]) > 20.0:
                motion[k:] = motion[max(k - 1, 0)]
                break
            # Row k + 1 is the answer to the command of row k.
            airframe.step((float(wanted[min(k + 1, len(wanted) - 1)]), 0.0, 0.0))
        return motion


def airframe_outputs(rig: Rig, record: Record, number: int = 0) -> list[Output]:
    """Return the airframe's outputs; none for a bench or where its channels lack."""
    if rig.flight is None or any(name not in record for name in NEEDS):
        return []
    elevator = record["elevator_rad"]
    level, calm = white(elevator), smoothed(elevator)
    model = Model(rig, calm, surface_points(rig), vertical_air(record, 1.0 / rig.frame_rate))
    flown = model.motion(rig)
    rng = np.random.default_rng(43)
    hiss = smoothed(calm + rng.normal(0.0, level, len(calm)))
    carried = np.sqrt(np.mean((model.fly(rig.flight, hiss, astray=True) - flown) ** 2, axis=0))
    outputs = []
    for i, name in enumerate(COMPARED):
        if name not in record or np.ptp(record[name]) == 0.0:
            continue
        floor = float(np.hypot(white(record[name]), carried[i]))

        def predict(changed: Rig, i: int = i) -> Floats:
            return np.asarray(model.motion(changed)[:, i])

        outputs.append(
            Output("airframe", name, record[name], predict, floor, rig.frame_rate, number)
        )
    return outputs


def trim_speed(rig: Rig) -> float:
    """Return the true airspeed at which the rig's aircraft is trimmed, m/s."""
    assert rig.flight is not None
    frame_s = 1.0 / rig.frame_rate
    airframe = JSBSimAirframe(rig.flight, frame_s, ["column"], [aircraft_folder()])
    return airframe.motion()[SPEED]


def surface_points(rig: Rig) -> tuple[Floats, Floats]:
    """Return commands about trim, and the elevator's positions that the model gives them, rad."""
    assert rig.flight is not None
    flight = rig.flight.model_copy(update=UNALTERED)
    frame_s = 1.0 / rig.frame_rate
    return JSBSimAirframe(flight, frame_s, ["column"], [aircraft_folder()]).surface_map()
