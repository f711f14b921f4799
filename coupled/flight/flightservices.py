"""The services of the loaders in a flight, set by its events and recorded at each frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from coupled.flight.event import service_events
from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.channels import ControlName
from coupled.rig.control import ControlArray
from coupled.rig.services import SERVICE_CHANNELS
from coupled.rig.serving import copy_service_rows, service_channels

Floats = NDArray[np.float64]

# Channels that are 0 without an active service; the surface's command is not one.
_RESTING = [i for i, name in enumerate(SERVICE_CHANNELS) if name != "asked_{d}"]


class FlightServices:
    """The services of a flight; false if it has none.

    `any_led`: the services of any control may be set from outside during the flight.
    """

    def __init__(self, manoeuvre: Manoeuvre, controls: ControlArray, any_led: bool = False) -> None:
        rig = manoeuvre.rig
        self._controls, self._names = controls, list(rig.controls)
        self._always = manoeuvre.served
        self._which = tuple(rig.controls) if any_led else self._always
        # From the first frame on, so that rows before an event are recorded too.
        recorded = [name in self._which for name in rig.controls]
        controls["state"]["services"]["on"][recorded] = 1
        events = manoeuvre.conditions.event
        self._happen = service_events(events, controls, self._names, 1.0 / rig.frame_rate)
        self._rows = np.zeros((0, len(self._which), len(SERVICE_CHANNELS)))

    def __bool__(self) -> bool:
        return bool(self._which)

    def around(self) -> tuple[Callable[[], None] | None, Callable[[int], None] | None]:
        """Return the functions to call before and after a frame's host: events, and recording."""
        if not self:
            return None, None

        def record(k: int) -> None:
            copy_service_rows(self._controls, self._names, self._which, self._rows[k])

        return self._happen, record

    def row(self, k: int) -> Floats:
        """Return the services' channels of frame k, in the order of `channels`."""
        row: Floats = self._rows[k].ravel()
        return row

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the services that a rig file, an event or the user sets."""
        return tuple(each for name in self._always for each in service_channels(name))

    def extend(self, frames: int) -> None:
        """Extend the flight to a number of frames."""
        if self:
            more = np.zeros((frames - len(self._rows), *self._rows.shape[1:]))
            self._rows = np.concatenate((self._rows, more))

    def serve(self, control: ControlName, frames: int, asked: Floats) -> None:
        """Record the services of a control over `frames`; `asked` are its first rows of δ̂, d."""
        which = tuple(name for name in self._names if name in (*self._which, control))
        if which == self._which == self._always:
            return
        rows = np.zeros((frames, len(which), len(SERVICE_CHANNELS)))
        for i, name in enumerate(which):
            if name in self._which:
                rows[:, i] = self._rows[:, self._which.index(name)]
            else:
                rows[: len(asked), i, SERVICE_CHANNELS.index("asked_{d}")] = asked
        self._rows, self._which, self._always = rows, which, which

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
