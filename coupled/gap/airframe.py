"""The airframe's residuals: the JSBSim model, driven from trim by the measured surface.

The surface's position is taken back to the command that the model's own map needs for it, and
the model is flown by that, open loop. Pitch rate, angle of attack and load factor are compared:
they hold up, since what they owe to the elevator fades within seconds; attitude, speed and
height integrate every small error and are left to the kinematics.

How the air moves is told by kinematics alone, without any aerodynamics,

    w = ḣ − V·sin(θ − α),

with ḣ from the load factor, held to the altitude. The model is then flown through that air: a
gust is believed where the *pitch rate* follows it, which had no part in finding it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from coupled.channels import LONGITUDINAL
from coupled.flight.airframe import SPEED, JSBSimAirframe
from coupled.flight.altered import UNALTERED
from coupled.gap.output import Output, white
from coupled.gap.smooth import smoothed
from coupled.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight, Rig

Floats = NDArray[np.float64]
RATE, ALPHA, LOAD = "pitch_rate_rad_per_s", "alpha_rad", "load_factor"
COMPARED = (RATE, ALPHA, LOAD)
NEEDS = ("elevator_rad", RATE)
AIR_NEEDS = (ALPHA, "pitch_rad", "true_airspeed_m_per_s", "altitude_m")
GRAVITY_m_per_s2 = 9.80665
ROUGH = 0.25  # of the air's own noise, for the smoother's error on air that is not smooth
_KEPT = 4  # flights remembered


def vertical_air(record: Record, frame_s: float) -> Floats | None:
    """Return how fast the air rises in m/s at each frame, or None where channels lack."""
    rough = _rough_air(record, frame_s)
    return None if rough is None else smoothed(rough)


def _air(record: Record, frame_s: float) -> tuple[Floats | None, float]:
    """Return the air as told, and its rms, m/s: the rough one's less its noise.

    The smoother takes some of a faint gust with the noise, which its own rms would miss.
    """
    rough = _rough_air(record, frame_s)
    if rough is None:
        return None, 0.0
    calm = smoothed(rough)
    true = max(float(np.var(rough)) - white(rough) ** 2, float(np.var(calm)))
    return calm, math.sqrt(true)


def _rough_air(record: Record, frame_s: float) -> Floats | None:
    if any(name not in record for name in AIR_NEEDS):
        return None
    alpha, pitch, speed, height = (record[name] for name in AIR_NEEDS)
    path = pitch - alpha
    calm_speed = smoothed(speed)
    time = np.arange(len(height)) * frame_s
    if LOAD in record:
        along = np.gradient(calm_speed, frame_s) + GRAVITY_m_per_s2 * np.sin(smoothed(path))
        lift = record[LOAD] * np.cos(pitch) * GRAVITY_m_per_s2
        climbs = np.cumsum(lift + along * np.sin(pitch) - GRAVITY_m_per_s2) * frame_s
        rises = np.cumsum(climbs) * frame_s
        # What is left to the altitude is drift: slow, and well told by a low polynomial.
        drift = Polynomial.fit(time, height - rises, 6)
        climb = climbs + drift.deriv()(time)
    else:
        climb = np.gradient(smoothed(height), frame_s)
    return np.asarray(climb - calm_speed * np.sin(path))


@dataclass
class Model:
    """The aircraft of one record, flown by its measured surface; remembers its last flights."""

    rig: Rig
    elevator: Floats
    points: tuple[Floats, Floats]
    air: Floats | None
    air_rms: float  # m/s
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

    def fly(self, flight: Flight, elevator: Floats, error: Floats | None = None) -> Floats:
        """Return the motion while the elevator stands as given, rad.

        `error` in m/s is added to what the air does.
        """
        commands, positions = self.points
        order = np.argsort(positions)
        wanted = np.interp(elevator, positions[order], commands[order])
        still = flight.model_copy(update={"gust_rms": 0.0})
        air = None
        if flight.gust_rms > 0.0 and self.air is not None and self.air_rms > 0.0:
            moves = self.air * (flight.gust_rms / self.air_rms) + (0.0 if error is None else error)
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
    air, air_rms = _air(record, 1.0 / rig.frame_rate)
    model = Model(rig, calm, surface_points(rig), air, air_rms)
    flown = model.motion(rig)
    rng = np.random.default_rng(43)
    hiss = smoothed(calm + rng.normal(0.0, level, len(calm)))
    error = None if model.air is None else _error_of_air(rig, record, model.air, rng)
    carried = np.sqrt(np.mean((model.fly(rig.flight, hiss, error) - flown) ** 2, axis=0))
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


def _error_of_air(rig: Rig, record: Record, air: Floats, rng: np.random.Generator) -> Floats:
    """Return a realisation of what noise and smoothing do to the air as told, m/s."""
    rough = _rough_air(record, 1.0 / rig.frame_rate)
    assert rough is not None
    hiss = rng.normal(0.0, white(rough), len(air))
    return smoothed(air + hiss) - air + ROUGH * hiss


def spread_of_air(record: Record, frame_s: float) -> float:
    """Return the relative standard error of the gusts' rms, from how few of them a record meets.

    The variance of a Gaussian process is told by N/(Σρ²) independent samples (Bartlett).
    """
    air = vertical_air(record, frame_s)
    if air is None:
        return 0.0
    x = air - air.mean()
    power = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    correlation = np.fft.irfft(power)[: len(x) // 4] / float(x @ x)
    independent = len(x) / (1.0 + 2.0 * float(np.sum(correlation[1:] ** 2)))
    return float(np.sqrt(0.5 / max(independent, 1.0)))


def can_tell_air(records: Sequence[Record]) -> bool:
    """Tell whether the records have what the kinematics of the air need."""
    return all(name in record for record in records for name in AIR_NEEDS)


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
