"""Slopes of a residual: as by differences, for fewer replays; and flights that are not repeated."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.gap.search.descent import Descent, Slope, Slopes
from coupled.gap.stages.airframe import Flights
from coupled.gap.stages.openloop import Flown

Floats = NDArray[np.float64]
RNG = np.random.default_rng(9)
ENDS = (np.array([0.1, 0.1]), np.array([5.0, 5.0]))
LAW = 20.0 * RNG.normal(size=(400, 2))
CURVED = RNG.normal(size=(400, 2))
SAID = LAW @ [1.17, 0.9] + CURVED @ [1.17**2, 0.9**2] + RNG.normal(size=400)


class Curved:
    """A residual in floors, smooth in two numbers: counts how often it is asked for."""

    def __init__(self) -> None:
        self.asked = 0

    def __call__(self, scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        self.asked += 1
        made: Floats = LAW @ scaled + CURVED @ scaled**2 - SAID
        return made

    @staticmethod
    def jacobian(scaled: Floats) -> Floats:
        """Return it in closed form."""
        return LAW + 2.0 * CURVED * scaled


def test_a_smooth_fit_ends_where_the_gradient_is_none_with_the_slopes_of_there() -> None:
    begin, always = [np.array([1.0, 1.0])], Curved()
    Descent("coarse").end(always, begin, ENDS, stepped=True)  # as one that jumps: differences
    curved = Curved()
    found = Descent().end(curved, begin, ENDS, stepped=False)
    slopes = curved.jacobian(found.x)
    step = np.linalg.lstsq(slopes, found.fun, rcond=None)[0]
    error = np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))
    assert np.all(np.abs(step) < 0.05 * error)
    by_these = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    assert np.allclose(by_these, error, rtol=0.02)
    assert curved.asked < always.asked


def test_a_fit_that_goes_on_from_another_takes_no_differences() -> None:
    curved = Curved()
    found = Descent().end(curved, [np.array([1.0, 1.0])], ENDS, stepped=True)
    curved.asked = 0
    asked: list[int] = []
    for slope in (None, found.slope):
        Descent("own").end(curved, [found.x], ENDS, stepped=True, slope=slope)
        asked.append(curved.asked)
        curved.asked = 0
    assert asked[1] <= asked[0] - 2


def test_where_a_residual_that_jumps_has_moved_its_slopes_are_taken_anew() -> None:
    curved, x = Curved(), np.array([1.0, 1.0])
    wrong = Slope(x, curved(x), np.zeros((400, 2)))
    kept = Slopes(curved, ENDS, last=wrong)
    assert not kept(x + 1e-4).any()  # hardly moved: as they were
    assert np.allclose(kept(x + 0.1), curved.jacobian(x + 0.1), atol=0.5)
    of_others = Slope(x, np.zeros(7), np.zeros((7, 2)))
    assert Slopes(curved, ENDS, last=of_others)(x).any()


def test_a_smooth_residual_that_goes_otherwise_than_its_slopes_say_is_asked_anew() -> None:
    curved, x = Curved(), np.array([1.0, 1.0])
    wrong = Slope(x, curved(x), np.zeros((400, 2)))
    smooth = Slopes(curved, ENDS, last=wrong, smooth=True)
    assert np.allclose(smooth(x + 0.1), curved.jacobian(x + 0.1), atol=0.5)
    assert smooth.corrections == 0


def test_the_slopes_of_many_frames_are_not_kept() -> None:
    x = np.zeros(5)
    assert Slope(x, np.zeros(160_000), np.zeros((160_000, 5))).kept() is not None
    assert Slope(x, np.zeros(240_000), np.zeros((240_000, 5))).kept() is None


def test_an_equal_flight_is_flown_once_and_one_that_does_not_trim_is_not_tried_again() -> None:
    flights, flown = Flights(), list[str]()

    def fly() -> Flown:
        flown.append("one")
        return Flown(np.zeros((3, 1)), (0.0,))

    def fail() -> Flown:
        flown.append("none")
        raise InputError("rig", "flight", "does not trim")

    assert flights.of(("one",), fly) is flights.of(("one",), fly) is not None
    assert flights.of(("none",), fail) is flights.of(("none",), fail) is None
    assert flown == ["one", "none"]
