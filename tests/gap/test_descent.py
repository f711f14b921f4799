"""Where a fit ends: at the least by the loader's own steps, from the start that leads there."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.noise.noise import filtered
from coupled.gap.search.descent import Descent, leaves_noise
from coupled.gap.signals.output import Output, coarsely_stepped
from coupled.gap.thresholds import ROUNDS, COARSE_STEPS_Hz
from coupled.rig.rig import Rig
from tests.support import gaps

Floats = NDArray[np.float64]
RNG = np.random.default_rng(5)
LAW, SAID = RNG.normal(size=(200, 2)), RNG.normal(size=200)
SURE = 0.25 / np.sqrt(200)  # a fourth of what the rows know a number by
ENDS = (np.full(2, -5.0), np.full(2, 5.0))
RIG = gaps.nominal_rig(False)


def straight(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
    """Return a linear residual; with coarse steps, one whose least is elsewhere."""
    return LAW @ scaled - SAID + (0.3 * LAW[:, 0] if coarse else 0.0)


def test_a_fit_ends_at_the_least_by_own_steps_and_not_by_coarse_ones() -> None:
    least = np.linalg.lstsq(LAW, SAID, rcond=None)[0]
    begin = [np.array([1.0, 1.0])]
    assert np.allclose(Descent().end(straight, begin, ENDS, stepped=True).x, least, atol=SURE)
    found = Descent("coarse").end(straight, begin, ENDS, stepped=True).x
    assert np.allclose(found, least - [0.3, 0.0], atol=SURE)


def test_slopes_may_be_rough_and_the_end_is_the_exact_residuals() -> None:
    """Differences ask for what costs less; what is made least is what was asked for."""
    asked: list[bool] = []

    def replayed(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        asked.append(rough)
        return straight(scaled) + (0.05 * LAW[:, 1] * scaled[1] if rough else 0.0)

    least = np.linalg.lstsq(LAW, SAID, rcond=None)[0]
    found = Descent("own").end(replayed, [np.array([1.0, 1.0])], ENDS, stepped=True)
    assert np.allclose(found.x, least, atol=0.02)
    assert found.fun == pytest.approx(straight(found.x))
    assert asked.count(True) > asked.count(False)


@pytest.mark.parametrize(
    ("memory", "dry", "sooner"), [(0.0, True, False), (0.97, True, True), (0.97, False, False)]
)
def test_a_fit_of_dry_friction_ends_sooner_where_the_rest_remembers_itself(
    memory: float, dry: bool, sooner: bool
) -> None:
    """A frame of it says less, and the last steps along a valley gain nothing that it tells."""
    white = np.random.default_rng(7).normal(size=800)
    left = filtered([np.sqrt(1.0 - memory**2)], [1.0, -memory], white)
    asked: list[int] = []

    def valley(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        asked.append(1)
        return np.concatenate((left, [60.0 * (scaled[1] - scaled[0] ** 2), 4.0 * (1 - scaled[0])]))

    Descent(dry=dry).end(valley, [np.array([-1.2, 1.0])], ENDS, stepped=False)
    assert (len(asked) < 60) == sooner


def test_of_two_starts_the_one_that_leads_lower_is_kept_whatever_their_order() -> None:
    def double(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        """Return a residual with two hollows, at -2 and 2, of which the one at 2 is deeper."""
        return np.concatenate(((scaled[0] ** 2 - 4.0) * np.ones(50), 0.5 * (scaled - 2.0)))

    for starts in ([-2.2, 2.5], [2.5, -2.2]):
        firsts = [np.array([start]) for start in starts]
        found = Descent().end(double, firsts, (np.array([-5.0]), np.array([5.0])), stepped=False)
        assert np.allclose(found.x, 2.0, atol=1e-3)


def test_a_start_that_is_far_behind_is_given_up() -> None:
    asked: list[float] = []

    def far(scaled: Floats, coarse: bool = False, rough: bool = False) -> Floats:
        """Return a residual with a flat shelf far off, from which nothing leads away."""
        asked.append(float(scaled[0]))
        return np.full(50, 2.0 + min(float(scaled[0] - 1.0) ** 2, 50.0 + 1e-3 * float(scaled[0])))

    ends = (np.array([0.0]), np.array([100.0]))
    Descent().end(far, [np.array([90.0]), np.array([1.5])], ends, stepped=False)
    on_the_shelf = sum(value > 10.0 for value in asked)
    assert 0 < on_the_shelf <= 3 * (2 * ROUNDS)


def test_what_is_left_is_noise_up_to_a_tenth_more() -> None:
    assert leaves_noise(0.5 * 1.09**2 * 1000, 1000)
    assert not leaves_noise(0.5 * 1.11**2 * 1000, 1000)


def test_coarse_steps_are_those_of_the_loader_alone_and_only_where_asked_for() -> None:
    coarse = coarsely_stepped(RIG)
    assert coarse.substeps == COARSE_STEPS_Hz / RIG.frame_rate < RIG.substeps
    assert coarse.controls == RIG.controls
    assert coarsely_stepped(coarse) == coarse
    seen: list[int] = []

    def predicted(rig: Rig) -> Floats:
        seen.append(rig.substeps)
        return np.zeros(3)

    one = Output("loader", "column_computed_m", np.ones(3), predicted, 1.0, 120.0, stepped=True)
    other = Output("schedule", "column_gradient", np.ones(3), predicted, 1.0, 120.0)
    for output in (one, other):
        for asked in (False, True):
            output.residual(RIG, coarse=asked)
    assert seen == [RIG.substeps, coarse.substeps, RIG.substeps]


def test_a_coarsely_stepped_rig_can_be_changed_as_any_other() -> None:
    key = "controls.column.loader.friction_N"
    assert coarsely_stepped(RIG).changed({key: 2.0}) == coarsely_stepped(RIG.changed({key: 2.0}))
