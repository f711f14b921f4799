"""Whether a model flies with direct controls and the rig's signs, found by flying it.

With `direct_controls = false` in the rig only the signs are checked: its surfaces may follow with a
lag or a control law of the model.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.record.channels import SURFACES, motion_channels
from coupled.rig.parameters import Flight

_ANSWERS_s = 0.1  # from the surface's first motion, over which the aircraft turns
_LATEST_s = 1.0  # of a surface behind a delay of the model's own
_MOVED_rad = 1e-4


def check_direct_controls(
    flight: Flight,
    frame_s: float,
    controls: Sequence[str],
    models: Sequence[Path] = (),
    file: object = "rig",
) -> Mapping[str, float]:
    """Fly a small step of each control on a separate aircraft, and refuse indirect controls.

    Direct means: within one step the surface is at its new position, stays there, and the aircraft
    turns to the side of the rig's signs. If the rig requires no direct controls, the surface need
    only move within a second, as behind an actuator with a delay. Returns {control: surface travel
    in rad per unit of command}. Cached by aircraft, since a sweep has few.
    """
    return _travel(flight.model_dump_json(), frame_s, tuple(controls), tuple(models), file)


@lru_cache(maxsize=256)
def _travel(
    flight_json: str,
    frame_s: float,
    controls: tuple[str, ...],
    models: tuple[Path, ...],
    file: object,
) -> Mapping[str, float]:
    rates = {"column": "pitch_rate_rad_per_s", "wheel": "roll_rate_rad_per_s"}
    flight = Flight.model_validate_json(flight_json)
    frames = max(2, round(_ANSWERS_s / frame_s))
    flown = frames if flight.direct_controls else frames + round(_LATEST_s / frame_s)
    channels = motion_channels(controls, flown=True)
    fly = partial(_fly, flight, frame_s, controls, models, file, flown)
    still = fly((0.0, 0.0, 0.0))
    travel = {}
    for i, control in enumerate(controls):
        surface = SURFACES[control]
        step = 0.05 if control == "wheel" else -0.05  # positive force of the pilot
        commands = (step * (i == 0), step * (i == 1), step * (i == 2))
        moved = fly(commands)
        at = channels.index(f"{surface}_rad")
        turn = channels.index(rates.get(control, "yaw_rate_rad_per_s"))
        positions = [a[at] - b[at] for a, b in zip(moved, still, strict=True)]
        begins = next((k for k, place in enumerate(positions) if abs(place) >= _MOVED_rad), 0)
        answers = min(begins + frames, flown) - 1
        rate = moved[answers][turn] - still[answers][turn]
        first, last = positions[0], positions[answers]
        fault, within, remedies = "", f"within {_LATEST_s:g} s", []
        if flight.direct_controls:
            within = "at once"
            remedies = ["if a control law or a lag moves it, give direct_controls = false"]
        else:
            first = last
        if not math.isfinite(first) or abs(first) < _MOVED_rad:
            fault = f"does not move its {surface} {within}"
            keys = f"controls.{control}.surface_property and command_property"
            remedies.append(f"if its properties have other names, {keys}")
        elif abs(last - first) > 0.25 * abs(first):
            fault = f"moves its {surface} by more than the command"
        elif rate <= 0.0:
            fault, remedies = f"turns the wrong way on a positive {control}", []
        if fault:
            name = flight.model + " has no direct controls: it" * flight.direct_controls
            problem = "; ".join([f"{name} {fault}", *remedies])
            raise InputError(file, "flight.model", problem)
        travel[control] = first / step
    return travel


def _fly(
    flight: Flight,
    frame_s: float,
    controls: Sequence[str],
    models: Sequence[Path],
    file: object,
    frames: int,
    commands: tuple[float, float, float],
) -> list[tuple[float, ...]]:
    """Return the motion of a separate aircraft under commands, frame by frame."""
    airframe = make_aircraft(flight, frame_s, controls, models, file)
    motions = []
    for _ in range(frames):
        airframe.step(commands)
        motions.append(airframe.motion())
    return motions
