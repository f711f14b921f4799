"""Whether a model flies with direct controls, to the rig's signs: found by flying it.

A rig that says `direct_controls = false` is let off the first half: its surfaces may follow with a
lag or a law of the model's own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from coupled.channels import SURFACES, motion_channels
from coupled.errors import InputError
from coupled.flight.airframe import JSBSimAirframe
from coupled.rig.parameters import Flight


def check_direct_controls(
    flight: Flight, frame_s: float, controls: Sequence[str], **where: Any
) -> Mapping[str, float]:
    """Fly a small step of each control on an aircraft of its own, and refuse what is not direct.

    Direct means: within one step the surface stands at its new place, stays there, and the
    aircraft turns to the side that the rig's signs say; where the rig asks for no direct
    controls, the surface need only have moved. Returns {control: surface travel in
    rad per unit of command}.
    """
    rates = {"column": "pitch_rate_rad_per_s", "wheel": "roll_rate_rad_per_s"}
    travel = {}
    for i, control in enumerate(controls):
        surface = SURFACES[control]
        still = JSBSimAirframe(flight, frame_s, controls, **where)
        moved = JSBSimAirframe(flight, frame_s, controls, **where)
        step = 0.05 if control == "wheel" else -0.05  # positive force of the pilot
        commands = (step * (i == 0), step * (i == 1), step * (i == 2))
        channels = motion_channels(controls, flown=True)
        at = channels.index(f"{surface}_rad")
        turn = channels.index(rates.get(control, "yaw_rate_rad_per_s"))
        positions, rate = [], 0.0
        for _ in range(max(2, round(0.1 / frame_s))):
            still.step((0.0, 0.0, 0.0))
            moved.step(commands)
            positions.append(moved.motion()[at] - still.motion()[at])
            rate = moved.motion()[turn] - still.motion()[turn]
        first, last = positions[0], positions[-1]
        fault = ""
        if not flight.direct_controls:
            first = last
        if not math.isfinite(first) or abs(first) < 1e-4:
            fault = f"does not move its {surface} at once"
        elif abs(last - first) > 0.25 * abs(first):
            fault = f"moves its {surface} by more than the command (a control law or a lag)"
        elif rate <= 0.0:
            fault = f"turns the wrong way on a positive {control}"
        if fault:
            raise InputError(
                where.get("file", "rig"),
                "flight.model",
                f"{flight.model} has no direct controls: it {fault};"
                " c172p, T37, 737, B747 and awjsra fly with theirs",
            )
        travel[control] = first / step
    return travel
