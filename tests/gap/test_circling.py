"""A search whose effects displace one another ends, and is known to have been ended."""

from __future__ import annotations

import pytest

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search import choose
from coupled.gap.search.case import Case
from coupled.gap.search.choose import searched
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from tests.support import gaps

RIG = gaps.nominal_rig(False)
FIRST, SECOND, THIRD = (BY_NAME[n] for n in ("force_zero", "deflection_zero", "arc_geometry"))


def fit_of(effects: tuple[Effect, ...]) -> Fit:
    return Fit(effects, {}, {}, {}, (), RIG, 0.0)


def test_effects_that_displace_one_another_end_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    rounds: list[tuple[str, ...]] = []

    def next_of(case: Case, settled: Fit, current: Fit, *_: object) -> list[Candidate]:
        rounds.append(tuple(effect.name for effect in current.effects))
        assert len(rounds) < 20
        best = next(one for one in (FIRST, SECOND, THIRD) if one not in current.effects)
        return [Candidate(50.0, best, fit_of((*current.effects, best)))]

    def first_of_two(case: Case, current: Fit) -> Effect | None:
        return current.effects[0] if len(current.effects) > 1 else None

    def unfitted(self: Case, effects: tuple[Effect, ...] = (), *_: object, **__: object) -> Fit:
        return fit_of(tuple(effects))

    monkeypatch.setattr(Case, "fit", unfitted)
    monkeypatch.setattr(choose, "_round", next_of)
    monkeypatch.setattr(choose, "_needless", first_of_two)
    monkeypatch.setattr(choose, "is_open", lambda *_: False)
    found = searched(Case(RIG, "column", []), list(BY_NAME.values()))
    assert found.circled
    assert len(found.steps) == 1
