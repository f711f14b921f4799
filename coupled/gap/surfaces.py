"""The commands of the airframe's surfaces, taken back from their recorded positions.

Each model has a map of its own from command to position, found by flying it. A surface that the
aircraft moves itself (a yaw damper) stands where its motion wants it, too: what was commanded is
then the host's own command, and the surface cannot be judged by it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import UNALTERED
from coupled.gap.output import heard
from coupled.gap.smooth import Smoother, smoothed
from coupled.gap.thresholds import SURFACE_SHAKE, SURFACE_MOVES_rad, SURFACE_SHAKE_s
from coupled.record.channels import SURFACES, ControlName, channel, motion_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.replay import replay_surface
from coupled.rig.rig import Rig
from coupled.rig.serving import service_rows
from coupled.schema import changed

Floats = NDArray[np.float64]
Points = tuple[Floats, Floats]


def surface_channel(control: ControlName) -> str:
    """Return the channel of the surface that a control moves."""
    return f"{SURFACES[control]}_rad"


def surface_points(rig: Rig, control: ControlName) -> Points | None:
    """Return commands about trim, and a surface's positions that the model gives them, rad.

    None where the aircraft moves the surface by laws of its own.
    """
    assert rig.flight is not None
    plain = changed(rig.flight, UNALTERED, rig.name, "flight")
    return _points(plain.model_dump_json(), tuple(rig.controls), rig.frame_rate, control)


@lru_cache(maxsize=64)
def _points(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, control: ControlName
) -> Points | None:
    plain = Flight.model_validate_json(flight)

    def model() -> JSBSimAirframe:
        return make_aircraft(plain, 1.0 / rate_Hz, controls, [aircraft_folder()])

    if _moves_itself(model(), controls, rate_Hz, control):
        return None
    return model().surface_map(surface_channel(control))


def _moves_itself(
    airframe: JSBSimAirframe, controls: Sequence[ControlName], rate_Hz: float, control: ControlName
) -> bool:
    """Tell whether the aircraft moves a control's surface while the others are moved."""
    at = motion_channels(controls, flown=True).index(surface_channel(control))
    still, moved = airframe.motion()[at], 0.0
    for i, other in enumerate(controls):
        if other == control:
            continue
        for _ in range(round(SURFACE_SHAKE_s * rate_Hz)):
            airframe.step(
                (
                    SURFACE_SHAKE * (i == 0),
                    SURFACE_SHAKE * (i == 1),
                    SURFACE_SHAKE * (i == 2),
                )
            )
            moved = max(moved, abs(airframe.motion()[at] - still))
    return moved > SURFACE_MOVES_rad


def command_of(position: Floats, points: Points) -> Floats:
    """Return the command about trim at which a surface stands so, same shape."""
    commands, positions = points
    order = np.argsort(positions)
    return np.interp(position, positions[order], commands[order])


def commands(rig: Rig, record: Record, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return the surfaces' commands, shape (frames, 3), and the same with a sample of their error.

    In the order of the rig's controls, about trim. Row k holds what row k answers to. A control
    that the record knows nothing of is taken to have been left alone.
    """
    found = np.zeros((len(record), 3))
    wrong = np.zeros_like(found)
    for i, control in enumerate(rig.controls):
        name, points = surface_channel(control), surface_points(rig, control)
        if name not in record or points is None:
            found[:, i] = wrong[:, i] = _asked(rig, record, control)
            continue
        position = record[name]
        level, smooth = heard(position), smoothed(position)
        error = Smoother.of(position).wiener_error(level, len(smooth), rng)
        found[:, i], wrong[:, i] = command_of(smooth, points), command_of(smooth + error, points)
    return found, wrong


def _asked(rig: Rig, record: Record, control: ControlName) -> Floats:
    """Return the host's own command of a surface, none where the record holds no estimate."""
    name, pressure = channel(control, "estimate"), "dynamic_pressure_Pa"
    if name not in record or pressure not in record:
        return np.zeros(len(record))
    served = service_rows(record, control)
    wanted = record[name] if served is None else served.asked
    asked = replay_surface(rig, control, wanted, record[pressure])
    return np.concatenate(([0.0], asked[:-1]))
