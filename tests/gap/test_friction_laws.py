"""Laws of dry friction beside one another: what a richer one is foretold to gain."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.search import laws
from coupled.gap.search.candidates import fitted_candidates
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import ranked_by_gain
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import SIMPLER_GAIN
from tests.support.gaps import made, nominal_rig

PLAIN, STRIBECK = BY_NAME["coulomb_friction"], BY_NAME["stribeck_friction"]
UNEVEN = BY_NAME["asymmetric_friction"]
MADE = {
    "plain": {"coulomb_friction": {"friction_N": 3.0}},
    "breaks away a little": {
        "stribeck_friction": {
            "friction_N": 2.0,
            "breakaway_N": 2.3,
            "stribeck_{d}_per_s": 4e-3,
        }
    },
}


def judged(folder: Path, name: str) -> Case:
    rig = nominal_rig(False)
    record = made(folder, rig, MADE[name], 31)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    loader = [one.halved(rig) for one in outputs if one.stage == "loader"]
    return Case(rig, "column", loader)


def plainly(case: Case) -> Fit:
    """Return plain friction fitted as a search does, by wide steps and then by its own."""
    wide = case.fit((PLAIN,), "fitted", only=PLAIN, descent=Descent("wide"))
    return case.fit((PLAIN,), "fitted", wide.values, PLAIN, Descent("own"), wide)


@pytest.mark.slow
def test_a_richer_law_is_not_fitted_where_the_plain_one_leaves_noise(tmp_path: Path) -> None:
    """Neither a breakaway nor another friction to one side is foretold to gain anything."""
    case = judged(tmp_path, "plain")
    fitted = [(PLAIN, plainly(case))]
    assert laws.leaves_only_noise(case, *fitted[0])
    for law in (STRIBECK, UNEVEN):
        foretold = laws.foretold(case, law, *fitted[0])
        assert foretold is not None and 0.0 <= foretold < SIMPLER_GAIN
        assert not laws.may_gain(case, law, fitted)
    assert laws.may_gain(case, BY_NAME["load_friction"], fitted)  # it does not hold the plain one
    said: list[str] = []
    case = replace(case, tell=lambda words, done, of: said.append(words))
    ranked = fitted_candidates(case, case.fit(()), EFFECTS, {"loader"})
    assert ranked[0].effect is PLAIN
    assert "fitting load_friction" in said and "fitting stribeck_friction" not in said


@pytest.mark.slow
def test_a_breakaway_that_shows_is_foretold_as_its_fit_finds_it(tmp_path: Path) -> None:
    case = judged(tmp_path, "breaks away a little")
    plain = plainly(case)
    foretold = laws.foretold(case, STRIBECK, PLAIN, plain)
    assert foretold is not None and foretold > 2.0 * SIMPLER_GAIN
    starts = laws.law_starts(case, STRIBECK, [], [(PLAIN, plain)])
    fits = [(STRIBECK, case.fit((STRIBECK,), "fitted", start, STRIBECK)) for start in starts]
    assert ranked_by_gain(case.outputs, plain, fits)[0].gain > foretold


def test_a_law_that_cannot_be_tried_is_fitted(tmp_path: Path) -> None:
    """Where the slopes of the plain one are not known, nothing is foretold."""
    case = judged(tmp_path, "plain")
    unknown = replace(plainly(case), slopes={})
    assert laws.foretold(case, STRIBECK, PLAIN, unknown) is None
    assert laws.may_gain(case, STRIBECK, [(PLAIN, unknown)])


@pytest.mark.parametrize(("amplitude_N", "yields_m"), [(8.0, 4e-4), (45.0, 2e-5)])
def test_friction_by_a_light_load_may_yield_as_any_does(
    tmp_path: Path, amplitude_N: float, yields_m: float
) -> None:
    """At 8 N a contact that yields by 0.4 mm stood at its bound, as if at 50 N, and left a gap."""
    rig, load = nominal_rig(False), BY_NAME["load_friction"]
    contact = {"friction_stiffness_N_per_m": 0.3 * amplitude_N / yields_m}
    real = rig.changed({f"controls.column.loader.{key}": v for key, v in contact.items()})
    record = made(tmp_path, real, {"load_friction": {"factor": 0.3}}, 31, amplitude_N)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    loader = [one.halved(rig) for one in outputs if one.stage == "loader"]
    case = Case(rig, "column", loader)
    found = case.fit((load,))
    assert found.values["load_friction.factor"] == pytest.approx(0.3, rel=0.02)
    assert case.gaps(found.rig)["loader"] < 1.1
