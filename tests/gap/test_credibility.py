"""What an effect is worth changes smoothly with what remains beside it, and with its drift."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from coupled.gap import diagnose as diagnosing
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.answer import incredible, verdict_of
from coupled.gap.findings.credibility import (
    Acts,
    Credibility,
    Regime,
    _regime,
    _size,
    credibility,
    regimes,
    remainder,
)
from coupled.gap.findings.result import EffectResult, StageResult
from coupled.gap.findings.where import Remains, free_share, signals
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import DRIFT_CHANCE, FEW
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.gaps import know_only, made, nominal_rig
from tests.support.rigs import bench

BOUND = 1.2


def drifting(by: float, beside: float | None = None, remains: float = 0.0) -> Credibility:
    """Return the credibility of an effect whose halves surely differ by so much."""
    halves = Regime("time_s", 1.0 - 0.5 * by, 1.0 + 0.5 * by, 0.0, 0.0, 12)
    return Credibility((halves,), beside, remainder=remains)


def test_a_remainder_begins_at_the_floor_and_is_even_at_the_bound() -> None:
    left = np.linspace(0.9, 4.0, 621)
    known = np.array([remainder(6.0, one, BOUND) for one in left])
    assert np.all(known[left <= 1.0] == 0.0)
    share = (BOUND**2 - 1.0) / (6.0**2 - 1.0)
    assert remainder(6.0, BOUND, BOUND) == pytest.approx(0.5 * share / (share + FEW))
    assert known[-1] > 0.95
    assert remainder(60.0, 1.5, BOUND) < 0.1 * remainder(3.0, 1.5, BOUND)  # of a wide gap, little
    assert np.all(np.diff(known) >= 0.0)
    assert np.max(np.diff(known)) < 0.05  # for 0.005 floors: no cliff


def test_credibility_has_no_cliff() -> None:
    drifts, shares = np.linspace(0.0, 1.0, 501), np.linspace(-0.2, 1.0, 501)
    by_drift = [drifting(one).value for one in drifts]
    by_law = [drifting(0.0, one, 1.0).value for one in shares]
    by_remainder = [drifting(0.0, 0.3, one).value for one in shares.clip(0.0)]
    for found in (by_drift, by_law, by_remainder):
        assert np.max(np.abs(np.diff(found))) < 0.03
    assert np.all(np.diff(by_drift) <= 0.0)
    assert np.all(np.diff(by_law) >= 0.0)
    assert by_law[-1] - by_law[0] > 0.9
    assert by_remainder[0] > 0.99  # where nothing remains, a free model has no say


def verdict(
    probability: float, left: float, rivals: tuple[str, ...] = (), of_set: float = 0.9
) -> str:
    """Return the verdict on a bend of so much probability that leaves so much of a gap of 8.

    `of_set` is the probability of the best set.
    """
    effect: Any = SimpleNamespace(name="bend", stage="linkage")
    choice: Any = SimpleNamespace(
        steps=(SimpleNamespace(effect=effect, rivals=rivals),), probability=of_set
    )
    stage = StageResult("linkage", gap=8.0, settled=8.0, limit=BOUND, left=left, guilty=True)
    budget: Any = SimpleNamespace(stage="linkage", of=lambda name: 0.95)
    found = EffectResult("bend", "linkage", probability, ())
    return verdict_of(choice, [stage], [found], [budget])


def test_what_imitates_is_unexplained_though_nothing_remains() -> None:
    """A doubtful effect within the noise was named as certain, with a probability of 0.3."""
    assert verdict(0.97, 1.0) == "effect"
    assert verdict(0.97, 1.5) == "mostly"
    assert verdict(0.4, 1.0) == verdict(0.4, 1.5) == "unexplained"
    assert verdict(0.55, 1.0) == "unexplained"  # right in two of five
    assert (verdict(0.65, 1.0), verdict(0.65, 1.5)) == ("effect", "mostly")  # in five of six
    assert verdict(0.49, 1.0, ("stiffening_bend",)) == "ambiguous"


@pytest.mark.parametrize(
    ("probability", "of_set", "said"),
    [(0.7, 0.7, "effect"), (0.7, 0.5, "ambiguous"), (0.55, 0.55, "ambiguous")],
)
def test_alternatives_are_ambiguous_where_no_set_has_half_of_the_probability(
    probability: float, of_set: float, said: str
) -> None:
    assert verdict(probability, 1.0, ("stiffening_bend",), of_set) == said


@pytest.mark.parametrize(
    ("probability", "held", "said"),
    [(0.05, 0.97, "mostly"), (0.48, 0.97, "ambiguous"), (0.05, 0.3, "ambiguous")],
)
def test_a_doubtful_small_effect_leaves_open_only_itself(
    probability: float, held: float, said: str
) -> None:
    """An offset of 2 % of a gap, at 0.05, made ambiguous what a friction of 0.97 explained."""
    friction, offset = (cast(Any, SimpleNamespace(name=n, stage="loader")) for n in ("f", "o"))
    steps = (
        SimpleNamespace(effect=friction, rivals=()),
        SimpleNamespace(effect=offset, rivals=("z",)),
    )
    stage = StageResult("loader", gap=8.0, settled=8.0, limit=BOUND, left=1.0, guilty=True)
    shares = {"f": held, "o": 0.02}
    budget: Any = SimpleNamespace(stage="loader", of=shares.__getitem__)
    found = [
        EffectResult("f", "loader", 0.97, ()),
        EffectResult("o", "loader", probability, ()),
    ]
    choice: Any = SimpleNamespace(steps=steps, probability=0.9)
    assert verdict_of(choice, [stage], found, [budget]) == said


@pytest.mark.parametrize(
    ("zero", "rest", "said"),
    [(0.49, 1.0, "ambiguous"), (0.2, 1.0, "unexplained"), (0.49, 3.0, "unexplained")],
)
def test_alternatives_that_are_certain_together_hold_their_share(
    zero: float, rest: float, said: str
) -> None:
    """A friction of 49 % and a zero, or a constant force, of 49 % closed a gap "unexplained"."""
    shares = {"friction": 0.49, "zero": 0.49, "breakout": 0.02}
    alone = {"friction": (), "zero": ("offset",), "breakout": ()}
    probabilities = {"friction": 0.89, "zero": zero, "breakout": 1e-4}
    steps = [
        SimpleNamespace(effect=cast(Any, SimpleNamespace(name=n, stage="loader")), rivals=rivals)
        for n, rivals in alone.items()
    ]
    stage = StageResult("loader", gap=16.0, settled=16.0, limit=BOUND, left=rest, guilty=True)
    budget: Any = SimpleNamespace(stage="loader", of=shares.__getitem__)
    found = [EffectResult(n, "loader", p, ()) for n, p in probabilities.items()]
    choice: Any = SimpleNamespace(steps=steps, probability=0.5)
    assert verdict_of(choice, [stage], found, [budget]) == said


@pytest.mark.parametrize(("linkage", "said"), [(1.3, "ambiguous"), (20.0, "unexplained")])
def test_alternatives_hold_a_stage_beside_another_that_nothing_explains(
    linkage: float, said: str
) -> None:
    """A pressure scale or a slope explained 1445 floors of 1445, beside a linkage at 1.3."""
    slope: Any = SimpleNamespace(name="slope", stage="schedule")
    steps = (SimpleNamespace(effect=slope, rivals=("scale",)),)
    stages = [
        StageResult("schedule", gap=9.0, settled=9.0, limit=BOUND, left=1.0, guilty=True),
        StageResult("linkage", gap=linkage, settled=linkage, limit=BOUND, left=1.3, guilty=True),
    ]
    budget: Any = SimpleNamespace(stage="schedule", of={"slope": 1.0}.__getitem__)
    found = [EffectResult("slope", "schedule", 0.49, ())]
    choice: Any = SimpleNamespace(steps=steps, probability=0.5)
    assert verdict_of(choice, stages, found, [budget]) == said


@pytest.mark.parametrize(
    ("loader", "linkage", "probability", "said"),
    [
        (1.3, 8.0, 0.97, "mostly"),  # log 1.3 is 11 % of both
        (5.0, 8.0, 0.97, "mostly"),  # 44 %
        (9.0, 8.0, 0.97, "unexplained"),  # 51 %
        (1.3, 8.0, 0.4, "unexplained"),  # and what is found may only imitate
    ],
)
def test_a_stage_that_nothing_explains_counts_by_its_gap(
    loader: float, linkage: float, probability: float, said: str
) -> None:
    """A loader at 1.35 floors of 1.24 made unexplained a play that closed a gap of 15."""
    play: Any = SimpleNamespace(name="soft_backlash", stage="linkage")
    choice: Any = SimpleNamespace(steps=(SimpleNamespace(effect=play, rivals=()),), probability=0.9)
    stages = [
        StageResult("loader", gap=loader, settled=loader, limit=BOUND, left=loader, guilty=True),
        StageResult("linkage", gap=linkage, settled=linkage, limit=BOUND, left=1.0, guilty=True),
    ]
    budget: Any = SimpleNamespace(stage="linkage", of=lambda name: 1.0)
    found = [EffectResult("soft_backlash", "linkage", probability, ())]
    assert verdict_of(choice, stages, found, [budget]) == said


@pytest.mark.parametrize(
    ("rest", "probability", "said"),
    [(1.3, 0.97, "mostly"), (1.3, 0.4, "unexplained"), (3.0, 0.97, "unexplained")],
    ids=["all certain", "one in doubt", "by their logarithms"],
)
def test_two_stages_are_explained_beside_one_that_is_not(
    rest: float, probability: float, said: str
) -> None:
    """Two unexplained gaps of 3 beside one of 8 are 51 % by logarithm, 22 % by power."""
    names = {"linkage": 8.0, "loader": 1.3 if rest < 2.0 else 3.0, "surface": rest}
    explained = ("linkage", "loader") if rest < 2.0 else ("linkage",)
    effects = [cast(Any, SimpleNamespace(name=f"of {at}", stage=at)) for at in explained]
    choice: Any = SimpleNamespace(
        steps=[SimpleNamespace(effect=e, rivals=()) for e in effects], probability=0.9
    )
    stages = [
        StageResult(at, gap, gap, BOUND, 1.0 if at in explained else gap, guilty=True)
        for at, gap in names.items()
    ]
    budget: list[Any] = [
        SimpleNamespace(stage=at, of=lambda name, at=at: float(name == f"of {at}"))
        for at in explained
    ]
    sizes = {"of linkage": 0.97, "of loader": probability}
    found = [EffectResult(e.name, e.stage, sizes[e.name], ()) for e in effects]
    assert verdict_of(choice, stages, found, budget) == said


def test_what_explains_sensing_counts_though_that_has_no_gap_of_its_own() -> None:
    """A force at 1.21 floors of 1.2 made unexplained a zero that had closed a gap of 17."""
    zero: Any = SimpleNamespace(name="deflection_zero", stage="sensing")
    choice: Any = SimpleNamespace(steps=(SimpleNamespace(effect=zero, rivals=()),), probability=0.9)
    stages = [
        StageResult("loader", gap=3.1, settled=1.21, limit=1.2, left=1.21, guilty=True),
        StageResult("sensing", gap=17.5, guilty=True),
    ]
    budget: Any = SimpleNamespace(stage="sensing", of=lambda name: 1.0)
    for probability, said in ((0.97, "mostly"), (0.4, "unexplained")):
        found = [EffectResult("deflection_zero", "sensing", probability, ())]
        assert verdict_of(choice, stages, found, [budget]) == said


@pytest.mark.parametrize(("lag_s", "width_Pa"), [(0.03, 0.0), (0.0, 0.4)])
def test_a_hysteresis_of_the_pressure_is_no_lag(lag_s: float, width_Pa: float) -> None:
    """It moves as much at any rate: a lag for it is larger where the pressure goes slowly."""
    rng, frames, rate_Hz = np.random.default_rng(4), 6000, 120.0
    rates = np.repeat(rng.uniform(9.0, 14.0, 20) * np.tile([1.0, -1.0], 10), frames // 20)
    pressure = 900.0 + np.cumsum(rates) / rate_Hz
    rig = bench()

    def lagged(one: Rig) -> NDArray[np.float64]:
        return np.asarray(pressure - rates * one.controls["column"].schedule.pressure_lag)

    measured = pressure - lag_s * rates - width_Pa * np.sign(rates)
    measured += rng.normal(0.0, 0.05, frames)
    output = Output("schedule", "x", measured, lagged, 0.05, rate_Hz)
    case, lag = Case(rig, "column", [output]), BY_NAME["pressure_lag"]
    record = Record(
        ("time_s", "dynamic_pressure_Pa"), np.column_stack((np.arange(frames) / rate_Hz, pressure))
    )
    found = credibility(lag, case, Problem(case).fit((lag,)), [record], 0.0)
    assert found.value > 0.99 if lag_s else found.value < 0.1


@pytest.mark.parametrize("acts", [0.0, 1.0])
def test_effects_that_undo_each_other_where_there_is_no_gap_are_not_the_cause(acts: float) -> None:
    """With an F_mod computed from δc, a digital multiplier and 13 % more damping cancelled."""
    rng, frames = np.random.default_rng(6), 3000
    first, second, noise, more = rng.normal(size=(4, frames))
    offset, weight = BY_NAME["force_offset"], BY_NAME["bob_weight"]

    def moved(rig: Rig) -> NDArray[np.float64]:
        loader = rig.controls["column"].loader
        return np.asarray((loader.offset + loader.bob_weight) * first)

    def shown(rig: Rig) -> NDArray[np.float64]:
        return np.asarray(rig.controls["column"].loader.offset * second)

    outputs = [
        Output("loader", "x", acts * 8.0 * first + noise, moved, 1.0, 120.0),
        Output("loader", "y", 5.0 * second + more, shown, 1.0, 120.0),
    ]
    case = Case(bench(), "column", outputs)
    fitted = Problem(case).fit((offset, weight))
    record = Record(("time_s",), np.arange(frames)[:, None] / 120.0)
    for effect in (offset, weight):
        found = credibility(effect, case, fitted, [record], 0.0)
        assert found.value > 0.99 if acts else found.value < 0.01
        assert (found.undone > 1.0) == (not acts)


@pytest.mark.parametrize(("remains", "value"), [(0.0, 1.0), (0.9, 0.1)])
def test_what_remains_of_an_exact_stage_is_held_against_an_effect(
    remains: float, value: float
) -> None:
    """A lag took 80 % of a hysteresis at rates that hardly change, and does not drift."""
    assert Credibility((), remainder=remains, exact=True).value == pytest.approx(value)
    flown = Credibility((), remainder=remains, in_full=True)
    assert flown.value == pytest.approx(value)
    assert Credibility((), remainder=remains).value == 1.0


@pytest.mark.parametrize("left", [1.0, 1.4])
def test_what_a_large_effect_leaves_is_held_against_a_small_one(left: float) -> None:
    """Beside a rudder that a model does not quite have, 4 % of side force slope had 0.89."""
    airframe = StageResult("airframe", 20.0, 20.0, 1.2, left, guilty=True)
    assert airframe.remainder(20.0) < 0.1
    assert airframe.remainder(1.7) > 0.7 if left > 1.2 else airframe.remainder(1.7) < 0.1


@pytest.mark.slow
@pytest.mark.parametrize(
    ("real", "factor", "known", "function"),
    [
        ("pitch_stiffness", 1.2, ("pitch_damping", "elevator_effectiveness"), "Cmalpha"),
        ("pitch_damping", 1.5, ("elevator_effectiveness",), "Cmq"),
    ],
)
def test_no_effect_of_the_aircraft_is_likely_that_leaves_motion(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    real: str,
    factor: float,
    known: Sequence[str],
    function: str,
) -> None:
    """Elevator effectiveness had 0.89 for each effect, and left 9 to 19 noise floors.

    The model's own function, which is no effect of this library, takes its place.
    """
    know_only(monkeypatch, [BY_NAME[name] for name in known])
    nominal = nominal_rig(True)
    record = made(tmp_path, nominal, {real: {"factor": factor}}, 4)
    (found,) = diagnose(nominal, {"r": record}, "column").effects
    assert found.of == f"aero/coefficient/{function}"
    assert found.value == pytest.approx(factor, rel=0.01)


def test_what_chance_parts_is_no_drift_of_an_effect_that_leaves_nothing() -> None:
    """Of seven halves one is parted by three errors too often to doubt an effect that fits."""
    alike = [Regime(name, 1.0, 1.0, 0.05, 0.05, 16) for name in "abcdef"]
    error = math.hypot(0.05, 0.05)
    by = 3.0 * error
    apart = Regime("time_s", 1.0 - 0.5 * by, 1.0 + 0.5 * by, 0.05, 0.05, 16)
    fits = Credibility((*alike, apart))
    assert fits.p_value > 0.01
    assert fits.drift == 0.0
    assert fits.value == 1.0
    leaves = Credibility((*alike, apart), 0.9, 1.0)
    assert leaves.drift > 0.1
    assert leaves.value < 0.6


def test_what_chance_does_not_part_is_drift() -> None:
    """Beyond the multiple of chance, in squares, and by more the fewer halves are looked at."""
    apart = Regime("time_s", 0.8, 1.2, 0.03, 0.04, 20)
    multiple = float(stats.t.isf(0.5 * DRIFT_CHANCE / 2, 20))
    alike = Regime("force_N", 1.0, 1.0, 0.03, 0.04, 20)
    two = Credibility((alike, apart))
    assert two.drift == pytest.approx(math.sqrt(0.4**2 - (multiple * 0.05) ** 2))
    assert 0.4 > Credibility((apart,)).drift > two.drift > 0.3
    assert Credibility(()).drift == 0.0
    assert Credibility(()).value == 1.0


def parted(rng: np.random.Generator, acting: list[int], size: float = 1.0) -> Regime | None:
    """Return early against late of an effect that acts in some of 20 stretches of a record.

    What it leaves is alike within a stretch, a tenth of its action rms. Late it is `size` as large.
    """
    number, time_s = np.repeat(np.arange(20), 50), np.arange(1000) / 50.0
    action = np.where(np.isin(number, acting), np.sin(2.0 * np.pi * 2.0 * time_s), 0.0)
    left = 0.1 * rng.normal(size=20)[number] * action + 0.01 * rng.normal(size=1000)
    left += (size - 1.0) * np.where(time_s > 10.0, action, 0.0)
    output = SimpleNamespace(record=0, stretches=number)
    acts = Acts(cast(Output, output), cast(Record, {}), action, left)
    return _regime("time_s", [(acts, time_s)], 0.0)


def test_few_stretches_that_hold_the_action_seldom_part() -> None:
    """A limit reached in three stretches early and three late has six stretches, not twenty."""
    rng = np.random.default_rng(5)
    found = [parted(rng, [1, 4, 8, 11, 13, 17]) for _ in range(400)]
    assert all(one is not None and 1.0 < one.freedom < 5.0 for one in found)
    often = np.mean([one is not None and one.p_value < 0.05 for one in found])
    assert often < 0.08
    held = parted(rng, [4, 13])
    assert held is None  # one stretch each: nothing tells how sure its size is


def test_many_stretches_part_what_drifts() -> None:
    rng = np.random.default_rng(6)
    found = [parted(rng, list(range(20)), size=0.7) for _ in range(50)]
    assert all(one is not None and one.p_value < 0.01 for one in found)
    assert all(one is not None and 10.0 < one.freedom < 19.0 for one in found)
    known = [Credibility((one,)).drift for one in found if one is not None]
    assert 0.2 < np.median(known) < 0.3


def test_the_error_of_a_size_is_the_jackknife_of_its_stretches() -> None:
    """As fitted anew without each stretch in turn, of stretches that hold unlike shares."""
    rng, number = np.random.default_rng(7), np.repeat(np.arange(6), 50)
    action = np.array([8.0, 3.0, 2.0, 1.0, 1.0, 0.5])[number] * rng.normal(size=300)
    left = 0.2 * rng.normal(size=6)[number] * action + rng.normal(size=300)
    more, error, held = _size(action, left, number)
    kept = [number != one for one in range(6)]
    without = np.array([left[rows] @ action[rows] / (action[rows] @ action[rows]) for rows in kept])
    assert error == pytest.approx(math.sqrt(5.0 / 6.0 * float(np.sum((without - more) ** 2))))
    shares = np.array([np.sum(action[number == one] ** 2) for one in range(6)])
    assert held == pytest.approx(float(np.sum(shares) ** 2 / np.sum(shares**2)))


@pytest.mark.parametrize(
    ("probability", "rivals", "said"), [(0.05, 1, True), (0.48, 1, False), (0.5, 0, True)]
)
def test_what_is_not_certain_with_all_its_rivals_is_incredible(
    probability: float, rivals: int, said: bool
) -> None:
    """A scale of the force at 0.05 beside a gradient as likely blamed sensing for the loader."""
    effect: Any = SimpleNamespace(name="force_scale", stage="sensing")
    choice: Any = SimpleNamespace(steps=(SimpleNamespace(effect=effect, rivals=("r",) * rivals),))
    found = EffectResult("force_scale", "sensing", probability, ())
    assert ("force_scale" in incredible(choice, [found])) is said


def test_an_output_with_little_of_an_effect_does_not_test_its_size() -> None:
    """The residual of that output depends on the deflection."""
    rng, rate_Hz = np.random.default_rng(3), 50.0
    times = np.arange(6000) / rate_Hz
    place = 0.05 * np.sin(0.9 * times) + 0.02 * np.sin(2.3 * times)
    names = ("time_s", "column_force_N", "column_computed_m", "column_deflection_m")
    read = Record(names, np.column_stack((times, 40.0 * place, place, place)))
    rig = bench()

    def acts(stage: str, channel: str, size: float, left: NDArray[np.float64]) -> Acts:
        output = Output(stage, channel, read[channel], lambda _: read[channel], 1.0, rate_Hz)
        return Acts(output, read, size * place, left)

    much = acts("linkage", "column_deflection_m", 200.0, rng.normal(size=6000))
    little = acts("loader", "column_computed_m", 5.0, 3.0 * place * np.abs(place) / 0.05)
    case = Case(rig, "column", [much.output, little.output])
    assert min(one.p_value for one in regimes(case, [little])) < 1e-6
    assert regimes(case, [much, little]) == regimes(case, [much])


@pytest.mark.slow
def test_a_diagnosis_blames_no_stage_by_what_is_incredible(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {"deflection_scale": {"factor": 1.05}}, 31).between(0.0, 12.0)
    guilty = [stage.name for stage in diagnose(rig, {"r": record}).stages if stage.guilty]
    assert guilty == ["sensing"]
    monkeypatch.setattr(diagnosing, "incredible", lambda *_: frozenset({"deflection_scale"}))
    guilty = [stage.name for stage in diagnose(rig, {"r": record}).stages if stage.guilty]
    assert guilty
    assert "sensing" not in guilty


def test_the_force_of_an_imposed_motion_is_no_condition_on_itself() -> None:
    """An error of the machine is larger where the measured force is larger, by selection alone."""
    rng, rate_Hz = np.random.default_rng(3), 50.0
    times = np.arange(6000) / rate_Hz
    place = 0.05 * np.sin(0.9 * times) + 0.02 * np.sin(2.3 * times)
    friction_N = 3.0 * np.sign(np.gradient(place))
    error_N = np.convolve(rng.normal(0.0, 1.0, len(times)), np.full(6, 0.4), "same")
    read = Record(
        ("time_s", "column_force_N", "column_deflection_m"),
        np.column_stack((times, friction_N + error_N, place)),
    )
    output = Output(
        "loader", "column_force_N", read["column_force_N"], lambda _: friction_N, 0.1, 50
    )
    rig = bench()
    acts = Acts(output, read, friction_N / output.floor, output.residual(rig))
    known = {one.by: one for one in regimes(Case(rig, "column", [output]), [acts])}
    assert known["size of force_N"].p_value > 0.01
    seen = signals(output, acts.left, read, "column")
    assert free_share(output, acts.left, seen)[0] < 0.1
    # Where the force is the input, it is as measured.
    other = replace(output, channel="column_computed_m", _known=[])
    known = {
        one.by: one for one in regimes(Case(rig, "column", [other]), [replace(acts, output=other)])
    }
    assert known["size of force_N"].p_value < 1e-6
    assert free_share(other, acts.left, signals(other, acts.left, read, "column"))[0] > 0.5


def test_what_no_function_of_the_signals_predicts_is_no_evidence_against_a_law() -> None:
    """A machine's own error: a nonparametric model beside the effects leaves it as well."""
    assert remainder(15.0, 5.0, BOUND, 1.0) > 0.8
    assert remainder(15.0, 5.0, BOUND, 5.0) == 0.0
    own = np.linspace(1.0, 5.0, 401)
    known = np.array([remainder(15.0, 5.0, BOUND, one) for one in own])
    assert np.all(np.diff(known) <= 0.0)
    assert np.max(-np.diff(known)) < 0.06

    def stage(free_share: float) -> StageResult:
        remains = Remains(5.0, (), 1.0, free_share, "all")
        return StageResult("loader", 15.0, 15.0, BOUND, 5.0, guilty=True, remains=remains)

    assert stage(0.0).remainder(15.0) < 1e-12
    for exact in ("schedule", "airframe"):
        assert replace(stage(0.0), name=exact).remainder(15.0) == stage(1.0).remainder(15.0)
    assert stage(1.0).remainder(15.0) == replace(stage(1.0), remains=None).remainder(15.0) > 0.8


def test_what_remains_is_compared_with_the_gap_without_the_effect_in_question() -> None:
    """A tone of 0.1 % of a gap was certain, since viscous damping explained 99 % of it."""
    loader = StageResult("loader", 400.0, 400.0, 15.0, 40.0, guilty=True)
    assert loader.remainder(400.0) < 0.4
    assert loader.remainder(42.0) > 0.9
    assert loader.remainder(1e4) == loader.remainder(400.0)  # of effects that undo each other
