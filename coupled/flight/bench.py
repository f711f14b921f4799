"""The airframe of the frame loop, and its simplest kind: a bench with given q̄."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Sequence
from typing import Protocol

from coupled.flight.everyframe import PlainFrames, PlainSteps
from coupled.record.channels import BENCH_MOTION, LOAD, WHOLE_MOTION
from coupled.rig.placed import HalfFrames, Placed

_AT_REST = (1.0,) + (0.0,) * (WHOLE_MOTION - len(BENCH_MOTION) - 1)  # its load factor first
assert len(BENCH_MOTION) == LOAD


class Airframe(Protocol):
    """The airframe of the frame loop: an aircraft, or a bench that only gives q̄."""

    motion: Callable[[], tuple[float, ...]]  # the current values of the motion's channels, SI
    whole_motion: Callable[[], tuple[float, ...]]  # at rest for channels that it lacks
    step: Callable[[tuple[float, float, float]], None]  # one frame with commands about trim
    safe_altitude_m: float  # altitude above which the ground cannot be near

    def plain_frames(self, placed: Placed) -> PlainFrames | None:
        """Return the fast loop of rig and airframe; None if wrappers act on it."""

    def plain_steps(self, halves: HalfFrames) -> PlainSteps | None:
        """Return the fast halves of a frame; None if wrappers act on the airframe."""

    def trouble(self) -> str:
        """Return why the flight must end, or an empty string; called below safe_altitude_m."""

    def extra(self) -> tuple[float, ...]:
        """Return the further properties requested by a run."""


class Bench:
    """No aircraft: the dynamic pressure for the host, from a schedule in time."""

    def __init__(self, frame_s: float, pressures_Pa: Sequence[tuple[float, float]]) -> None:
        self._frame_s = frame_s
        self._times_s, self._pressures_Pa = zip(*pressures_Pa, strict=True)
        self._k = 0
        self.safe_altitude_m = 0.0
        self.motion = self._now
        self.whole_motion = self._whole
        self.step = self._next

    def _now(self) -> tuple[float, ...]:
        time, times, pressures = self._k * self._frame_s, self._times_s, self._pressures_Pa
        k = bisect_right(times, time)
        if k in (0, len(times)):
            return (pressures[min(k, len(times) - 1)],)
        t0, q0 = times[k - 1], pressures[k - 1]
        return (q0 + (pressures[k] - q0) * (time - t0) / (times[k] - t0),)

    def _whole(self) -> tuple[float, ...]:
        return self._now() + _AT_REST

    def _next(self, commands: tuple[float, float, float], /) -> None:
        self._k += 1

    def plain_frames(self, placed: Placed) -> PlainFrames | None:
        """Return None: its frames are stepped one by one."""
        return None

    def plain_steps(self, halves: HalfFrames) -> PlainSteps | None:
        """Return None, as `plain_frames` does."""
        return None

    def extra(self) -> tuple[float, ...]:
        """Return nothing: a bench has no properties."""
        return ()

    def trouble(self) -> str:
        """Return an empty string."""
        return ""
