"""A diagnosis by several threads is that of one, and fits nothing twice."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Floats, Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support import gaps

RIG = gaps.nominal_rig(False)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Record:
    return gaps.made(tmp_path_factory.mktemp("made"), RIG, {"bend": {"bend_{d}_per_N": 1e-4}}, 3)


@pytest.mark.slow
def test_two_threads_give_the_answer_of_one_to_the_bit(record: Record) -> None:
    short = record.between(0.0, 12.0)
    one, two = (diagnose(RIG, {"r": short}, workers=n).as_dict() for n in (1, 2))
    assert one == two


def test_a_fit_that_is_known_is_not_made_again(record: Record) -> None:
    asked: list[Rig] = []

    def counted(output: Output) -> Output:
        def predict(rig: Rig) -> Floats:
            asked.append(rig)
            return output.predict(rig)

        return replace(output, predict=predict)

    reader = Reader(RIG, record.between(0.0, 12.0), "column", surface_points)
    problem = Problem(Case(RIG, "column", [counted(one) for one in reader.outputs()]))
    bend = BY_NAME["bend"]
    first = problem.fit((bend,), part="fitted")
    done = len(asked)
    assert done > 0
    assert problem.fit((bend,), part="fitted") == first
    begun = problem.fit((bend,), first.values, part="fitted")
    assert begun == first  # it starts where the first ended
    assert len(asked) == done
    problem.fit((bend,), first.values, part="held")  # another part is another fit
    assert len(asked) > done
