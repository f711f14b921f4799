"""Threads that share one piece of work: its order, its faults, and its end."""

from __future__ import annotations

import importlib
import os
import threading
import time

import numpy as np
import pytest

from coupled.parallel import WorkCancelledError, cores, go_on, in_threads, threads


def test_several_threads_return_what_one_returns_in_the_same_order() -> None:
    def square(x: int) -> int:
        time.sleep(0.001 * (x % 3))
        return x * x

    alone = in_threads(square, range(20))
    with threads(2):
        assert in_threads(square, range(20)) == alone == [x * x for x in range(20)]


def _idents() -> set[int]:
    def at_work(_: int) -> int:
        time.sleep(0.002)
        return threading.get_ident()

    return set(in_threads(at_work, range(4)))


def test_two_threads_work_at_once_and_their_own_work_has_no_more() -> None:
    met = threading.Barrier(2, timeout=10.0)

    def meet(_: int) -> set[int]:
        met.wait()  # breaks unless another is there
        inner = _idents()
        met.wait()
        return inner

    with threads(2):
        one, other = in_threads(meet, range(2))
    assert len(one) == len(other) == 1
    assert one != other


@pytest.mark.parametrize("first", [0, 1])
def test_work_within_work_takes_the_thread_that_is_done(first: int) -> None:
    met = threading.Barrier(2, timeout=10.0)

    def meet(number: int) -> bool:
        met.wait()
        until_s = time.monotonic() + 10.0
        while number == first:
            if len(_idents()) == 2:
                return True
            assert time.monotonic() < until_s
        return False

    with threads(2):
        assert in_threads(meet, range(2)) == [first == 0, first == 1]


def test_one_thread_is_the_default() -> None:
    assert set(in_threads(lambda _: threading.get_ident(), range(4))) == {threading.get_ident()}


def test_a_fault_is_raised_where_the_work_was_asked_for_and_halts_the_rest() -> None:
    met, halted = threading.Barrier(2, timeout=10.0), threading.Event()

    def one(x: int) -> None:
        met.wait()
        if x == 0:
            raise KeyError("broken")
        try:
            while True:
                go_on()
                time.sleep(0.001)
        except WorkCancelledError:
            halted.set()
            raise

    with threads(2), pytest.raises(KeyError, match="broken"):
        in_threads(one, range(2))
    assert halted.is_set()
    go_on()  # what comes after goes on


def test_a_fault_halts_the_work_within_the_others_work() -> None:
    met, halted = threading.Barrier(2, timeout=10.0), threading.Event()

    def inner(_: int) -> None:
        while True:
            go_on()
            time.sleep(0.001)

    def one(x: int) -> None:
        met.wait()
        if x == 0:
            raise KeyError("broken")
        try:
            in_threads(inner, range(2))
        except WorkCancelledError:
            halted.set()
            raise

    with threads(2), pytest.raises(KeyError, match="broken"):
        in_threads(one, range(2))
    assert halted.is_set()


def test_an_interruption_halts_the_helpers() -> None:
    main, halted = threading.current_thread(), threading.Event()
    met = threading.Barrier(2, timeout=10.0)

    def one(_: int) -> None:
        met.wait()
        if threading.current_thread() is main:
            raise KeyboardInterrupt
        try:
            while True:
                go_on()
                time.sleep(0.001)
        finally:
            halted.set()

    with threads(2), pytest.raises(KeyboardInterrupt):
        in_threads(one, range(2))
    assert halted.wait(10.0)


def test_linear_algebra_has_one_thread_within_and_its_own_again_after() -> None:
    """Its threads took as much processor time again from those of a diagnosis."""
    np.linalg.qr(np.eye(3))  # what is not loaded has no threads
    info = importlib.import_module("threadpoolctl").threadpool_info

    def counts() -> list[int]:
        return [pool["num_threads"] for pool in info() if pool["user_api"] == "blas"]

    before = counts()
    with threads(2):
        assert set(counts()) == {1}
    assert counts() == before


def test_the_number_of_cores_is_the_one_that_is_set(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHON_CPU_COUNT", "3")
    assert [cores(0), cores(2)] == [3, 2]


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system limits no process")
@pytest.mark.parametrize("given", ["", "default", "0"])
def test_a_process_limited_to_one_core_uses_one(
    monkeypatch: pytest.MonkeyPatch, given: str
) -> None:
    monkeypatch.setenv("PYTHON_CPU_COUNT", given)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert cores(0) == 1
    finally:
        os.sched_setaffinity(0, before)
    assert cores(0) == len(before)
