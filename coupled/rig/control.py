"""One control of the rig as the kernels hold it: the stages' layouts side by side."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig import (
    compensation,
    friction,
    hand,
    linkage,
    loader,
    modification,
    schedule,
    sensing,
    surface,
)
from coupled.rig.compiled import layout


class Clock(Protocol):
    """How the loader's time divides a frame."""

    substeps: int
    substep: float  # s


class ControlParameters(Protocol):
    """Parameters of every stage, in the order of the signal chain."""

    clock: Clock

    hand: hand.HandParameters
    schedule: schedule.ScheduleParameters
    modification: modification.ModificationParameters
    loader: loader.LoaderParameters
    friction: friction.FrictionParameters
    linkage: linkage.LinkageParameters
    sensing: sensing.SensingParameters
    compensation: compensation.CompensationParameters
    surface: surface.SurfaceParameters


class ControlState(Protocol):
    """State of every stage that has one."""

    hand: hand.HandState
    schedule: schedule.ScheduleState
    modification: modification.ModificationState
    loader: loader.LoaderState
    linkage: linkage.LinkageState
    surface: surface.SurfaceState


class Control(Protocol):
    """One control, whole."""

    parameters: ControlParameters
    state: ControlState


CONTROL_PARAMETERS = np.dtype(
    [
        ("clock", layout(Clock)),
        ("hand", hand.HAND_PARAMETERS),
        ("schedule", schedule.SCHEDULE_PARAMETERS),
        ("modification", modification.MODIFICATION_PARAMETERS),
        ("loader", loader.LOADER_PARAMETERS),
        ("friction", friction.FRICTION_PARAMETERS),
        ("linkage", linkage.LINKAGE_PARAMETERS),
        ("sensing", sensing.SENSING_PARAMETERS),
        ("compensation", compensation.COMPENSATION_PARAMETERS),
        ("surface", surface.SURFACE_PARAMETERS),
    ]
)
CONTROL_STATE = np.dtype(
    [
        ("hand", hand.HAND_STATE),
        ("schedule", schedule.SCHEDULE_STATE),
        ("modification", modification.MODIFICATION_STATE),
        ("loader", loader.LOADER_STATE),
        ("linkage", linkage.LINKAGE_STATE),
        ("surface", surface.SURFACE_STATE),
    ]
)

CONTROL = np.dtype([("parameters", CONTROL_PARAMETERS), ("state", CONTROL_STATE)])

# An array of that layout, one element a control; a kernel sees an element as a `Control`.
ControlArray = NDArray[np.void]
