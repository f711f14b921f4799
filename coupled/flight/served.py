"""The loaders' services over a flight: set by its events before each frame, recorded after it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from coupled.flight.event import service_events
from coupled.flight.manoeuvre import Manoeuvre
from coupled.rig.control import ControlArray
from coupled.rig.services import SERVICE_CHANNELS
from coupled.rig.serving import copy_service_rows, service_channels

Floats = NDArray[np.float64]
Frame = Callable[[int, tuple[float, ...]], tuple[float, float, float]]


# Channels that are 0 without an active service; the surface's command is not one.
_RESTING = [i for i, name in enumerate(SERVICE_CHANNELS) if name != "asked_{d}"]


class Served:
    """The services of a flight; false if it has none.

    `any_led`: the services of any control may be set from outside during the flight.
    """

    def __init__(self, manoeuvre: Manoeuvre, controls: ControlArray, any_led: bool = False) -> None:
        rig = manoeuvre.rig
        self._controls, self._names = controls, [str(name) for name in rig.controls]
        self._always = manoeuvre.served
        self._which = tuple(rig.controls) if any_led else self._always
        # From the first frame on, so that rows before an event are recorded too.
        recorded = [name in self._which for name in rig.controls]
        controls["state"]["services"]["on"][recorded] = 1
        events = manoeuvre.conditions.event
        self._happen = service_events(events, controls, self._names, 1.0 / rig.frame_rate)
        shape = (manoeuvre.frames, len(self._which), len(SERVICE_CHANNELS))
        self._rows = np.zeros(shape if self else (0, *shape[1:]))

    def __bool__(self) -> bool:
        return bool(self._which)

    def around(self, frame: Frame) -> Frame:
        """Return the rig's frame with events applied before it, and services recorded after it."""
        if not self:
            return frame
        happen, rows = self._happen or (lambda: None), self._rows

        def served(k: int, motion: tuple[float, ...]) -> tuple[float, float, float]:
            happen()
            commands = frame(k, motion)
            copy_service_rows(self._controls, self._names, self._which, rows[k])
            return commands

        return served

    def beside(self, data: Floats, first: int = 0) -> tuple[tuple[str, ...], Floats]:
        """Return the services' channels, and a record's rows from frame `first` with them appended.

        Channels of a control without services are left out, unless one was set by then.
        """
        flown = self._rows[: first + len(data)]
        rows = flown[first:]
        kept = [
            name in self._always or bool(flown[:, i, _RESTING].any())
            for i, name in enumerate(self._which)
        ]
        names = [name for name, has in zip(self._which, kept, strict=True) if has]
        channels = tuple(each for name in names for each in service_channels(name))
        if not channels:
            return (), data
        return channels, np.column_stack((data, rows[:, kept].reshape(len(data), -1)))
