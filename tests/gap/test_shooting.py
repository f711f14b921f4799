"""Where the fit of a breakaway begins: at the end of one to short replays, from afar."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from coupled.gap.effects.effect import possible
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search import anew, choose, richer
from coupled.gap.search.anew import with_contact_anew, with_settings_anew
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent, End
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.search.richer import richer_on_all
from coupled.gap.search.rivals import Found
from coupled.gap.search.shooting import screened_short, shot, shot_contact, shot_starts
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import FAR_BELOW_NOISE, RIVAL_GAIN
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


@pytest.mark.parametrize(
    "seed", [35, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (38, 42, 43))]
)
def test_short_replays_lead_to_the_breakaway_from_afar(seed: int) -> None:
    """The law's own starts end in hollows: an order of slips that is not the record's.

    They do in six of the seeds 35 to 46.
    """
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


@pytest.mark.slow
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


@cache
def sticking() -> tuple[Case, Fit]:
    """Return a record of filed friction that yields by 0.1 mm as a case, and its settings."""
    filed = gaps.nominal_rig(False).changed({"controls.column.loader.friction_N": 6.0})
    contact = {"friction_stiffness_N_per_m": 6e4, "friction_elastic_share": 0.77}
    real = filed.changed({f"controls.column.loader.{key}": v for key, v in contact.items()})
    with TemporaryDirectory() as folder:
        record = gaps.made(Path(folder), real, {}, 1)
    outputs = Reader(filed, record, "column", surface_points).outputs()
    case = Case(filed, "column", [output.halved(filed) for output in outputs])
    return case, case.fit(())


def far_off(case: Case, settled: Fit) -> Fit:
    """Return settings that a hollow holds: a contact that yields by little, a mass too large."""
    length, share = (one.value_key(one.free[0]) for one in case.contact)
    inertia = case.known["inertia"]
    values = {**settled.values, length: 2e-5, share: 0.1, inertia.value_key(inertia.free[0]): 1.02}
    rig = possible(case.nominal, case.control, case.nuisances(()), values)
    assert rig is not None
    return replace(settled, values=values, rig=rig, cost=1e9)


def test_short_replays_find_how_friction_yields_from_afar() -> None:
    case, settled = sticking()
    found = shot_contact(case, far_off(case, settled))
    assert found is not None
    length, share = (one.value_key(one.free[0]) for one in case.contact)
    assert found.values[length] == pytest.approx(1e-4, rel=0.15)
    assert found.values[share] == pytest.approx(0.77, abs=0.1)
    assert shot_contact(replace(case, outputs=[]), settled) is None


def test_a_fit_over_its_limit_is_begun_where_short_replays_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The contact as it is sought stands in a hollow, too: a mode was found with a damping."""
    case, settled = sticking()
    current = far_off(case, settled)
    monkeypatch.setattr(anew, "_begun", lambda case, effects, start: _at(case, current, start))
    length = case.contact[0].value_key(case.contact[0].free[0])
    assert with_contact_anew(case, current).values[length] == pytest.approx(1e-4, rel=0.15)
    monkeypatch.setattr(anew, "shot_contact", lambda case, current: None)
    assert with_contact_anew(case, current) is current


def _at(case: Case, current: Fit, start: dict[str, float]) -> Fit:
    """Return a fit that stays where it began, or at once where it knew of no contact."""
    values = {**current.values, **start}
    rig = possible(case.nominal, case.control, case.nuisances(()), values)
    assert rig is not None
    cost = 0.5 * sum(float(np.sum(one.residual(rig) ** 2)) for one in case.outputs)
    length = case.contact[0].value_key(case.contact[0].free[0])
    return replace(current, values=values, rig=rig, cost=cost if length in start else 2e9)


def test_a_gap_that_the_best_leaves_beside_dry_friction_is_asked_by_short_replays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A wrong scale of the force was not among what the whole replay's misfit looked like."""
    case, settled = sticking()
    poor = far_off(case, settled)
    asked: list[bool] = []

    def ranked(*given: Any, short: bool = False, **more: Any) -> list[Candidate]:
        asked.append(short)
        name = "force_scale" if short else "breakout"
        return [Candidate(900.0 if short else 20.0, BY_NAME[name], settled if short else poor)]

    monkeypatch.setattr(choose, "fitted_candidates", ranked)
    best = choose._round(case, poor, poor, [PLAIN, LAW], set(), {})
    assert asked == [False, True]
    assert best[0].effect.name == "force_scale"


def test_signatures_are_held_against_short_replays_with_the_contact_that_suits_those() -> None:
    case, settled = sticking()
    effects = [BY_NAME["breakout"], BY_NAME["force_scale"]]
    length = case.contact[0].value_key(case.contact[0].free[0])
    for one in screened_short(case, far_off(case, settled), effects):
        for start in one.starts:
            assert start[length] == pytest.approx(1e-4, rel=0.15)
            assert {one.effect.value_key(p) for p in one.effect.free} <= start.keys()


@pytest.mark.parametrize(("share", "asked"), [(0.95, True), (0.9, True), (0.89, False)])
def test_a_contact_that_holds_rigidly_is_asked_of_a_breakaway_with_a_contact_of_its_own(
    share: float, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Three breakaways of seeds 2040 and 2041 were read as friction of which 95 % is elastic."""
    case, plain = stuck(42)
    known = {**plain.values, "setting of the contact's share.": share}
    rigid = replace(plain, values=known)
    monkeypatch.setattr(richer, "foretold", lambda *_: 0.0)
    monkeypatch.setattr(Case, "over_limit", lambda *_: set())
    found = list(richer._richer(case, [PLAIN, LAW], PLAIN, rigid))
    assert bool(found) is asked
    for law, least, starts in found:
        assert (law, least) == (LAW, RIVAL_GAIN)
        assert starts
        assert not any("contact" in key for one in starts for key in one.start)
    # There the interval of a breakaway is as wide as its contact is unknown.
    monkeypatch.setattr(richer, "may_be_plainer", lambda *_: True)
    breaks = replace(plain, effects=(LAW,), values={f"{LAW.name}.{k}": v for k, v in TRUE.items()})
    wide = {key: (0.5 * value, 1.5 * value) for key, value in breaks.values.items()}
    breaks = replace(
        breaks,
        low={key: low for key, (low, _) in wide.items()},
        high={key: high for key, (_, high) in wide.items()},
    )
    assert richer._is_cause(case, LAW, PLAIN, breaks, rigid) is asked
    corner = replace(breaks, values={**breaks.values, f"{LAW.name}.stribeck_{{d}}_per_s": 4e-4})
    assert not richer._is_cause(case, LAW, PLAIN, corner, rigid)


@pytest.mark.slow
def test_a_setting_at_its_end_beside_friction_begins_anew_where_it_would_be_held_against_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A breakaway's fit stood in a hollow at 1.10 of 1.2 floors, and 16 fits sought a damping."""
    case, _ = stuck(37)
    hollow = case.fit((LAW,), start={f"{LAW.name}.breakaway_N": 9.0})
    at_end = replace(hollow, at_bound=("setting of viscous_damping.factor",))
    monkeypatch.setattr(Case, "over_limit", lambda *_: set())
    monkeypatch.setattr(Case, "gaps", lambda *_: {"loader": FAR_BELOW_NOISE - 0.01})
    assert with_settings_anew(case, at_end) is at_end
    monkeypatch.setattr(Case, "gaps", lambda *_: {"loader": FAR_BELOW_NOISE})
    filed = {key: value for key, value in case.neutral.items() if key in hollow.values}
    within = replace(hollow, at_bound=(), values={**hollow.values, **filed})
    assert with_settings_anew(case, within) is within  # no setting is at an end
    found = with_settings_anew(case, at_end)
    assert found.cost < 0.05 * hollow.cost
    assert found.values[f"{LAW.name}.breakaway_N"] == pytest.approx(6.0, rel=0.02)
