"""Where the fit of a breakaway begins: at the end of one to short replays, from afar."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent, End
from coupled.gap.search.fit import Fit
from coupled.gap.search.richer import richer_on_all
from coupled.gap.search.rivals import Found
from coupled.gap.search.shooting import shot, shot_starts
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from tests.support import gaps

PLAIN, LAW = BY_NAME["coulomb_friction"], BY_NAME["stribeck_friction"]
TRUE = {"friction_N": 2.0, "breakaway_N": 6.0, "stribeck_{d}_per_s": 2e-3}


@cache
def stuck(seed: int) -> tuple[Case, Fit]:
    """Return a record of a breakaway as a case, and plain friction fitted to half of it."""
    nominal = gaps.nominal_rig(False)
    with TemporaryDirectory() as folder:
        record = gaps.made(Path(folder), nominal, {LAW.name: TRUE}, seed)
    outputs = Reader(nominal, record, "column", surface_points).outputs()
    case = Case(nominal, "column", [output.halved(nominal) for output in outputs])
    return case, case.fit((PLAIN,), "fitted", descent=Descent("wide"))


@pytest.mark.parametrize("seed", [35, 38, 39])
def test_short_replays_lead_to_the_breakaway_from_afar(seed: int) -> None:
    """The law's own starts end in hollows: an order of slips that is not the record's."""
    case, plain = stuck(seed)
    (start,) = shot(case, LAW, PLAIN, plain)
    assert start[f"{LAW.name}.friction_N"] == pytest.approx(2.0, rel=0.05)
    assert start[f"{LAW.name}.breakaway_N"] == pytest.approx(6.0, rel=0.05)
    own = case.fit((LAW,), "fitted")
    begun = case.fit((LAW,), "fitted", start)
    assert begun.cost < 0.05 * own.cost
    assert begun.values[f"{LAW.name}.breakaway_N"] == pytest.approx(6.0, rel=0.02)


def test_a_law_that_holds_plain_friction_is_begun_there_and_nowhere_else() -> None:
    case, plain = stuck(35)
    starts = shot_starts(case, plain, LAW, [{}], [(PLAIN, plain)])
    assert [start[f"{LAW.name}.friction_N"] for start in starts] == [
        pytest.approx(2.0, rel=0.05),
        plain.values[f"{PLAIN.name}.friction_N"],
    ]
    uneven = BY_NAME["asymmetric_friction"]
    (begun,) = shot_starts(case, plain, uneven, [{"asymmetric_friction.pull_N": 1.25}], [])
    assert begun["asymmetric_friction.pull_N"] == 1.25


def test_what_plain_friction_leaves_open_is_asked_of_the_breakaway_on_all_of_the_record() -> None:
    """Half of the record had named plain friction, and no little breakaway is foretold to gain."""
    case, _ = stuck(38)
    current = case.fit((PLAIN,))
    step = Found(PLAIN, 100.0, 0.97, ())
    steps, fitted = richer_on_all(case, [PLAIN, LAW], [step], current)
    assert [one.effect for one in steps] == [LAW]
    assert fitted.cost < 0.05 * current.cost
    assert fitted.values[f"{LAW.name}.breakaway_N"] == pytest.approx(6.0, rel=0.02)


def test_a_short_replay_forgets_what_went_before() -> None:
    """Plain friction goes another way at each breakaway, and comes back to what was measured."""
    case, plain = stuck(35)
    (loader,) = [one for one in case.outputs if one.stage == "loader"]
    assert loader.by_shots().gap(plain.rig) < 0.7 * loader.gap(plain.rig)
    (linkage,) = [one for one in case.outputs if one.stage == "linkage"]
    assert linkage.by_shots() is linkage


def test_a_fit_ends_sooner_beside_dry_friction_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    case, _ = stuck(35)
    rubs: list[bool] = []
    end = Descent.end

    def asked(self: Descent, *given: Any) -> End:
        rubs.append(self.rubs)
        return end(self, *given)

    monkeypatch.setattr(Descent, "end", asked)
    case.fit((BY_NAME["bend"],), descent=Descent("wide", 2))
    assert rubs and not any(rubs)
    rubs.clear()
    case.fit((PLAIN,), "all", {}, PLAIN, Descent("wide", 2))
    assert rubs == [True]
