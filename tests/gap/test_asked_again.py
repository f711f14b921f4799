"""What half of a record leaves open, or a hollow hides, is asked on all of it or begun again."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME, EFFECTS, library_of
from coupled.gap.search import contest, information, richer, screen, small
from coupled.gap.search.anew import with_settings_anew
from coupled.gap.search.candidates import _from_ends
from coupled.gap.search.case import Case
from coupled.gap.search.contest import distinguished
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.search.richer import richer_on_all
from coupled.gap.search.rivals import Found
from coupled.gap.search.screen import Screened
from coupled.gap.signals.output import Output, stage_gaps, stage_limits
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import LEAST_GAIN, RICHER_GAIN, SCREENED_MOST
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import bench

PLAIN, STRIBECK = BY_NAME["coulomb_friction"], BY_NAME["stribeck_friction"]
OFFSET, WEIGHT = BY_NAME["force_offset"], BY_NAME["bob_weight"]
FIRST, SECOND, NOISE = np.random.default_rng(8).normal(size=(3, 3000))


def found_plain(folder: Path, breakaway_N: float) -> tuple[Case, Found]:
    """Return the loader of a bench with friction of 2 N that breaks away, and plain friction."""
    rig = nominal_rig(False)
    values = {"friction_N": 2.0, "breakaway_N": breakaway_N, "stribeck_{d}_per_s": 4e-3}
    record = made(folder, rig, {"stribeck_friction": values}, 31)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    loader = [one.halved(rig) for one in outputs if one.stage == "loader"]
    return Case(rig, "column", loader), Found(PLAIN, 300.0, 0.97, ())


@pytest.mark.slow
def test_a_richer_law_of_friction_takes_the_plain_one_s_place_by_all_of_the_record(
    tmp_path: Path,
) -> None:
    """Three records of seed 2035 held breakaways, and plain friction was named with 0.97."""
    case, step = found_plain(tmp_path, 2.5)
    current = case.fit((PLAIN,))
    [one], last = richer_on_all(case, EFFECTS, [step], current)
    assert (one.effect, last.effects) == (STRIBECK, (STRIBECK,))
    assert last.values["stribeck_friction.breakaway_N"] == pytest.approx(2.5, rel=0.1)
    assert last.cost < current.cost
    assert one.probability > 0.99


@pytest.mark.slow
def test_plain_friction_stays_plain_by_all_of_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Little is foretold, so nothing is fitted; where all is fitted, it gains too little."""
    case, step = found_plain(tmp_path, 2.0)
    current = case.fit((PLAIN,))
    monkeypatch.setattr(richer, "little_richer", lambda *_: pytest.fail("fitted"))
    assert richer_on_all(case, EFFECTS, [step], current) == ([step], current)
    monkeypatch.undo()
    monkeypatch.setattr(richer, "foretold", lambda *_: RICHER_GAIN)
    assert richer_on_all(case, EFFECTS, [step], current) == ([step], current)
    monkeypatch.setattr(richer, "_is_cause", lambda *_: True)
    assert richer_on_all(case, EFFECTS, [step], current) == ([step], current)


@pytest.mark.parametrize(("apart", "told"), [(0.2, True), (0.0, False)])
def test_a_rival_beside_dry_friction_is_distinguished_by_all_of_the_record(
    apart: float, told: bool
) -> None:
    """A scale of the force stood beside friction by load, which all of the record refutes by 10."""

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + SECOND * apart))

    case = Case(bench(), "column", [Output("loader", "x", FIRST + NOISE, predict, 1.0, 120.0)])
    case = replace(case, nominal=bench({"friction_N": 2.0}))
    rival = Candidate(197.0, WEIGHT, case.fit((WEIGHT,), "fitted"))
    step = Found(OFFSET, 200.0, 0.95, (rival,))
    one, last = distinguished(case, case.fit((OFFSET,)), step)
    assert (not one.rivals) == told
    assert (one.probability > 0.96) == told
    assert last.effects == (OFFSET,)


def test_a_rival_that_all_of_the_record_refutes_need_be_no_cause_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A breakaway that was no cause on all of a record stayed a ripple's rival, less likely by 859.

    It stays where that does not refute it.
    """

    def predict(apart: float, rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + SECOND * apart))

    monkeypatch.setattr(contest, "may_be_causes", lambda *_: [])
    for apart, stays in ((0.2, False), (0.0, True)):
        output = Output("loader", "x", FIRST + NOISE, partial(predict, apart), 1.0, 120.0)
        case = Case(bench({"friction_N": 2.0}), "column", [output])
        rival = Candidate(197.0, WEIGHT, case.fit((WEIGHT,), "fitted"))
        step = Found(OFFSET, 200.0, 0.95, (rival,))
        one, _ = distinguished(case, case.fit((OFFSET,)), step)
        assert bool(one.rivals) is stays


def test_a_fit_starts_where_its_last_one_ended_too() -> None:
    """A bend with hysteresis of 10 N ended at 61 beside a hum, where it said nothing, and was lost.

    The round before had ended at 10. Laws of friction begin at the plain one's end.
    """
    first = [{"a": 1.0}]
    for name, count in (("bend_hysteresis", 2), ("bend", 1), ("stribeck_friction", 1)):
        effect = BY_NAME[name]
        end = {effect.value_key(p): 2.0 for p in effect.free}
        one = _from_ends(Screened(effect, first, 1.0), {name: {**end, "another's": 3.0}})
        assert one.starts == [*first, end][:count]
    delay = BY_NAME["servo_delay"]  # asked by its level alone, it has no other number
    alone = {delay.value_key(delay.free[0]): 0.02}
    assert _from_ends(Screened(delay, first, 1.0), {delay.name: alone}).starts == first
    unknown = Screened(BY_NAME["bend_hysteresis"], first, 1.0)
    assert _from_ends(unknown, {}) == unknown


def test_all_whose_signature_takes_nearly_as_much_as_the_best_are_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A gradient that took 0.85 of what the best took was the seventh of six."""
    case = Case(
        bench(), "column", [Output("loader", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120.0)]
    )
    loader = [e for e in EFFECTS if e.stage == "loader" and e.free and not e.reserve]
    for near, kept in ((8, 8), (len(loader), SCREENED_MOST), (2, 6)):
        takes = {e.name: 100.0 - k if k < near else 60.0 for k, e in enumerate(loader)}
        monkeypatch.setattr(screen, "screened", lambda _, __, e, t=takes: (t[e.name], [{}]))
        assert len(screen.screen(case, case.fit(()), loader)) == kept


def test_of_servos_known_by_their_dead_time_alone_the_plainer_is_asked() -> None:
    """A dead time of 20 ms was named as one of a servo with another damping, which it has not."""
    delay, tuning = BY_NAME["servo_delay"], BY_NAME["servo_tuning"]
    for found in ([delay, tuning], [tuning, delay]):
        assert information._plainest(found) == [delay]
    assert information._plainest([tuning]) == [tuning]
    assert information._plainest([OFFSET]) == []


@pytest.mark.slow
def test_a_motion_that_is_stamped_late_opens_no_gap_of_the_loader(tmp_path: Path) -> None:
    """The machine feels its bob weight in time; the record has the load factor late."""
    weight = {"controls.column.loader.bob_weight_N_per_g": 15.0}
    nominal = nominal_rig(True).changed(weight)
    record = made(tmp_path, nominal, {"motion_skew": {"delay_s": 0.1}}, 5)
    [loader] = [
        one
        for one in Reader(nominal, record, "column", surface_points).outputs()
        if one.stage == "loader"
    ]
    shown = [one.shows_in for one in library_of(nominal, "column") if one.name == "motion_skew"]
    assert shown == [("airframe", "loader")]
    assert library_of(nominal_rig(True), "column") == list(EFFECTS)
    late = nominal.changed({"flight.motion_stamp_s": 0.1})
    assert loader.gap(nominal) > 2.0 * loader.limit
    assert loader.gap(late) < loader.limit


@pytest.mark.slow
def test_air_that_is_known_by_a_late_motion_moved_before(tmp_path: Path) -> None:
    """A gust beside a motion that is 83 ms late left 1.9 floors by the true numbers of both."""
    nominal = nominal_rig(True)
    gust = {"vertical_gust": {"rms_m_per_s": 0.5}, "motion_skew": {"delay_s": 0.08}}
    record = made(tmp_path, nominal, gust, 5)
    real = nominal.changed({"flight.gust_rms_m_per_s": 0.5, "flight.motion_stamp_s": 0.08})
    outputs = airframe_outputs(real, record)
    assert stage_gaps(outputs, real)["airframe"] < stage_limits(outputs)["airframe"]
    in_time = real.changed({"flight.motion_stamp_s": 0.0})
    assert stage_gaps(outputs, in_time)["airframe"] > 3.0 * stage_limits(outputs)["airframe"]


@pytest.mark.parametrize(
    ("wide", "stands", "rubs", "asked"),
    [
        (True, 1.02, False, (1.0, 0.7, 1.4)),
        (False, 1.0199, False, (1.0, 0.7, 1.4)),
        (False, 1.015, False, ()),
        (True, 1.02, True, (1.0,)),
        (False, 1.02, True, (1.0,)),
        (False, 1.015, True, ()),
    ],
    ids=["a gap", "next to its end", "within", "a gap and friction", "friction", "that within"],
)
def test_a_fit_with_a_setting_at_its_end_is_begun_anew(
    wide: bool,
    stands: float,
    rubs: bool,
    asked: tuple[float, ...],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A servo at 0.98 of its frequency held a limit of acceleration in a hollow, 2.7 of 172.

    And within the limit a play of 3.7 mm that was 4.0, which all of the record shows by 322.
    """

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader, filed = rig.controls["column"].loader, bench().controls["column"].loader
        return np.asarray(loader.offset * FIRST + (loader.mass / filed.mass - 1.0) * 25.0 * SECOND)

    rig = bench({"friction_N": 2.0} if rubs else {})
    case = Case(rig, "column", [Output("loader", "x", 9.0 * FIRST + NOISE, predict, 1.0, 120.0)])
    right = case.fit((OFFSET,))
    mass = case.known["inertia"]
    key, offset = mass.value_key(mass.free[0]), OFFSET.value_key(OFFSET.free[0])
    values = {**right.values, key: stands, offset: 6.0 if wide else 9.0}
    stood = replace(right, values=values, at_bound=(), cost=2.0 * right.cost)
    stood = replace(stood, rig=case.with_only(stood, (OFFSET,)))
    starts = list[dict[str, float]]()

    def begun(self: Case, effects: object, start: dict[str, float]) -> Fit:
        starts.append(start)
        return right

    monkeypatch.setattr(Case, "fit", begun)
    found = with_settings_anew(case, stood)
    assert sorted(start[offset] for start in starts) == pytest.approx(
        sorted(times * values[offset] for times in asked)
    )
    settings = {one.value_key(p) for one in case.known.values() for p in one.free}
    assert not any(settings & {*start} for start in starts)
    assert found is (right if asked else stood)


def test_less_than_the_noise_known_of_a_stage_strains_no_setting(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of air known by an error 0.3 was left, and a motion stamped 4 ms late was named for that."""
    case = Case(
        bench(), "column", [Output("loader", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120.0)]
    )
    mass, current = case.known["inertia"], case.fit(())
    asked = list[list[str]]()
    monkeypatch.setattr(small, "_at_end", lambda *_: {"inertia": mass})

    def candidates(
        case: Case, current: Fit, library: object, shown: object, always: dict[str, Effect]
    ) -> list[Candidate]:
        asked.append([*always])
        return []

    monkeypatch.setattr(small, "fitted_candidates", candidates)
    assert not small.strained(case, current, EFFECTS)
    quiet = replace(case, outputs=[replace(one, floor=2.0, _known=[]) for one in case.outputs])
    assert not small.strained(quiet, quiet.fit(()), EFFECTS)
    assert asked == [["inertia"], []]


def test_a_servo_s_damping_is_asked_where_its_dead_time_was_found() -> None:
    """Half of a record left it open: a servo with 1.09 times its damping was named a delay."""
    delay, tuning = BY_NAME["servo_delay"], BY_NAME["servo_tuning"]
    case = Case(
        bench(), "column", [Output("linkage", "x", NOISE, lambda _: 0.0 * NOISE, 1.0, 120.0)]
    )
    current = replace(case.fit(()), effects=(delay,))
    known = {delay.value_key(p): 0.02 + k for k, p in enumerate(delay.free)}
    current = replace(current, values=known)
    [(law, least, tries)] = list(richer._richer(case, EFFECTS, delay, current))
    assert (law, least) == (tuning, LEAST_GAIN)
    asked = [[one.start[tuning.value_key(p)] for p in tuning.free] for one in tries]
    assert asked == [[0.02, 1.02, 0.8], [0.02, 1.02, 1.25]]
    assert not list(richer._richer(case, EFFECTS, tuning, replace(current, effects=(tuning,))))


def test_a_law_of_friction_is_not_held_against_what_has_no_contact() -> None:
    """Of a damper friction by load is as well a damping: its contact's numbers made it likelier."""

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.friction * FIRST + loader.bob_weight * (FIRST + SECOND))

    case = Case(bench(), "column", [Output("loader", "x", FIRST + NOISE, predict, 1.0, 120.0)])
    rival = Candidate(199.0, WEIGHT, case.fit((WEIGHT,), "fitted"))
    step = Found(PLAIN, 200.0, 0.5, (rival,))
    assert distinguished(case, case.fit((PLAIN,)), step)[0] == step
    rubbing = replace(case, nominal=bench({"friction_N": 1e-6}))
    one, _ = distinguished(rubbing, rubbing.fit((PLAIN,)), step)
    assert not one.rivals
