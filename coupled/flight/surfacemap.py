"""Where a surface stands for each command, found by flying an aircraft through them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.flight.wrapper import Motion, Step
from coupled.record.channels import SURFACES, motion_channels

Floats = NDArray[np.float64]


def flown_through(
    step: Step, motion: Motion, controls: Sequence[str], surface: str
) -> tuple[Floats, Floats]:
    """Return commands about trim, and where a surface stands for each, rad; a frame each."""
    commands = np.linspace(-1.5, 1.5, 601)
    positions = np.empty_like(commands)
    at = motion_channels(controls, flown=True).index(surface)
    moved = [f"{SURFACES[control]}_rad" == surface for control in controls]
    first, second, third = (*map(float, moved), 0.0, 0.0)[:3]
    for i, command in enumerate(commands.tolist()):
        step((first * command, second * command, third * command))
        positions[i] = motion()[at]
    return commands, positions
