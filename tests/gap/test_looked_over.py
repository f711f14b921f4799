"""What is looked at once more when a search has ended: the law of friction, and fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search import choose
from coupled.gap.search.case import Case
from coupled.gap.search.choose import _law_again, _with_only
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.search.rivals import Found
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig
from tests.support.rigs import bench

FRAMES = 2400
SHAPE, OTHER, NOISE, THIRD = np.random.default_rng(2).normal(size=(4, FRAMES))
OFFSET, PLAIN, RICHER = (
    BY_NAME[name] for name in ("force_offset", "coulomb_friction", "stribeck_friction")
)
UNEVEN = BY_NAME["asymmetric_friction"]


def rubbing_with_an_offset() -> Case:
    def predict(rig: Rig) -> NDArray[np.float64]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * SHAPE + loader.friction * OTHER)

    measured = 3.0 * SHAPE + 2.0 * OTHER + NOISE
    return Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])


def steps_of(*effects: Effect) -> list[Found]:
    return [Found(effect, 50.0, 1.0, ()) for effect in effects]


@pytest.mark.parametrize(("gain", "named"), [(40.0, RICHER), (5.0, PLAIN)])
def test_a_law_of_friction_is_asked_again_beside_what_was_found_later(
    monkeypatch: pytest.MonkeyPatch, gain: float, named: Effect
) -> None:
    """Before the offset was known, plain friction passed for a breakaway."""
    case = rubbing_with_an_offset()
    asked: list[tuple[set[str], set[bool]]] = []

    def candidates(
        case: Case, without: Fit, library: list[Effect], outputs: set[str]
    ) -> list[Candidate]:
        asked.append(({one.name for one in without.effects}, {one.dry for one in library}))
        return [Candidate(gain, RICHER, case.fit((*without.effects, RICHER), "fitted"))]

    monkeypatch.setattr(choose, "fitted_candidates", candidates)
    current = case.fit((PLAIN, OFFSET))
    library = [OFFSET, PLAIN, RICHER]
    steps, anew = _law_again(case, case.fit(()), library, steps_of(PLAIN, OFFSET), current)
    assert asked == [({"force_offset"}, {True})]
    assert [step.effect for step in steps] == [named, OFFSET]
    assert set(anew.effects) == {named, OFFSET}


@pytest.mark.parametrize(
    ("above_N", "tried", "named"),
    [(0.0, PLAIN, PLAIN), (4.0, PLAIN, RICHER), (0.0, UNEVEN, RICHER)],
)
def test_a_breakaway_that_took_up_what_was_found_later_is_plain_friction(
    monkeypatch: pytest.MonkeyPatch, above_N: float, tried: Effect, named: Effect
) -> None:
    """Beside a damping, one of 1.50 N above 1.29 came to 1.41 ± 0.10 above 1.40."""

    def predict(rig: Rig) -> NDArray[np.float64]:
        loader = rig.controls["column"].loader
        above = max(loader.breakaway - loader.friction, 0.0)
        return np.asarray(loader.offset * SHAPE + loader.friction * OTHER + above * THIRD)

    measured = 3.0 * SHAPE + 2.0 * OTHER + above_N * THIRD + NOISE
    case = Case(bench(), "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])

    def candidates(
        case: Case, without: Fit, library: list[Effect], outputs: set[str]
    ) -> list[Candidate]:
        fits = [(law, case.fit((*without.effects, law), "fitted")) for law in (RICHER, tried)]
        return [Candidate(40.0, law, fitted) for law, fitted in fits]

    monkeypatch.setattr(choose, "fitted_candidates", candidates)
    current = case.fit((RICHER, OFFSET))
    library = [OFFSET, PLAIN, RICHER]
    steps, anew = _law_again(case, case.fit(()), library, steps_of(RICHER, OFFSET), current)
    assert [step.effect for step in steps] == [named, OFFSET]
    assert set(anew.effects) == {named, OFFSET}


def test_an_effect_dropped_leaves_the_best_fit_that_is_known() -> None:
    """A refit from where the other effect had moved the numbers may end in a hollow."""
    case = rubbing_with_an_offset()
    both, known = case.fit((PLAIN, OFFSET)), case.fit((PLAIN,))
    assert _with_only(case, [], steps_of(PLAIN), both).cost == pytest.approx(known.cost, rel=1e-3)
    better = replace(known, cost=0.5 * known.cost)
    assert _with_only(case, [case.fit(()), better, both], steps_of(PLAIN), both) is better


@pytest.mark.parametrize("open_one", [True, False], ids=["open", "needless"])
def test_what_took_another_s_place_is_asked_what_it_leaves_of_the_others(
    monkeypatch: pytest.MonkeyPatch, open_one: bool
) -> None:
    """A bend in a lag's place took all of a scale found first, which stayed in the answer."""
    case = rubbing_with_an_offset()
    lag, bend, scale = RICHER, PLAIN, BY_NAME["deflection_scale"]

    def taken(case: Case, current: Fit, step: Found) -> tuple[Found, Fit]:
        if step.effect is not lag:
            return step, current
        effects = [bend if one is lag else one for one in current.effects]
        return replace(step, effect=bend), replace(current, effects=tuple(effects))

    def is_open(case: Case, effect: Effect, fitted: Fit) -> bool:
        return open_one and effect is scale and lag not in fitted.effects

    def needless(case: Case, current: Fit) -> Effect | None:
        return scale if not open_one and scale in current.effects else None

    monkeypatch.setattr(choose, "overtaken", taken)
    monkeypatch.setattr(choose, "is_open", is_open)
    monkeypatch.setattr(choose, "_needless", needless)
    for name in ("plainer_on_all", "richer_on_all"):
        monkeypatch.setattr(choose, name, lambda case, library, steps, fit: (steps, fit))
    monkeypatch.setattr(choose, "_law_again", lambda case, s, library, steps, fit: (steps, fit))
    for name in ("separated", "distinguished"):
        monkeypatch.setattr(choose, name, lambda case, fit, step: (step, fit))
    for name in ("switched", "same_in_a_limit"):
        monkeypatch.setattr(choose, name, lambda case, library, fit, step: (step, fit))
    monkeypatch.setattr(choose, "in_place_of_open", lambda case, steps, fit: (steps, fit))
    monkeypatch.setattr(choose, "tried_again", lambda case, fit, step: step)
    monkeypatch.setattr(choose, "yielding_reading", lambda case, fit: None)
    rival = Candidate(1.0, BY_NAME["force_offset"], case.fit(()))
    monkeypatch.setattr(
        choose,
        "with_richer_rivals",
        lambda case, library, steps, fit: [replace(one, rivals=(rival,)) for one in steps],
    )
    current = replace(case.fit((lag,)), effects=(scale, lag))
    steps, last = choose._looked_over(case, [], [case.fit(())], steps_of(scale, lag), current)
    assert [(step.effect, step.rivals) for step in steps] == [(bend, (rival,))]
    assert set(last.effects) == {bend}
