"""By how much an effect is worth having: what counts, and where it is counted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.gain import misfit, ranked_by_gain
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig
from tests.support.rigs import bench

FRAMES = 3000
NOISE = np.random.default_rng(5).normal(size=FRAMES)
OFFSET, DROPPED = BY_NAME["force_offset"], BY_NAME["dropped_frames"]


def filled(size: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.full(100, size)


def test_a_misfit_is_that_of_a_noise_known_beneath_the_floor_and_estimated_above() -> None:
    assert misfit(filled(1.0)) == 0.0
    assert misfit(filled(3.0)) == pytest.approx(np.log(9.0))
    assert misfit(filled(0.5)) == pytest.approx(-0.75)


@given(st.floats(0.05, 20.0), st.floats(1.0001, 1.5))
def test_a_misfit_grows_with_what_is_left_and_without_a_jump(size: float, times: float) -> None:
    more = misfit(filled(times * size)) - misfit(filled(size))
    assert 0.0 < more <= times**2 - 1.0 + 1e-9


def test_what_is_far_beneath_a_floor_outweighs_no_gap() -> None:
    """An offset of 16 floors was not found: beside it, δ̂ went from 0.005 to 0.064 of its floor."""

    def offset(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.full(FRAMES, rig.controls["column"].loader.offset)

    def estimate(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.full(FRAMES, 0.064 if rig.controls["column"].loader.offset else 0.005)

    loader = Output("loader", "x", 16.0 + np.repeat(NOISE[::20], 20), offset, 1.0, 120.0)
    quiet = Output("compensation", "y", np.zeros(FRAMES), estimate, 1.0, 120.0)
    case = Case(bench(), "column", [loader, quiet])
    found = case.fit((OFFSET,), "fitted")
    [one] = ranked_by_gain(case.outputs, case.fit(()), [(OFFSET, found)])
    assert one.gain > 200.0


def test_events_that_are_seen_count_wherever_they_lie() -> None:
    """A host missed frames in the first second alone, of a half that is fitted, not held out."""
    missed = np.zeros(FRAMES, dtype=bool)
    missed[[30, 31, 70]] = True

    def gradient(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return 200.0 * missed if rig.controls["column"].compensation.missed_share else 0.0 * NOISE

    output = Output("schedule", "x", NOISE + 200.0 * missed, gradient, 1.0, 120.0, missed=missed)
    case = Case(bench(), "column", [output])
    assert not output.rows("held")[missed].any()
    dropped = replace(case.fit(()), rig=case.fit((DROPPED,)).rig)
    [one] = ranked_by_gain(case.outputs, case.fit(()), [(DROPPED, dropped)])
    assert one.gain > 1000.0
