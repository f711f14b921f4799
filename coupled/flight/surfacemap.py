"""The position of a surface for each command, and its stops, found by flying an aircraft."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.flight.wrapper import Motion, Step
from coupled.record.channels import SURFACES, motion_channels

Floats = NDArray[np.float64]
_BEYOND = (2.0, 2.5)  # commands about trim beyond the ±1 at which models limit them
_SAME_rad = 1e-9  # rounding of a surface's position
_HALVINGS = 24  # of a command from 0 to 1: to 6e-8


@dataclass(frozen=True)
class SurfaceStop:
    """A surface's stop: the command about trim, of ±1, and its position in rad."""

    command_norm: float
    position_rad: float


def stops_found(
    step: Step, motion: Motion, controls: Sequence[str], control: str
) -> dict[str, dict[str, Any] | None]:
    """Return the stops of a control's surface on either side, within commands of ±1.

    By the sign of the command, `negative` and `positive`, for JSON; None if there is none. For a
    surface that follows its command within a frame. Up to some 50 frames are flown.
    """
    surface = f"{SURFACES[control]}_rad"
    at = motion_channels(controls, flown=True).index(surface)
    own = [float(each == control) for each in controls]

    def place(command: float) -> float:
        first, second, third = (*(command * each for each in own), 0.0, 0.0)[:3]
        step((first, second, third))
        return motion()[at]

    found: dict[str, dict[str, Any] | None] = {}
    for name, side in (("negative", -1.0), ("positive", 1.0)):
        far, farther = (place(side * beyond) for beyond in _BEYOND)
        found[name] = None
        if abs(farther - far) > _SAME_rad or abs(place(side) - far) > _SAME_rad:
            continue
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if abs(place(side * middle) - far) <= _SAME_rad:
                high = middle
            else:
                low = middle
        found[name] = asdict(SurfaceStop(side * high, far))
    return found


def flown_through(
    step: Step, motion: Motion, controls: Sequence[str], surface: str
) -> tuple[Floats, Floats]:
    """Return commands about trim, and a surface's position for each, rad; a frame each.

    601 even commands, and those between at which the surface's slope changes, such as neutral if
    its travels up and down differ: linear interpolation is then exact for a piecewise linear law.
    """
    at = motion_channels(controls, flown=True).index(surface)
    moved = [f"{SURFACES[control]}_rad" == surface for control in controls]
    first, second, third = (*map(float, moved), 0.0, 0.0)[:3]

    def places(commands: Floats) -> Floats:
        positions = np.empty_like(commands)
        for i, command in enumerate(commands.tolist()):
            step((first * command, second * command, third * command))
            positions[i] = motion()[at]
        return positions

    even = np.linspace(-1.5, 1.5, 601)
    found = places(even)
    corners = _corners(even, found)
    commands = np.concatenate((even, corners))
    order = np.argsort(commands)
    return commands[order], np.concatenate((found, places(corners)))[order]


def _corners(commands: Floats, positions: Floats) -> Floats:
    """Return the commands inside a step at which the lines through its neighbours intersect."""
    step = commands[1] - commands[0]
    rises = np.diff(positions)
    before, within, after = rises[:-2], rises[1:-1], rises[2:]
    bends = np.minimum(np.abs(within - before), np.abs(after - within)) > _SAME_rad
    change = np.where(np.abs(after - before) > _SAME_rad, after - before, np.inf)
    share = (after - within) / change
    inside = bends & (share > 0.0) & (share < 1.0)
    corners: Floats = (commands[1:-2] + share * step)[inside]
    return corners
