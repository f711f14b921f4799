"""Real time by absolute deadlines, on a clock of the test's own."""

from __future__ import annotations

import os
import sys
import threading

import numpy as np
import pytest

from coupled.live.pacing import EDGES_ms, Pacer, real_time_priority

FRAME_s = 1.0 / 128.0  # exact in binary, so that the sums are


class Clock:
    """A clock that only sleeping and work move; a sleep may take longer than asked."""

    def __init__(self, overslept: float = 0.0) -> None:
        self.now, self.overslept = 100.0, overslept

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0.0
        self.now += seconds + self.overslept


def test_lateness_does_not_add_up() -> None:
    clock = Clock(overslept=2.0**-12)
    pacer = Pacer(FRAME_s, 100, clock, clock.sleep)
    for _ in range(100):
        pacer.wait()
        clock.now += 2.0**-10  # work
    found = pacer.result()
    assert clock.now - 100.0 == 99 * FRAME_s + 2.0**-12 + 2.0**-10
    assert found.late_ms[1:] == pytest.approx(1e3 * 2.0**-12)
    assert found.work_ms == pytest.approx(1e3 * 2.0**-10)
    assert found.missed == 0


def test_a_late_frame_is_flown_at_once_and_the_next_keeps_its_deadline() -> None:
    clock = Clock()
    pacer = Pacer(FRAME_s, 10, clock, clock.sleep)
    pacer.wait()
    clock.now += 1.5 * FRAME_s  # the first frame's work
    pacer.wait()
    assert pacer.late_s == 0.5 * FRAME_s
    pacer.wait()
    assert pacer.late_s == 0.0
    assert clock.now == 100.0 + 2 * FRAME_s


def test_missed_deadlines_are_counted_and_not_made_up_for() -> None:
    clock = Clock()
    pacer = Pacer(FRAME_s, 10, clock, clock.sleep)
    pacer.wait()
    clock.now += 4.25 * FRAME_s
    begun = []
    for _ in range(3):
        pacer.wait()
        begun.append(clock.now)
    assert pacer.missed == 3
    assert begun == [100.0 + n * FRAME_s for n in (4.25, 5.0, 6.0)]
    said = pacer.result().as_dict()
    assert said["late_over_a_frame"] == 1
    assert said["missed_deadlines"] == 3
    assert said["late_largest_ms"] == pytest.approx(3.25e3 * FRAME_s, rel=1e-4)


def test_of_a_hundred_frames_one_is_later_than_the_99th_percentile() -> None:
    clock, step_s = Clock(), 2.0**-15
    pacer = Pacer(FRAME_s, 101, clock, clock.sleep)
    pacer.wait()  # on time
    for k in np.random.default_rng(5).permutation(np.arange(1, 101)):
        clock.overslept = int(k) * step_s
        pacer.wait()
    said = pacer.result().as_dict()
    for name, steps in (("p50", 50), ("p99", 99), ("largest", 100)):
        assert said[f"late_{name}_ms"] == pytest.approx(1e3 * steps * step_s, abs=1e-4)


def test_of_the_work_of_a_hundred_frames_one_took_longer_than_its_99th_percentile() -> None:
    clock, step_s = Clock(), 2.0**-15
    pacer = Pacer(FRAME_s, 102, clock, clock.sleep)
    pacer.wait()
    for k in np.random.default_rng(5).permutation(np.arange(101)):
        clock.now += int(k) * step_s  # within its frame
        pacer.wait()
    said = pacer.result().as_dict()
    for name, steps in (("p50", 50), ("p99", 99)):
        assert said[f"work_{name}_ms"] == pytest.approx(1e3 * steps * step_s, abs=1e-4)


@pytest.mark.parametrize(("late", "passed"), [(0.75, 0), (1.0, 1), (1.75, 1), (2.75, 2)])
def test_a_deadline_is_missed_once_it_has_passed(late: float, passed: int) -> None:
    """A frame that begins `late` frames after its deadline: so many later ones have passed."""
    clock = Clock()
    pacer = Pacer(FRAME_s, 10, clock, clock.sleep)
    pacer.wait()
    clock.now += (1.0 + late) * FRAME_s
    pacer.wait()
    assert pacer.missed == passed
    pacer.wait()
    assert clock.now == 100.0 + (2 + passed) * FRAME_s


def test_the_histogram_counts_every_frame() -> None:
    clock = Clock(overslept=3e-4)
    pacer = Pacer(FRAME_s, 50, clock, clock.sleep)
    for _ in range(50):
        pacer.wait()
    said = pacer.result().as_dict()
    assert sum(said["histogram_frames"]) == 50 == said["frames"]
    assert said["histogram_frames"][EDGES_ms.index(0.2)] == 49  # the first is not waited for


@pytest.mark.skipif(sys.platform != "linux", reason="the class SCHED_FIFO is Linux's")
def test_only_the_thread_that_flies_goes_first_and_only_while_it_flies() -> None:
    before = os.sched_getscheduler(0)
    seen: list[int] = []
    with real_time_priority() as granted:
        mine = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        assert mine == (os.SCHED_FIFO if granted else before)
        other = threading.Thread(target=lambda: seen.append(os.sched_getscheduler(0)))
        other.start()
        other.join()
    assert seen == [os.SCHED_OTHER] or not granted
    assert os.sched_getscheduler(0) == before


def test_a_flight_continues_without_real_time_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse, raising=False)
    with real_time_priority() as granted:
        assert not granted
    with real_time_priority(wanted=False) as granted:
        assert not granted
