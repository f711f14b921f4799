"""The frames of a flight, one at a time or in a loop, until its time is over or something ends it.

A frame is `begin`, the motion and the host at t_k, and `end`, hand, loader and aircraft up to
t_k+1. Most flights have rig and aircraft only, without calls between frames. They are flown in
blocks by a fast loop of the same compiled frame step (`everyframe.plain_frames`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from coupled.flight.bench import Airframe
from coupled.flight.companion import Companion
from coupled.flight.everyframe import PlainSteps
from coupled.flight.flightservices import FlightServices
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot.base import Look
from coupled.record.channels import ALTITUDE
from coupled.record.record import EndedEarly
from coupled.rig.placed import Commands, HalfFrames, Placed

Progress = Callable[[int, int], None]
_BLOCK = 64  # frames between two reports of progress
NO_FORCES = (0.0, 0.0, 0.0)


class Split(NamedTuple):
    """Frames whose hand forces, or gradients, follow from what the host has read.

    `forces`, if any, returns the given controls' forces over frame k, N. `schedule`, if any, sets
    the gradients of frame k and returns the surface commands of its host, run again.
    """

    halves: HalfFrames
    forces: Callable[[int], Commands] | None
    schedule: Callable[[int], Commands] | None


class Steps(NamedTuple):
    """The two parts of a frame; `begin` returns why the flight must end, or an empty string.

    `again` makes a change of controls at t_k, after `begin` and before `end`, and repeats the host.
    `advance`, if any, is `end` of frame k under a force on the column, N, and `begin` of k + 1.
    """

    begin: Callable[[int], str]
    end: Callable[[int, Sequence[float]], None]
    again: Callable[[int, Callable[[], None]], None]
    advance: Callable[[int, float], str] | None = None


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
        served: FlightServices,
        looks: Sequence[tuple[Any, Look]] = (),
        companion: Companion | None = None,
        split: Split | None = None,
    ) -> None:
        self._manoeuvre, self._airframe, self._placed = manoeuvre, airframe, placed
        self._served, self._looks, self._companion = served, looks, companion
        self._rate_Hz, self._split = manoeuvre.rig.frame_rate, split
        self.extra: list[tuple[float, ...]] = []
        self.done = 0
        self.ended: EndedEarly | None = None

    @property
    def _eventful(self) -> bool:
        """Whether anything but rig and aircraft is called in a frame."""
        listened = self._companion is not None or self._looks or self._served
        return bool(listened or self._manoeuvre.record_properties)

    def fly(self, frames: int, progress: Progress | None = None) -> None:
        """Fly a number of frames, or up to the one that ends the flight."""
        eventful = self._eventful or self._split is not None
        plain = None if eventful else self._airframe.plain_frames(self._placed)
        try:
            if plain is None:
                self._one_by_one(frames, progress)
            else:
                self._in_blocks(plain, frames, progress)
        except KeyboardInterrupt:
            self.end("interrupted")

    def end(self, why: str) -> None:
        """End the flight before the frame that is not done."""
        self.ended = EndedEarly(why, self.done / self._rate_Hz)

    def _in_blocks(
        self, plain: Callable[[int, int], int], frames: int, progress: Progress | None
    ) -> None:
        while self.done < frames:
            last = min(self.done + _BLOCK, frames)
            self.done = plain(self.done, last)
            if self.done < last:
                self.end(self._airframe.trouble())
                return
            if progress is not None:
                progress(self.done, frames)

    def _one_by_one(self, frames: int, progress: Progress | None) -> None:
        begin, end, *_ = self.steps()
        forces = None if self._split is None else self._split.forces
        for k in range(frames):
            if why := begin(k):
                self.end(why)
                return
            end(k, NO_FORCES if forces is None else forces(k))
            self.done = k + 1
            if progress is not None and not self.done % _BLOCK:
                progress(self.done, frames)

    def steps(self) -> Steps:
        """Return the two parts of a frame, for frames in their order."""
        split = self._split
        if split is not None and split.schedule is None and not self._eventful:
            plain = self._airframe.plain_steps(split.halves)
            if plain is not None:
                return _plain(plain, split.halves)
        return self._any_steps()

    def _any_steps(self) -> Steps:
        airframe, companion, looks, split = (
            self._airframe,
            self._companion,
            self._looks,
            self._split,
        )
        read, step, safe_m = airframe.whole_motion, airframe.step, airframe.safe_altitude_m
        happen, note = self._served.around()
        flown, asked = self._manoeuvre.rig.flight is not None, self._manoeuvre.record_properties
        rate_Hz, extra = self._rate_Hz, self.extra
        run = self._placed.frame if split is None else split.halves.begin
        finish = None if split is None else split.halves.finish
        schedule = None if split is None else split.schedule
        commands = NO_FORCES

        def begin(k: int) -> str:
            nonlocal commands
            motion = read()
            if companion is not None and (why := companion.before(k, motion)):
                return why
            # `not >` includes NaN.
            if flown and not motion[ALTITUDE] > safe_m and (why := airframe.trouble()):
                return why
            for state, look in looks:
                state["command"] = look(k / rate_Hz, motion)
            if happen is not None:
                happen()
            if asked:
                extra.append(airframe.extra())
            commands = run(k, motion)
            if note is not None:
                note(k)
            if schedule is not None:
                commands = schedule(k)
            return ""

        def end(k: int, forces: Sequence[float]) -> None:
            if finish is not None:
                finish(k, forces)
            if companion is not None:
                companion.after(k, commands)
            step(commands)

        def again(k: int, change: Callable[[], None]) -> None:
            nonlocal commands
            assert split is not None
            split.halves.undo(k)
            try:
                change()
            finally:
                commands = split.halves.begin_again(k)
                if note is not None:
                    note(k)
                if schedule is not None:
                    commands = schedule(k)

        return Steps(begin, end, again)


def _plain(steps: PlainSteps, halves: HalfFrames) -> Steps:
    """Return the parts of a frame of rig and aircraft only."""

    def again(k: int, change: Callable[[], None]) -> None:
        halves.undo(k)
        try:
            change()
        finally:
            halves.begin_again(k)

    return Steps(steps.begin, steps.end, again, steps.advance)
