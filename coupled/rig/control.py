"""One control of the rig in the kernels: its stages, listed once.

`ControlParameters` is that list, in the order of the signal chain: each stage's parameters, with
the declaration of their layout and origin. `ControlState` has the stages with a state, for the type
checker.
"""

from __future__ import annotations

from typing import Annotated, Protocol, get_type_hints

import numpy as np
from numpy.typing import NDArray

from coupled.rig import (
    compensation,
    crossing,
    friction,
    gauge,
    hand,
    inertia,
    linkage,
    loader,
    modification,
    reach,
    schedule,
    sensing,
    services,
    surface,
)
from coupled.rig.compiled import layout
from coupled.rig.declaration import Declaration


class Clock(Protocol):
    """The loader's time step within a frame."""

    substeps: int
    substep: float  # s


CLOCK = Declaration(
    layout(Clock),
    derived={"substeps": lambda g: g.substeps, "substep": lambda g: g.substep_s},
)


class ControlParameters(Protocol):
    """Parameters of every stage, with their declarations, in the order of the signal chain."""

    clock: Annotated[Clock, CLOCK]
    hand: Annotated[hand.HandParameters, hand.HAND]
    reach: Annotated[reach.ReachParameters, reach.REACH]
    schedule: Annotated[schedule.ScheduleParameters, schedule.SCHEDULE]
    modification: Annotated[modification.ModificationParameters, modification.MODIFICATION]
    gauge: Annotated[gauge.GaugeParameters, gauge.GAUGE]
    loader: Annotated[loader.LoaderParameters, loader.LOADER]
    inertia: Annotated[inertia.InertiaParameters, inertia.INERTIA]
    friction: Annotated[friction.FrictionParameters, friction.FRICTION]
    services: Annotated[services.ServicesParameters, services.SERVICES]
    linkage: Annotated[linkage.LinkageParameters, linkage.LINKAGE]
    sensing: Annotated[sensing.SensingParameters, sensing.SENSING]
    compensation: Annotated[compensation.CompensationParameters, compensation.COMPENSATION]
    crossing: Annotated[crossing.CrossingParameters, crossing.CROSSING]
    surface: Annotated[surface.SurfaceParameters, surface.SURFACE]


class ControlState(Protocol):
    """State of every stage that has one."""

    hand: hand.HandState
    reach: reach.ReachState
    schedule: schedule.ScheduleState
    modification: modification.ModificationState
    gauge: gauge.GaugeState
    loader: loader.LoaderState
    inertia: inertia.InertiaState
    services: services.ServicesState
    linkage: linkage.LinkageState
    sensing: sensing.SensingState
    compensation: compensation.CompensationState
    crossing: crossing.CrossingState
    surface: surface.SurfaceState


class Control(Protocol):
    """One control: its parameters and its state."""

    parameters: ControlParameters
    state: ControlState


STAGES: dict[str, Declaration] = {
    name: next(found for found in kind.__metadata__ if isinstance(found, Declaration))
    for name, kind in get_type_hints(ControlParameters, include_extras=True).items()
}
CONTROL_PARAMETERS = np.dtype([(name, one.parameters) for name, one in STAGES.items()])
CONTROL_STATE = np.dtype([(n, one.state) for n, one in STAGES.items() if one.state is not None])
CONTROL = np.dtype([("parameters", CONTROL_PARAMETERS), ("state", CONTROL_STATE)])

# An array of that layout, one element for each control; a kernel sees an element as a `Control`.
ControlArray = NDArray[np.void]
