"""The loaders' services over a flight: led by its events before each frame, noted after it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from coupled.flight.event import service_events
from coupled.flight.manoeuvre import Manoeuvre
from coupled.rig.control import ControlArray
from coupled.rig.serving import noted, service_channels

Floats = NDArray[np.float64]
Frame = Callable[[int, int, tuple[float, ...], float], tuple[float, float, float]]


class Served:
    """What a flight's services do; false where it has none."""

    def __init__(self, manoeuvre: Manoeuvre, controls: ControlArray) -> None:
        rig = manoeuvre.rig
        self._controls, self._names = controls, [str(name) for name in rig.controls]
        self._which = manoeuvre.served
        events = manoeuvre.conditions.event
        self._happen = service_events(events, controls, self._names, 1.0 / rig.frame_rate)
        self.channels = tuple(each for name in self._which for each in service_channels(name))
        self._rows = np.zeros((manoeuvre.frames if self.channels else 0, len(self.channels)))

    def __bool__(self) -> bool:
        return bool(self.channels)

    def around(self, frame: Frame) -> Frame:
        """Return the rig's frame with events led before it, and what it recorded noted after."""
        if not self:
            return frame
        happen, rows = self._happen or (lambda: None), self._rows

        def served(
            place: int, k: int, motion: tuple[float, ...], load_factor: float
        ) -> tuple[float, float, float]:
            happen()
            commands = frame(place, k, motion, load_factor)
            rows[k] = noted(self._controls, self._names, self._which)
            return commands

        return served

    def beside(self, data: Floats) -> Floats:
        """Return a record's rows with the services' channels behind them."""
        return np.column_stack((data, self._rows[: len(data)])) if self else data
