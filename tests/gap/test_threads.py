"""A diagnosis by several threads is that of one, and fits nothing twice."""

from __future__ import annotations

from typing import Any

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search import fit as fitting
from coupled.gap.search.case import Case
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
from tests.support import gaps

RIG = gaps.nominal_rig(False)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return gaps.made(tmp_path_factory.mktemp("made"), RIG, {"bend": {"bend_{d}_per_N": 1e-4}}, 3)


def test_two_threads_give_the_answer_of_one_to_the_bit(record: Record) -> None:
    short = record.between(0.0, 12.0)
    one, two = (diagnose(RIG, {"r": short}, workers=n).as_dict() for n in (1, 2))
    assert one == two


def test_a_fit_that_is_known_is_not_made_again(
    record: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, ...]] = []
    made = fitting._fit

    def counted(*given: Any) -> Any:
        asked.append(tuple(effect.name for effect in given[3]))
        return made(*given)

    monkeypatch.setattr(fitting, "_fit", counted)
    reader = Reader(RIG, record.between(0.0, 12.0), "column", surface_points)
    case = Case(RIG, "column", reader.outputs())
    bend = BY_NAME["bend"]
    first = case.fit((bend,), "fitted")
    done = len(asked)
    assert done > 0
    assert case.fit((bend,), "fitted") == first
    assert case.fit((bend,), "fitted", first.values) == first  # starts where the first ended
    assert len(asked) == done
    other = {**first.values, bend.value_key(bend.free[0]): 3e-4}
    assert case.fit((bend,), "fitted", other).values != {}
    case.fit((bend,), "held", first.values)  # another part is another fit
    assert len(asked) > done + 1
