"""An airframe whose elevator or pitch damping differs from its model's.

Both act through the elevator, the one effector that every model has: about its trim it is
driven to e times the command, and the missing or surplus damping moment is made by it,

    Δc = (d − 1)·(M_q/M_c)·q·V₀/V,

with the model's own M_q (per pitch rate) and M_c (per command), found by finite differences in
trim; their ratio falls with speed. The surface itself stands where the command puts it, so
the motion tells that position, not the one that makes the moment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from coupled.record.channels import LONGITUDINAL
from coupled.rig.parameters import Flight

if TYPE_CHECKING:
    from coupled.flight.airframe import JSBSimAirframe

Motion = Callable[[], tuple[float, ...]]
Step = Callable[[tuple[float, float, float]], None]
# The model as it comes, in still air.
UNALTERED = {"elevator_effectiveness": 1.0, "pitch_damping": 1.0, "gust_rms": 0.0}
_ELEVATOR = LONGITUDINAL.index("elevator_rad")
_RATE = LONGITUDINAL.index("pitch_rate_rad_per_s")
_SPEED = LONGITUDINAL.index("true_airspeed_m_per_s")


def altered(
    airframe: JSBSimAirframe, flight: Flight, models: Sequence[Path], frame_s: float
) -> tuple[Motion, Step]:
    """Return the reading and stepping of an airframe with the factors of `flight`."""
    plain = flight.model_copy(update=UNALTERED)
    spare = type(airframe)(plain, frame_s, ["column"], models)
    per_rate, per_command = spare.pitch_moments()
    commands_at, positions = spare.surface_map()
    read, step = airframe.motion, airframe.step
    start_speed = read()[_SPEED]
    effect, surplus = flight.elevator_effectiveness, flight.pitch_damping - 1.0
    ratio = surplus * per_rate / per_command * start_speed
    stands = read()[_ELEVATOR]

    def motion() -> tuple[float, ...]:
        now = read()
        return (*now[:_ELEVATOR], stands, *now[_ELEVATOR + 1 :])

    def run(commands: tuple[float, float, float], /) -> None:
        nonlocal stands
        now = read()
        makes = effect * commands[0] + ratio * now[_RATE] / now[_SPEED]
        stands = float(np.interp(commands[0], commands_at, positions))
        step((makes, commands[1], commands[2]))

    return motion, run
