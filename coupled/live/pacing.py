"""Real time: frames at absolute deadlines, and their lateness.

Frame k is due at t₀ + k·T. A late frame is flown at once, and the next keeps its own deadline, so
lateness does not accumulate. A frame that is late by more than a whole frame moves t₀ by the
missed frames. They are counted and not made up for, since a burst of frames would be a burst of
speed for the pilot.

Other work of the machine delays frames. Under Linux a thread of the class SCHED_FIFO runs before
all ordinary ones; root and users with a limit `rtprio` may request it.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Clock = Callable[[], float]  # s, from any origin
Sleep = Callable[[float], object]
# Edges of the histogram, ms; the last bin has no upper edge.
EDGES_ms = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
PRIORITY = 40  # of 1 to 99: before all ordinary work, after the kernel's own interrupts at 50


@dataclass(frozen=True)
class Lateness:
    """The lateness of a flight's frames, and their computing times.

    `late_ms` and `work_ms` have shape (frames,); `missed` counts the deadlines that passed
    without a frame; `frame_ms` is the time between two deadlines.
    """

    late_ms: NDArray[np.float32]
    work_ms: NDArray[np.float32]
    missed: int
    frame_ms: float

    def as_dict(self) -> dict[str, Any]:
        """Return the figures for manifest and page; None if no frame was paced."""
        late, edges = self.late_ms, np.array([*EDGES_ms, math.inf])
        counts = np.histogram(late, edges)[0].tolist()
        return {
            "frames": len(late),
            "frame_ms": self.frame_ms,
            "late_over_a_frame": int(np.count_nonzero(late > self.frame_ms)),
            "missed_deadlines": self.missed,
            "late_p50_ms": _percentile(late, 50),
            "late_p99_ms": _percentile(late, 99),
            "late_largest_ms": _percentile(late, 100),
            "work_p50_ms": _percentile(self.work_ms, 50),
            "work_p99_ms": _percentile(self.work_ms, 99),
            "histogram_from_ms": list(EDGES_ms),
            "histogram_frames": counts,
        }

    def __str__(self) -> str:
        if not len(self.late_ms):
            return "no frame was paced"
        d = self.as_dict()
        return (
            f"lateness of {d['frames']} frames: p50 {d['late_p50_ms']:.3f} ms,"
            f" p99 {d['late_p99_ms']:.3f} ms, largest {d['late_largest_ms']:.3f} ms;"
            f" {d['late_over_a_frame']} over a frame, {d['missed_deadlines']} deadlines missed;"
            f" a frame's work took {d['work_p50_ms']:.3f} of {d['frame_ms']:.3f} ms"
        )


def _percentile(values: NDArray[np.float32], share: float) -> float | None:
    return round(float(np.percentile(values, share)), 4) if len(values) else None


class Pacer:
    """Waits for each frame's deadline; `frames` is their largest number."""

    def __init__(
        self,
        frame_s: float,
        frames: int,
        clock: Clock = time.perf_counter,
        sleep: Sleep = time.sleep,
    ) -> None:
        self._frame_s, self._clock, self._sleep = frame_s, clock, sleep
        self._late = np.zeros(frames, np.float32)
        self._work = np.zeros(frames, np.float32)
        self._start = self._begun = 0.0
        self._frames = 0
        self.missed = 0
        self.late_s = 0.0  # of the last frame

    def wait(self) -> None:
        """Wait until the next frame is due."""
        k, now = self._frames, self._clock()
        if k == 0:
            self._start = now
        else:
            self._work[k - 1] = 1e3 * (now - self._begun)
        due = self._start + k * self._frame_s
        while now < due:
            self._sleep(due - now)
            now = self._clock()
        self.late_s = now - due
        self._late[k] = 1e3 * self.late_s
        missed = int(self.late_s / self._frame_s)
        if missed:
            self.missed += missed
            self._start += missed * self._frame_s
        self._begun = now
        self._frames = k + 1

    def recent(self) -> dict[str, Any]:
        """Return the figures of the last minute or so, for the page."""
        done, span = self._frames, 8192
        first = max(0, done - span)
        work = self._work[first : max(done - 1, first)]
        late = self._late[first:done]
        return Lateness(late, work, self.missed, 1e3 * self._frame_s).as_dict()

    def result(self) -> Lateness:
        """Return the lateness of the frames so far."""
        done = self._frames
        work = self._work[: max(done - 1, 0)]  # the last frame's is not complete
        return Lateness(self._late[:done], work, self.missed, 1e3 * self._frame_s)


@contextmanager
def real_time_priority(wanted: bool = True) -> Iterator[bool]:
    """Give this thread real-time priority in the context; yield whether the system granted it.

    Threads started in the context, such as the page's, run with ordinary priority.
    """
    if sys.platform != "linux" or not wanted:
        yield False
        return
    was, parameter = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        own_only = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, own_only, os.sched_param(PRIORITY))
    except OSError:
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, was, parameter)
