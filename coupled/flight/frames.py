"""The loop over a flight's frames, until its time is over or something ends it.

Most flights have rig and aircraft only, without calls between frames. They are flown in blocks by a
fast loop (`everyframe.plain_frames`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from coupled.flight.bench import Airframe
from coupled.flight.companion import Companion
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot.base import Look
from coupled.flight.served import Served
from coupled.record.channels import ALTITUDE
from coupled.record.record import EndedEarly
from coupled.rig.placed import Placed

Progress = Callable[[int, int], None]
_BLOCK = 64  # frames between two reports of progress


class Frames:
    """The frames of a manoeuvre: the number `done`, and `ended` if the flight ended early.

    `looks` are the hands whose pilots observe the motion, with their functions. `extra` receives
    the further properties, a row for each frame.
    """

    def __init__(
        self,
        manoeuvre: Manoeuvre,
        airframe: Airframe,
        placed: Placed,
        served: Served,
        looks: Sequence[tuple[Any, Look]] = (),
        companion: Companion | None = None,
        progress: Progress | None = None,
    ) -> None:
        self._manoeuvre, self._airframe, self._placed = manoeuvre, airframe, placed
        self._served, self._looks, self._companion = served, looks, companion
        self._frames, self._rate_Hz = manoeuvre.frames, manoeuvre.rig.frame_rate
        self._progress = progress
        self.extra: list[tuple[float, ...]] = []
        self.done = 0
        self.ended: EndedEarly | None = None

    def fly(self) -> None:
        """Fly all frames, or up to the one that ends the flight."""
        listened = self._companion is not None or self._looks or self._served
        eventful = listened or self._manoeuvre.record_properties
        plain = None if eventful else self._airframe.plain_frames(self._placed)
        try:
            if plain is None:
                self._one_by_one()
            else:
                self._in_blocks(plain)
        except KeyboardInterrupt:
            self._end("interrupted")

    def _end(self, why: str) -> None:
        self.ended = EndedEarly(why, self.done / self._rate_Hz)

    def _in_blocks(self, plain: Callable[[int, int], int]) -> None:
        while self.done < self._frames:
            last = min(self.done + _BLOCK, self._frames)
            self.done = plain(self.done, last)
            if self.done < last:
                self._end(self._airframe.trouble())
                return
            if self._progress is not None:
                self._progress(self.done, self._frames)

    def _one_by_one(self) -> None:
        airframe, companion, looks = self._airframe, self._companion, self._looks
        read, step, safe_m = airframe.whole_motion, airframe.step, airframe.safe_altitude_m
        rig_frame = self._served.around(self._placed.frame)
        flown, asked = self._manoeuvre.rig.flight is not None, self._manoeuvre.record_properties
        for k in range(self._frames):
            motion = read()
            if companion is not None and (why := companion.before(k, motion)):
                return self._end(why)
            # `not >` includes NaN.
            if flown and not motion[ALTITUDE] > safe_m and (why := airframe.trouble()):
                return self._end(why)
            for state, look in looks:
                state["command"] = look(k / self._rate_Hz, motion)
            commands = rig_frame(k, motion)
            if companion is not None:
                companion.after(k, commands)
            if asked:
                self.extra.append(airframe.extra())
            step(commands)
            self.done = k + 1
            if self._progress is not None and not self.done % _BLOCK:
                self._progress(self.done, self._frames)
        return None
