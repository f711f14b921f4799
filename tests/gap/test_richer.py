"""The richer and the plainer of two laws, asked on all of the record where the other was found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.search import candidates, contest, richer
from coupled.gap.search.candidates import may_be_causes
from coupled.gap.search.case import Case
from coupled.gap.search.contest import in_place_of_open
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate, likelier_by
from coupled.gap.search.richer import plainer_on_all, richer_on_all, with_richer_rivals
from coupled.gap.search.rivals import Found
from coupled.gap.search.score import Try, scored
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import LEAST_GAIN, LOOP_NOISES
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig
from tests.support.records import NOISE as NOISE_OF
from tests.support.rigs import bench

BEND, LOOP, MODE = (BY_NAME[name] for name in ("bend", "bend_hysteresis", "structural_mode"))
STIFFENING = BY_NAME["stiffening_bend"]
DELAY, TUNING = BY_NAME["servo_delay"], BY_NAME["servo_tuning"]
OFFSET, WEIGHT = BY_NAME["force_offset"], BY_NAME["bob_weight"]
FIRST, SECOND, NOISE = np.random.default_rng(8).normal(size=(3, 3000))


def linkage_of(folder: Path, values: dict[str, dict[str, float]]) -> Case:
    """Return the linkage of a bench with an effect."""
    rig = nominal_rig(False)
    record = made(folder, rig, values, 31).between(0.0, 15.0)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    return Case(rig, "column", [one.halved(rig) for one in outputs if one.stage == "linkage"])


def begun_at(case: Case, found: Found, **values: float) -> Fit:
    """Return the fit of an effect that was found, from some of its numbers."""
    effect = found.effect
    return case.fit((effect,), start={f"{effect.name}.{key}": v for key, v in values.items()})


LOOPED = {"bend_{d}_per_N": 1e-4, "share": 0.3, "width_N": 6.0}


@pytest.mark.parametrize(
    ("values", "named"),
    [
        ({"bend": {"bend_{d}_per_N": 1e-4}}, BEND),
        ({"bend_hysteresis": LOOPED}, LOOP),
        ({"stiffening_bend": {"bend_{d}_per_N": 1e-4, "limit_{d}": 8e-3}}, STIFFENING),
        ({"structural_mode": {"bend_{d}_per_N": 1e-4, "frequency_Hz": 6.0}}, MODE),
    ],
    ids=lambda one: one.name if hasattr(one, "name") else "",
)
def test_all_of_a_record_says_by_which_law_a_structure_bends(
    tmp_path: Path, values: dict[str, dict[str, float]], named: object
) -> None:
    """A loop of 2.4 N gained 101 over the bend that half of a record of seed 2037 had named."""
    full = {"structural_mode": {**values.get("structural_mode", {}), "damping_ratio": 0.05}}
    case = linkage_of(tmp_path, full if "structural_mode" in values else values)
    step = Found(BEND, 800.0, 0.97, ())
    [one], last = richer_on_all(case, EFFECTS, [step], case.fit((BEND,)))
    assert one.effect is named
    assert last.effects == (named,)
    # And what is named so stays, or is the plain bend that it holds.
    [again], _ = plainer_on_all(case, EFFECTS, [one], last)
    assert again.effect is named


def test_a_loop_that_says_no_more_than_a_bend_is_a_bend(tmp_path: Path) -> None:
    case = linkage_of(tmp_path, {"bend": {"bend_{d}_per_N": 1e-4}})
    step = Found(STIFFENING, 800.0, 0.97, ())
    wide = begun_at(case, step, **{"bend_{d}_per_N": 1e-4, "limit_{d}": 0.2})
    [one], last = plainer_on_all(case, EFFECTS, [step], wide)
    assert (one.effect, last.effects) == (BEND, (BEND,))


def test_a_richer_law_is_fitted_only_where_something_is_foretold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = linkage_of(tmp_path, {"bend": {"bend_{d}_per_N": 1e-4}})
    current = case.fit((BEND,))
    tries = [Try(0.9, {**current.values, "x": float(k)}) for k in range(3)]
    monkeypatch.setattr(richer, "scored", lambda *_: tries)
    assert all(not asked for _, _, asked in richer._richer(case, EFFECTS, BEND, current))
    tries = [replace(one, gain=1.0 + one.start["x"]) for one in tries]
    asked = {
        law.name: (least, [one.start for one in best])
        for law, least, best in richer._richer(case, EFFECTS, BEND, current)
    }
    assert set(asked) == {"stiffening_bend", "bend_hysteresis", "structural_mode"}
    for least, starts in asked.values():
        assert least == LEAST_GAIN
        assert [start["x"] for start in starts] == [2.0, 1.0]  # where most is foretold
    key = BEND.value_key(BEND.free[0])
    for law in (STIFFENING, LOOP, MODE):
        begun = richer._begun(law, BEND, current)
        assert all(one[law.value_key(law.free[0])] == current.values[key] for one in begun)


def test_a_limit_is_tried_over_three_decades() -> None:
    """One of 0.1 mm was lost on a fit that began at 5 mm, where it hardly bends anything."""
    limit = STIFFENING.free[1]
    sizes = richer._sizes(limit)
    assert min(sizes) < 2e-4
    assert max(sizes) == pytest.approx(5e-2)
    assert richer._sizes(LOOP.free[2]) == [5.0, 1.0, 25.0]


def test_a_switch_is_not_the_plainer_of_two_laws() -> None:
    arc = BY_NAME["arc_geometry"]
    assert not any(richer._holds(law, arc) for law in EFFECTS)
    assert richer._holds(TUNING, DELAY)
    assert not richer._holds(DELAY, BY_NAME["servo_lag"])  # of another search
    assert not richer._holds(BY_NAME["stribeck_friction"], BY_NAME["coulomb_friction"])


def test_a_servo_found_with_a_damping_that_is_open_is_one_with_a_dead_time(
    tmp_path: Path,
) -> None:
    """Half of a record of seed 2037 named it a tuning, of a damping between -3.6 and 4.2."""
    case = linkage_of(tmp_path, {"servo_delay": {"delay_s": 0.03, "factor": 1.0}})
    step = Found(TUNING, 800.0, 0.97, ())
    off = begun_at(case, step, delay_s=0.035, factor=1.4, damping_factor=0.8)
    [one], last = plainer_on_all(case, EFFECTS, [step], off)
    assert one.effect is DELAY
    assert last.values["servo_delay.delay_s"] == pytest.approx(0.03, rel=0.1)


def test_a_servo_with_a_dead_time_is_a_tuning_only_by_as_much_as_an_effect_gains(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By 5.4 and 5.6 two dead times of seed 2041 were named so, by the draw of the noise alone."""
    case = linkage_of(tmp_path, {"servo_delay": {"delay_s": 0.03, "factor": 1.0}})
    delayed = case.fit((DELAY,))
    [least] = [
        least for law, least, _ in richer._richer(case, EFFECTS, DELAY, delayed) if law is TUNING
    ]
    assert least == LEAST_GAIN
    tuned = begun_at(case, Found(TUNING, 800.0, 0.97, ()), delay_s=0.03, damping_factor=0.97)
    for more, named in ((LEAST_GAIN - 0.1, DELAY), (LEAST_GAIN + 0.1, TUNING)):
        monkeypatch.setattr(richer, "likelier_by", lambda *_, more=more: more)
        [one], _ = plainer_on_all(case, EFFECTS, [Found(TUNING, 800.0, 0.97, ())], tuned)
        assert one.effect is named


def test_what_a_damping_gains_is_foretold_and_its_fit_begins_there(tmp_path: Path) -> None:
    """By the fit's own slopes 0.04 was foretold of a damping that gained 14.7 (seed 2042)."""
    tuned = {"servo_tuning": {"delay_s": 0.02, "factor": 1.22, "damping_factor": 0.93}}
    case = linkage_of(tmp_path, tuned)
    delayed = case.fit((DELAY,))
    tries = richer._begun(TUNING, DELAY, delayed)
    slower, faster = scored(case, TUNING, DELAY, delayed, tries)
    assert faster.gain == 0.0  # the damping is less than the filed one
    assert faster.start == tries[1]
    here = case.fit((TUNING,), start=tries[0])
    there = case.fit((TUNING,), start=slower.start)
    gained = likelier_by(case.outputs, there, delayed)
    assert slower.gain == pytest.approx(gained, rel=0.25)
    assert gained >= likelier_by(case.outputs, here, delayed) - 0.5
    assert slower.start["servo_tuning.damping_factor"] == pytest.approx(0.93, abs=0.06)
    assert slower.most == slower.gain
    # A bend's laws curve, so that no more is asked of what is foretold than where to begin.
    bends = [BEND.value_key(BEND.free[0]), LOOP.value_key(LOOP.free[0])]
    bent = case.fit((BEND,), start={bends[0]: 1e-4})
    looped = scored(case, LOOP, BEND, bent, richer._begun(LOOP, BEND, bent))
    assert all(one.most == np.inf for one in looped)


@pytest.mark.parametrize(("most", "named"), [(7.9, DELAY), (8.1, TUNING)])
def test_a_damping_that_gains_more_than_slopes_foretell_gains_no_more(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: float, named: Effect
) -> None:
    """A dead time of 20 ms was one of 8 ms by half the frequency: 6.2 foretold, 8.6 gained."""
    case = linkage_of(tmp_path, {"servo_delay": {"delay_s": 0.03, "factor": 1.0}})
    delayed = case.fit((DELAY,))
    monkeypatch.setattr(richer, "scored", lambda *_: [Try(9.0, {}, most)])
    monkeypatch.setattr(richer, "_is_cause", lambda *_: True)
    monkeypatch.setattr(richer, "likelier_by", lambda *_: 8.6)
    [one], _ = richer_on_all(case, EFFECTS, [Found(DELAY, 800.0, 0.97, ())], delayed)
    assert one.effect is named


def test_where_a_fit_has_no_slopes_all_tries_may_gain(tmp_path: Path) -> None:
    case = linkage_of(tmp_path, {"servo_delay": {"delay_s": 0.03, "factor": 1.0}})
    delayed = case.fit((DELAY,))
    tries = richer._begun(TUNING, DELAY, delayed)
    for fit in (replace(delayed, slopes={}), replace(delayed, high=delayed.low)):
        assert [one.gain for one in scored(case, TUNING, DELAY, fit, tries)] == [np.inf, np.inf]


@pytest.mark.parametrize(("gain", "told"), [(3.9, False), (4.1, True)])
def test_a_damping_that_the_record_leaves_open_is_a_rival_of_the_dead_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, gain: float, told: bool
) -> None:
    """Of five blind records in which it gained 4 to 8 two had one, and the noise drew three."""
    case = linkage_of(tmp_path, {"servo_delay": {"delay_s": 0.03, "factor": 1.0}})
    delayed = case.fit((DELAY,))
    monkeypatch.setattr(richer, "scored", lambda *_: [Try(9.0, {})])
    monkeypatch.setattr(richer, "_is_cause", lambda *_: True)
    monkeypatch.setattr(richer, "likelier_by", lambda *_: gain)
    [one] = with_richer_rivals(case, EFFECTS, [Found(DELAY, 800.0, 0.97, ())], delayed)
    assert one.effect is DELAY
    assert [rival.effect for rival in one.rivals] == ([TUNING] if told else [])
    assert one.probability == pytest.approx(1.0 / (1.0 / 0.97 + told))
    # A bend that stiffens has one number more, one with a loop or a mode has two.
    bent = replace(delayed, effects=(BEND,))
    monkeypatch.setattr(richer, "_promising", lambda *_: [Try(9.0, {})])
    [one] = with_richer_rivals(case, EFFECTS, [Found(BEND, 800.0, 0.97, ())], bent)
    assert [rival.effect for rival in one.rivals] == ([STIFFENING] if told else [])
    # Nor is one told beside a rival that there is already.
    known = Found(BEND, 800.0, 0.5, (Candidate(798.0, MODE, bent),))
    assert with_richer_rivals(case, EFFECTS, [known], bent) == [known]


@pytest.mark.parametrize(("damping", "cause"), [(0.996, False), (1.019, False), (0.97, True)])
def test_a_damping_within_what_a_setting_may_be_off_is_none(damping: float, cause: bool) -> None:
    """A dead time of 20 ms was named a tuning with a damping of 0.996."""
    case = Case(
        bench(), "column", [Output("linkage", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120.0)]
    )
    values = {TUNING.value_key(p): p.starts[0] for p in TUNING.free}
    values["servo_tuning.damping_factor"] = damping
    found = replace(case.fit(()), effects=(TUNING,), values=values, at_bound=())
    assert bool(may_be_causes(case, [(TUNING, found)])) == cause


@pytest.mark.parametrize(("width_N", "cause"), [(0.29, False), (0.59, False), (0.61, True)])
def test_a_loop_no_wider_than_the_noise_of_the_force_is_none(width_N: float, cause: bool) -> None:
    """It smooths that noise, and so gained 18 and 32 over two plain bends of seed 2037."""
    assert pytest.approx(0.6) == LOOP_NOISES * 0.2
    still = Output("linkage", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120.0)
    case = Case(bench(), "column", [replace(still, noises={"force": 0.2})])
    values = {LOOP.value_key(p): p.starts[0] for p in LOOP.free} | {
        "bend_hysteresis.width_N": width_N
    }
    found = replace(case.fit(()), effects=(LOOP,), values=values, at_bound=())
    assert bool(may_be_causes(case, [(LOOP, found)])) == cause


def test_a_linkage_knows_the_noise_of_its_force(tmp_path: Path) -> None:
    case = linkage_of(tmp_path, {})
    [linkage] = case.outputs
    assert linkage.noises["force"] == pytest.approx(NOISE_OF["column_force_N"], rel=0.1)


def test_a_rival_takes_the_place_of_what_all_of_the_record_leaves_open() -> None:
    """A lag and a damping gained alike on half of it, and on all of it the lag had no interval."""

    def predict(rig: Rig) -> NDArray[np.float64]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * SECOND)

    case = Case(bench(), "column", [Output("loader", "x", 3.0 * FIRST + NOISE, predict, 1.0, 120)])
    open_one, right = case.fit((WEIGHT,)), case.fit((OFFSET,), "fitted")
    step = Found(WEIGHT, 46.0, 0.5, (Candidate(46.0, OFFSET, right),))
    [one], last = in_place_of_open(case, [step], open_one)
    assert (one.effect, one.rivals, last.effects) == (OFFSET, (), (OFFSET,))
    # Neither where it is as open, nor where the one found is not.
    other = Found(WEIGHT, 46.0, 0.5, (Candidate(46.0, WEIGHT, open_one),))
    assert in_place_of_open(case, [other], open_one) == ([other], open_one)
    sure = Found(OFFSET, 46.0, 0.5, (Candidate(46.0, WEIGHT, open_one),))
    assert in_place_of_open(case, [sure], case.fit((OFFSET,)))[0] == [sure]


def test_a_start_that_is_soon_far_behind_another_of_the_same_effect_is_given_up() -> None:
    case = Case(bench(), "column", [Output("loader", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120)])
    stood = case.fit(())
    begun = [(OFFSET, 10.0), (OFFSET, 99.0), (OFFSET, 101.0), (WEIGHT, 500.0)]
    fits = [(effect, replace(stood, cost=cost)) for effect, cost in begun]
    assert candidates._not_far_behind(fits) == [fits[0], fits[1], fits[3]]


def test_of_several_richer_laws_the_likeliest_is_named_and_what_is_near_it_a_rival(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case = Case(bench(), "column", [Output("linkage", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120)])
    current = replace(case.fit(()), effects=(BEND,))
    gains = {STIFFENING: 20.0, LOOP: 31.0, MODE: 29.0}
    nowhere = [Try(np.inf, {})]
    asked = [(law, LEAST_GAIN, nowhere) for law in gains]
    monkeypatch.setattr(richer, "_richer", lambda *_: iter(asked))
    monkeypatch.setattr(richer, "_is_cause", lambda *_: True)
    monkeypatch.setattr(
        richer, "_fitted", lambda case, effects, start: replace(current, effects=tuple(effects))
    )
    monkeypatch.setattr(richer, "likelier_by", lambda _, fitted, __: gains[fitted.effects[0]])
    [one], last = richer_on_all(case, EFFECTS, [Found(BEND, 800.0, 0.97, ())], current)
    assert (one.effect, last.effects) == (LOOP, (LOOP,))
    assert [(rival.effect, rival.gain) for rival in one.rivals] == [(MODE, 798.0)]
    assert one.probability == pytest.approx(1.0 / (1.0 + np.exp(-2.0) + np.exp(-11.0)), rel=1e-4)


def test_what_says_something_is_not_given_up_for_its_rival() -> None:
    def predict(rig: Rig) -> NDArray[np.float64]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + 0.1 * SECOND))

    case = Case(bench(), "column", [Output("loader", "x", 3.0 * FIRST + NOISE, predict, 1.0, 120)])
    current = case.fit((OFFSET,))
    step = Found(OFFSET, 46.0, 0.5, (Candidate(46.0, WEIGHT, case.fit((WEIGHT,), "fitted")),))
    assert in_place_of_open(case, [step], current) == ([step], current)


def test_one_that_another_would_overtake_is_begun_with_its_contact_anew(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It may stand in a hollow; where nothing would overtake it, that is spared."""
    rig = bench({"friction_N": 2.0})
    case = Case(rig, "column", [Output("loader", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120)])
    contact = {one.value_key(p): 0.1 for one in case.contact for p in one.free}
    own = {OFFSET.value_key(OFFSET.free[0]): 1.0}
    here = replace(case.fit(()), effects=(OFFSET,), values={**own, **contact})
    starts = list[dict[str, float]]()

    def begun(self: Case, effects: tuple[Effect, ...], start: dict[str, float]) -> Fit:
        starts.append(start)
        return replace(here, effects=tuple(effects), values={**here.values})

    monkeypatch.setattr(Case, "fit", begun)
    monkeypatch.setattr(contest, "may_be_causes", lambda *_: True)
    monkeypatch.setattr(contest, "says_nothing", lambda *_: False)
    for less, anew in ((-5.0, True), (1.0, False)):
        starts.clear()
        monkeypatch.setattr(contest, "likelier_by", lambda *_, less=less: less)
        contest.contested(case, here, OFFSET, WEIGHT, [{}])
        assert any(contact.keys().isdisjoint(start) for start in starts[1:]) is anew


def test_how_far_a_breakaway_stands_above_running_friction_has_the_error_of_that() -> None:
    """One of 16.3 N above 15.5 N was known to 1.5 % of 16.3 N alone, and so was none."""
    breakaway = BY_NAME["stribeck_friction"].free[1]
    rig = bench({"friction_N": 15.0})
    assert breakaway.error(16.0, rig, "column") == pytest.approx(0.015 * 1.0)
    assert BY_NAME["force_offset"].free[0].error(2.0, rig, "column") == pytest.approx(0.03)
