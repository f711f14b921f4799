"""The airframe's residual: the JSBSim model, driven by the measured surface.

The surface's position is taken back to the command that the model's own map needs for it,
and the model is flown by that from trim. Pitch rate is compared: it is what the elevator
works on, and drifts least. A gust is not tried yet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.channels import LONGITUDINAL
from coupled.flight.airframe import JSBSimAirframe
from coupled.gap.smooth import smoothed
from coupled.gap.stages import Output, white
from coupled.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight, Rig

Floats = NDArray[np.float64]
RATE = "pitch_rate_rad_per_s"
NEEDS = ("elevator_rad", RATE)


def airframe_output(rig: Rig, record: Record) -> Output | None:
    """Return the airframe's output, or None for a bench or where its channels lack."""
    if rig.flight is None or any(name not in record for name in NEEDS):
        return None
    elevator, rate = record["elevator_rad"], record[RATE]
    level, calm = white(elevator), smoothed(elevator)
    points = surface_points(rig)  # the surface stands where it stands, whatever it does
    flown = _fly(rig, calm, points)
    noise = np.random.default_rng(43).normal(0.0, level, len(calm))
    carried = _fly(rig, smoothed(calm + noise), points) - flown
    floor = float(np.hypot(white(rate), np.sqrt(np.mean(carried**2))))
    nominal = rig.flight
    known: list[tuple[Flight, Floats]] = [(nominal, flown)]

    def predict(changed: Rig) -> Floats:
        # The loader's fits ask with the same aircraft again and again: fly it once.
        for flight, rates in known:
            if flight == changed.flight:
                return rates
        rates = _fly(changed, calm, points)
        known[1:] = [(changed.flight or nominal, rates)]
        return rates

    return Output("airframe", RATE, rate, predict, floor)


def _fly(rig: Rig, elevator: Floats, points: tuple[Floats, Floats]) -> Floats:
    """Return the pitch rate of the model while its elevator stands as given, rad/s."""
    assert rig.flight is not None
    frame_s = 1.0 / rig.frame_rate
    commands, positions = points
    order = np.argsort(positions)
    wanted = np.interp(elevator, positions[order], commands[order])
    airframe = JSBSimAirframe(rig.flight, frame_s, ["column"], [aircraft_folder()])
    at = LONGITUDINAL.index(RATE)
    rates = np.empty(len(elevator))
    for k in range(len(elevator)):
        rates[k] = airframe.motion()[at]
        # Row k + 1 is the answer to the command of row k.
        airframe.step((float(wanted[min(k + 1, len(wanted) - 1)]), 0.0, 0.0))
    return rates


def surface_points(rig: Rig) -> tuple[Floats, Floats]:
    """Return commands about trim, and the elevator's positions that the model gives them, rad."""
    assert rig.flight is not None
    flight = rig.flight.model_copy(update={"elevator_effectiveness": 1.0, "pitch_damping": 1.0})
    frame_s = 1.0 / rig.frame_rate
    return JSBSimAirframe(flight, frame_s, ["column"], [aircraft_folder()]).surface_map()
