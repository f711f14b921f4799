"""Laws of the bend beside one another: which is named, and how well its number is known."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import pytest

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search import choose
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.search.information import shape_is_open
from coupled.rig.rig import Rig
from tests.support.rigs import bench

BEND, LOOP, MODE = (BY_NAME[name] for name in ("bend", "bend_hysteresis", "structural_mode"))
FILED = 9e-5


def rigged() -> Rig:
    return bench({"bend_m_per_N": FILED, "controls.column.compensation.bend_m_per_N": FILED})


def fitted(effect: Effect, *intervals: tuple[float, float]) -> Fit:
    """Return a fit whose numbers have these intervals."""
    keys = [effect.value_key(p) for p in effect.free]
    low = {key: one[0] for key, one in zip(keys, intervals, strict=True)}
    high = {key: one[1] for key, one in zip(keys, intervals, strict=True)}
    middle = {key: 0.5 * (low[key] + high[key]) for key in keys}
    return Fit((effect,), middle, low, high, (), rigged(), 1.0)


TOTAL = (9.1e-5, 9.3e-5)
OPEN_LOOP = fitted(LOOP, TOTAL, (0.17, 0.57), (-0.02, 0.31))
OPEN_MODE = fitted(MODE, TOTAL, (-63.0, 112.0), (-0.6, 0.9))


@pytest.mark.parametrize(
    ("effect", "found", "is_open"),
    [
        (LOOP, OPEN_LOOP, True),
        (LOOP, fitted(LOOP, TOTAL, (-0.1, 0.5), (9.0, 12.0)), True),
        (LOOP, fitted(LOOP, TOTAL, (0.17, 0.57), (9.0, 12.0)), False),
        (MODE, OPEN_MODE, True),
        (MODE, fitted(MODE, TOTAL, (2.8, 2.9), (-0.1, 0.9)), False),
    ],
    ids=["no width", "no share", "a loop", "no frequency", "a mode, however damped"],
)
def test_a_law_of_the_bend_is_open_where_its_own_numbers_may_be_none(
    effect: Effect, found: Fit, is_open: bool
) -> None:
    case = Case(rigged(), "column", [])
    assert shape_is_open(case, effect, found, BEND) is is_open
    assert not shape_is_open(case, effect, found, BY_NAME["servo_lag"])
    assert not shape_is_open(case, BEND, fitted(BEND, TOTAL), effect)


def test_how_fast_friction_fades_does_not_leave_its_breakaway_open() -> None:
    """The rate as it is filed is no sign that there is none: the breakaway says that."""
    stribeck = BY_NAME["stribeck_friction"]
    fading = rigged().controls["column"].loader.stribeck_rate
    found = fitted(stribeck, (3.9, 4.1), (6.0, 6.4), (0.5 * fading, 2.0 * fading))
    case = Case(rigged(), "column", [])
    assert not shape_is_open(case, stribeck, found, BY_NAME["coulomb_friction"])


@pytest.mark.parametrize(
    ("law", "more", "left", "named"),
    [
        (OPEN_LOOP, 8.0, 1.0, "bend"),
        (OPEN_LOOP, 13.0, 1.0, "bend_hysteresis"),
        (OPEN_LOOP, 8.0, 1.9, "bend_hysteresis"),
        (OPEN_MODE, 8.0, 1.0, "bend"),
        (fitted(LOOP, TOTAL, (0.17, 0.57), (9.0, 12.0)), 8.0, 1.0, "bend_hysteresis"),
    ],
    ids=["noise that it filters", "far more", "a gap left", "a mode's", "a loop that is sure"],
)
def test_an_open_law_has_to_gain_far_more_than_a_bend_that_closes_the_gap(
    law: Fit, more: float, left: float, named: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A loop of 0.15 N and a mode of 25 Hz filtered the noise of the force: 8 more than a bend."""
    settled = Fit((), {}, {}, {}, (), rigged(), 9.0)

    def gaps(_: object, rig: Rig) -> dict[str, float]:
        return {"linkage": 5.0 if rig is settled.rig else left}

    monkeypatch.setattr(choose, "stage_gaps", gaps)
    monkeypatch.setattr(choose, "stage_limits", lambda _: {"linkage": 1.1})
    case = cast(Case, SimpleNamespace(nominal=rigged(), control="column", outputs=[]))
    ranked = [
        Candidate(100.0 + more, law.effects[0], law),
        Candidate(100.0, BEND, fitted(BEND, TOTAL)),
    ]
    assert choose._simplest(case, settled, ranked).effect.name == named


def test_a_bend_is_known_by_how_far_it_is_from_the_one_filed() -> None:
    """So is a factor, and what the rig has none of; a limit by its own size.

    A bend 0.7 % above the filed one had an interval of 1.5 % of all of it, and said nothing.
    """
    [bend], [factor] = BEND.free, BY_NAME["servo_lag"].free
    [limit], [_, _, width] = BY_NAME["force_limit"].free, LOOP.free
    assert bend.error(9.2e-5, rigged(), "column") == pytest.approx(0.015 * 2e-6)
    assert factor.error(0.8, rigged(), "column") == pytest.approx(0.015 * 0.2)
    assert limit.error(49.5, rigged(), "column") == pytest.approx(0.015 * 49.5)
    assert width.error(12.0, rigged(), "column") == pytest.approx(0.015 * 12.0)
