"""How effects are searched: outputs one by one, and intervals beside what is known beforehand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.search import choose, information
from coupled.gap.search.candidates import fitted_candidates, may_be_causes
from coupled.gap.search.case import Case
from coupled.gap.search.choose import Choice, searched
from coupled.gap.search.fit import Fit, fit
from coupled.gap.search.gain import Candidate
from coupled.gap.search.information import is_open, may_be_plainer, says_nothing
from coupled.gap.search.screen import screen
from coupled.gap.search.search import _kept
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import bench

FRAMES = 2400


def output(stage: str, gap: float) -> Output:
    """Return an output of a gap that no rig changes."""
    noise = np.random.default_rng(len(stage)).normal(0.0, gap, FRAMES)
    return Output(stage, stage, noise, lambda rig: np.zeros(FRAMES), 1.0, 120.0)


def test_each_guilty_output_has_candidates_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """What explains a wide gap says nothing of what is worth trying for a narrow one."""
    asked: list[set[str]] = []
    bend = BY_NAME["bend"]

    def candidates(
        case: Case, current: object, library: object, at: set[str], **_: object
    ) -> list[Candidate]:
        asked.append(at)
        first = at == {"linkage"} and {"linkage"} not in asked[:-1]
        found = fit(rig, "column", outputs, [bend])
        return [Candidate(50.0, bend, found)] if first else []

    monkeypatch.setattr(choose, "fitted_candidates", candidates)
    rig: Rig = bench({})
    outputs = [output("loader", 40.0), output("linkage", 4.0), output("schedule", 1.0)]
    choice = searched(Case(rig, "column", outputs), [])
    # The widest first; what has nothing is not asked for again, what changed is.
    assert asked == [{"loader"}, {"linkage"}, {"linkage"}]
    assert [len(gains) for gains in choice.rounds] == [1, 0]


def test_an_effect_in_reserve_takes_the_place_of_one_whose_numbers_it_holds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beside a servo's tuning, a servo lag has no number of its own: both were named."""
    wide = output("linkage", 40.0)
    queue = [BY_NAME["servo_lag"], BY_NAME["servo_tuning"]]

    def candidates(
        case: Case, current: Fit, library: object, at: set[str], **_: object
    ) -> list[Candidate]:
        effect = queue.pop(0) if queue else None
        beside = () if effect is None else (*current.effects, effect)
        return [Candidate(50.0, effect, case.fit(beside))] if effect else []

    monkeypatch.setattr(choose, "fitted_candidates", candidates)
    monkeypatch.setattr(choose, "_needless", lambda case, current: None)
    monkeypatch.setattr(choose, "is_open", lambda case, effect, current: False)
    choice = searched(Case(bench(), "column", [wide]), [])
    assert [step.effect.name for step in choice.steps] == ["servo_tuning"]
    assert [effect.name for effect in choice.fit.effects] == ["servo_tuning"]


@pytest.mark.parametrize(("size", "strained"), [(0.3, False), (300.0, True)])
def test_a_setting_strains_its_end_only_where_going_on_would_gain(
    size: float, strained: bool
) -> None:
    """A mass is 1.025 times the filed one, and known to 1.02: it matters where it shows."""
    rng = np.random.default_rng(6)
    shape, noise = rng.normal(size=FRAMES), rng.normal(size=FRAMES)
    rig = bench()

    def moved(one: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        mass = one.controls["column"].loader.mass / rig.controls["column"].loader.mass
        return size * (mass - 1.0) * shape

    measured = size * 0.025 * shape + noise
    case = Case(rig, "column", [Output("loader", "x", measured, moved, 1.0, 120.0)])
    mass = case.known["inertia"]
    found = fit(rig, "column", case.outputs, [], [mass])
    key = mass.value_key(mass.free[0])
    assert found.values[key] == pytest.approx(1.02, abs=1e-3 if strained else 0.05)
    assert (key in found.at_bound) is strained


@pytest.mark.parametrize(("share", "silent"), [((0.66, 0.81), False), ((-0.1, 0.4), True)])
def test_a_loop_may_leave_the_bend_as_it_is_filed(share: tuple[float, float], silent: bool) -> None:
    """The interval of a hysteresis' bend holds what is filed: its share says that it is there."""
    rig = bench({"bend_m_per_N": 2.6e-5})
    loop = BY_NAME["bend_hysteresis"]
    bend, part, width = (loop.value_key(p) for p in loop.free)
    low = {bend: 2.55e-5, part: share[0], width: 9.0}
    high = {bend: 2.65e-5, part: share[1], width: 12.0}
    found = Fit(
        (loop,), {key: 0.5 * (low[key] + high[key]) for key in low}, low, high, (), rig, 1.0
    )
    assert says_nothing(Case(rig, "column", []), loop, found) is silent


@pytest.mark.parametrize(("gain", "asked"), [(40.0, True), (32.0, False)])
def test_what_half_a_record_leaves_open_is_asked_on_all_of_it_if_it_gains_far_more(
    gain: float, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Few stretches give an interval hardly any freedom: what foretells the rest is something."""
    gains = {"relaxation": gain, "viscous_damping": 30.0}
    relaxing = BY_NAME["relaxation"]
    half = Fit((), {relaxing.value_key(relaxing.free[0]): 100.0}, {}, {}, (), bench(), 1.0)
    found = [(BY_NAME[name], half) for name in gains]
    rig = {"nominal": bench(), "control": "column", "outputs": []}
    case = SimpleNamespace(**rig, fit=lambda *_, **__: replace(half, cost=2.0))

    def ranked(_: object, __: object, some: list[tuple[Effect, Fit]]) -> list[Candidate]:
        each = [Candidate(gains[effect.name], effect, fitted) for effect, fitted in some]
        return sorted(each, key=lambda one: -one.gain)

    def is_open(_: object, effect: Effect, fitted: Fit) -> bool:
        return effect.name == "relaxation" and fitted.cost == 1.0

    monkeypatch.setattr(information, "ranked_by_gain", ranked)
    monkeypatch.setattr(information, "says_nothing", is_open)
    names = [one.effect.name for one in information.informative(cast(Case, case), half, found)]
    assert names == (["relaxation", "viscous_damping"] if asked else ["viscous_damping"])


def test_a_doubtful_fit_begins_again_at_less_and_at_more_than_its_size() -> None:
    """An oscillator's spring, half too stiff, stood in a hollow; the true one is 0.66 of it."""
    spring = BY_NAME["cubic_stiffness"]
    key = spring.value_key(spring.free[0])
    hollow = Fit((spring,), {key: 6.1e6}, {}, {}, (), bench(), 0.0)

    def fit(_: object, part: str, start: dict[str, float], only: Effect) -> Fit:
        assert (part, only) == ("fitted", spring)
        return replace(hollow, values=start, cost=abs(start[key] - 4e6))

    rig = {"nominal": bench(), "control": "column"}
    case = cast(Case, SimpleNamespace(**rig, fit=fit))
    found = information._begun_elsewhere(case, spring, hollow)
    assert found.values[key] == pytest.approx(0.7 * 6.1e6)
    back = information._begun_elsewhere(case, spring, replace(hollow, values={key: 3.9e6}))
    assert back.values[key] == pytest.approx(3.9e6)


@pytest.mark.parametrize(("breakaway_N", "plain"), [((-7.9, 25.1), True), ((4.2, 5.0), False)])
def test_a_breakaway_no_larger_than_running_friction_is_plain_friction(
    breakaway_N: tuple[float, float], plain: bool
) -> None:
    """Another law's number is never taken for the plainer one's."""
    [richer] = [effect for effect in BY_NAME.values() if effect.alike is not None]
    assert richer.alike is not None
    running, breakaway, fading = (richer.value_key(p) for p in richer.free)
    low = {running: 3.9, breakaway: breakaway_N[0], fading: 1e-4}
    high = {running: 4.1, breakaway: breakaway_N[1], fading: 1e-3}
    rig = bench(
        {"controls.column.loader.friction_N": 4.0, "controls.column.loader.breakaway_N": 8.0}
    )
    found = Fit((richer,), low, low, high, (), rig, 1.0)
    case = Case(rig, "column", [])
    assert may_be_plainer(case, richer, found, BY_NAME[richer.alike.plainer]) is plain
    assert not may_be_plainer(case, richer, found, BY_NAME["inertia"])
    assert not may_be_plainer(case, BY_NAME["inertia"], found, BY_NAME[richer.alike.plainer])


@pytest.mark.parametrize(
    ("filed_N", "breakaway_N", "silent"),
    [(1.28, (1.37, 3.12), False), (1.28, (1.1, 3.12), True), (0.0, (1.37, 3.12), True)],
)
def test_a_breakaway_that_surely_stands_above_running_friction_says_something(
    filed_N: float, breakaway_N: tuple[float, float], silent: bool
) -> None:
    """The running friction may be as it is filed, but where none is, it is not nothing."""
    stribeck = BY_NAME["stribeck_friction"]
    running, breakaway, fading = (stribeck.value_key(p) for p in stribeck.free)
    low = {running: -0.05, breakaway: breakaway_N[0], fading: -8e-3}
    high = {running: 0.62, breakaway: breakaway_N[1], fading: 1.4e-2}
    rig = bench({"controls.column.loader.friction_N": 1.28})
    filed = bench({"controls.column.loader.friction_N": filed_N})
    found = Fit((stribeck,), low, low, high, (), rig, 1.0)
    assert says_nothing(Case(filed, "column", []), stribeck, found) is silent


@pytest.mark.parametrize(
    ("filed", "limit_m", "silent"),
    [(9e-5, (0.0155, 0.0166), False), (9e-5, (-3.0, 5.0), True), (0.0, (0.0155, 0.0166), True)],
)
def test_a_bend_that_surely_stiffens_may_begin_as_it_is_filed(
    filed: float, limit_m: tuple[float, float], silent: bool
) -> None:
    stiffening = BY_NAME["stiffening_bend"]
    bend, limit = (stiffening.value_key(p) for p in stiffening.free)
    low, high = {bend: -1e-6, limit: limit_m[0]}, {bend: 9.2e-5, limit: limit_m[1]}
    rig = bench({"bend_m_per_N": filed, "controls.column.compensation.bend_m_per_N": filed})
    found = Fit((stiffening,), low, low, high, (), rig, 1.0)
    assert says_nothing(Case(rig, "column", []), stiffening, found) is silent


@pytest.mark.parametrize(("changed", "left"), [("flight", 1.0), ("controls", 1.4)])
def test_what_a_surface_stands_off_may_be_where_another_aircraft_trims(
    changed: str, left: float
) -> None:
    """A blind aircraft (seed 501) of 1.17 of the stiffness in pitch had a rigging offset beside."""
    rig = nominal_rig(True)
    keys = {"flight": "flight.pitch_stiffness", "controls": "controls.column.loader.mass_kg"}
    other = rig.changed({keys[changed]: 1.17})
    standing, held = output("surface", 1.4), output("surface", 1.0)
    case = Case(rig, "column", [standing], refloored=lambda one: [held])
    assert case.gaps(other)["surface"] == pytest.approx(left, rel=0.05)
    assert case.gaps(rig)["surface"] == pytest.approx(1.4, rel=0.05)


@pytest.mark.parametrize(("quiet", "floor"), [(0.3, 0.5), (0.45, 1.0)])
def test_noise_is_the_least_that_a_rig_leaves(quiet: float, floor: float) -> None:
    """Noise of 1 by a rig with a gap, of which 0.87 is its input's: its own part is 0.5."""
    rig: Rig = bench({})
    first = replace(output("linkage", 2.0), smoothed=0.75**0.5)
    ours = math.hypot(quiet, 0.4)
    anew = replace(first, floor=ours, smoothed=0.4 / ours)
    case = Case(rig, "column", [first], refloored=lambda other: [anew])
    assert first.own == pytest.approx(0.5)
    assert anew.own == pytest.approx(quiet)
    again = case.heard_anew(rig)
    assert (again or case).outputs[0].floor == pytest.approx(floor)
    assert again is None or again.gaps(rig)["linkage"] == pytest.approx(2.0 / floor, rel=0.05)


def test_a_contact_is_looked_for_at_lengths_that_a_fit_does_not_come_to() -> None:
    """A control that sticks elsewhere leaves as much for any short contact: no slope leads away."""
    rig = bench({"controls.column.loader.friction_N": 6.0})
    noise = np.random.default_rng(8).normal(0.0, 1.0, FRAMES)

    def moved(one: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        stiffness = one.controls["column"].loader.friction_stiffness
        length = 6.0 / stiffness if stiffness else 0.0
        return np.full(FRAMES, 30.0 if length < 2e-4 else 1e5 * (length - 4e-4))

    found = Case(rig, "column", [Output("loader", "x", noise, moved, 1.0, 120.0)]).fit(())
    assert found.values["setting of the contact."] == pytest.approx(4e-4, rel=0.02)


@pytest.mark.slow
def test_a_servos_dead_time_is_no_slower_servo(tmp_path: Path) -> None:
    """A servo of 0.39 times the frequency leaves 5 % of its gap of 25, within what may be left."""
    nominal = nominal_rig(False)
    late = {"servo_delay": {"delay_s": 0.02, "factor": 1.0}}
    found = diagnose(nominal, {"r.csv": made(tmp_path, nominal, late, 5)})
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert effect.name == "servo_delay"
    delay = effect.parameters[0]
    assert delay.low is not None and delay.high is not None
    assert delay.low < 0.02 < delay.high


@pytest.mark.parametrize(("frame_rate_Hz", "possible"), [(120.0, False), (240.0, True)])
def test_a_mode_too_fast_for_the_frames_is_none(frame_rate_Hz: float, possible: bool) -> None:
    """A bend was named a mode of 76 Hz in a record of 120 Hz."""
    mode = BY_NAME["structural_mode"]
    still = Output("linkage", "x", np.zeros(FRAMES), lambda rig: np.zeros(FRAMES), 1.0, 120.0)
    case = Case(bench(), "column", [replace(still, frame_rate_Hz=frame_rate_Hz)])
    values = {mode.value_key(p): p.starts[0] for p in mode.free}
    values["structural_mode.frequency_Hz"] = 76.0
    found = replace(case.fit(()), effects=(mode,), values=values, at_bound=())
    assert bool(may_be_causes(case, [(mode, found)])) == possible


@pytest.mark.parametrize("at_bound", [False, True])
def test_what_all_of_the_record_puts_at_a_bound_is_no_cause(at_bound: bool) -> None:
    """A damping by the square of the speed was put down to friction that fades by its most."""
    rng = np.random.default_rng(9)
    shape, noise = rng.normal(size=(2, FRAMES))

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.asarray(rig.controls["column"].loader.offset * shape)

    made_by = Output("loader", "x", 3.0 * shape + noise, predict, 1.0, 120.0)
    case, offset = Case(bench(), "column", [made_by]), BY_NAME["force_offset"]
    found = case.fit((offset,))
    key = offset.value_key(offset.free[0])
    assert is_open(case, offset, replace(found, at_bound=(key,) if at_bound else ())) == at_bound


def test_a_play_with_a_stiff_contact_has_a_start_near_it(tmp_path: Path) -> None:
    """From softer ones a fit ended at no play at all, with a contact that stood for a bend."""
    rig, soft = nominal_rig(False), BY_NAME["soft_backlash"]
    true = {"play_{d}": 1.45e-4, "stiffness_N_per_{d}": 3.6e5}
    outputs = Reader(rig, made(tmp_path, rig, {soft.name: true}, 3), "column", surface_points)
    case = Case(rig, "column", [one for one in outputs.outputs() if one.stage == "linkage"])
    [(_, starts, _)] = screen(case, case.fit(()), [soft])
    off = [
        max(abs(np.log2(s[soft.value_key(p)] / true[p.name])) for p in soft.free) for s in starts
    ]
    assert min(off) < 1.0


def test_what_a_setting_at_its_end_frees_is_tried_however_little_it_takes(tmp_path: Path) -> None:
    """A damping of 1.038, of which a setting had taken 1.02, was passed over for a relaxation."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {"cubic_stiffness": {"cubic_N_per_{d}3": 2e5}}, 3)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    case = Case(rig, "column", [one for one in outputs if one.stage == "loader"])
    loader = [effect for effect in EFFECTS if effect.stage == "loader" and not effect.other]
    kept = [effect.name for effect, *_ in screen(case, case.fit(()), loader)]
    always = {"inertia", "viscous_damping"} - set(kept)
    assert always
    more = [effect.name for effect, *_ in screen(case, case.fit(()), loader, always)]
    assert set(more) == {*kept, *always}


@pytest.mark.parametrize(
    ("alone", "stands", "dropped"),
    [(False, 0.0, True), (True, 0.0, False), (False, 5.0, False)],
    ids=["opens one", "nothing else", "was open"],
)
def test_what_opens_a_gap_elsewhere_is_no_cause(alone: bool, stands: float, dropped: bool) -> None:
    """A scale of the force of 1.2 % for a cubic spring and a breakout: the linkage then stood out.

    It fits the loader better, and would need a bend of its own to undo what it does to the linkage.
    """
    first, second, *noise = np.random.default_rng(8).normal(size=(4, FRAMES))
    zero, offset = BY_NAME["force_zero"], BY_NAME["force_offset"]

    def loader(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        column = rig.controls["column"]
        own = column.loader.offset * (first + 0.3 * second)
        return np.asarray(column.sensing.force_zero * first + own)

    def linkage(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return np.asarray(0.2 * rig.controls["column"].sensing.force_zero * first)

    outputs = [
        Output("loader", "x", 10.0 * first + noise[0], loader, 1.0, 120.0),
        Output("linkage", "y", stands * second + noise[1], linkage, 1.0, 120.0),
    ]
    case = Case(bench(), "column", outputs)
    library = [zero] if alone else [zero, offset]
    found = fitted_candidates(case, case.fit(()), library, {"loader"})
    assert ("force_zero" in {one.effect.name for one in found}) is not dropped
    assert len(found) == len(library) - dropped


@pytest.mark.parametrize("before", [0, 1, 2], ids=["likelier", "less likely", "one number more"])
def test_a_search_over_lower_floors_loses_nothing_likelier(before: int) -> None:
    """A friction by load was found, and beside another trim a Stribeck law in a hollow."""
    first, second, noise = np.random.default_rng(8).normal(size=(3, FRAMES))
    offset, weight = BY_NAME["force_offset"], BY_NAME["bob_weight"]

    def moved(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * first + loader.bob_weight * (first + 0.3 * second))

    measured = 1.3 * first + 0.09 * second + noise
    case = Case(bench(), "column", [Output("loader", "x", measured, moved, 1.0, 120.0)])
    sets = [(offset,), (weight,), (offset, weight)]
    choices = [Choice((), case.fit(effects), case.fit(())) for effects in sets]
    again = choices[1 if before == 0 else 0]
    assert _kept(case, choices[before], again).fit.effects == (offset,)


@pytest.mark.parametrize(
    ("force_N", "width_N"), [(8.0, 2.0), pytest.param(45.0, 20.0, marks=pytest.mark.slow)]
)
def test_a_bend_with_hysteresis_is_sought_at_widths_of_their_own(
    tmp_path: Path, force_N: float, width_N: float
) -> None:
    """Scanned with the bend, a width of 3.7 N began at 250 N, ended at 0, and a mode was named."""
    rig, loop = nominal_rig(False), BY_NAME["bend_hysteresis"]
    true = {"bend_{d}_per_N": 6e-5, "share": 0.5, "width_N": width_N}
    record = made(tmp_path, rig, {loop.name: true}, 12, force_N)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    case = Case(rig, "column", [one for one in outputs if one.stage == "linkage"])
    [found] = fitted_candidates(case, case.fit(()), [loop], {"linkage"})
    assert found.fit.values["bend_hysteresis.width_N"] == pytest.approx(width_N, rel=0.3)
    assert found.fit.values["bend_hysteresis.share"] == pytest.approx(0.5, abs=0.1)
