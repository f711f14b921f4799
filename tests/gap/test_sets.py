"""The search over sets of effects on outputs whose answer is known: what it names, and what not."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.search.beam import Beam, search_sets
from coupled.gap.search.case import Case
from coupled.gap.search.found import Choice
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import RIVAL_GAIN, VERY_STRONG
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig, starts_of
from tests.support.rigs import bench

Floats = NDArray[np.float64]
FRAMES = 3000
FIRST, SECOND, UNKNOWN, NOISE, OTHER = np.random.default_rng(8).normal(size=(5, FRAMES))
OFFSET, WEIGHT = BY_NAME["force_offset"], BY_NAME["bob_weight"]
DAMPING, LAG = BY_NAME["viscous_damping"], BY_NAME["modifying_lag"]


def output(measured: Floats, predict: Callable[[Rig], Floats], stage: str = "loader") -> Output:
    """Return an output with white noise of 1."""
    return Output(stage, stage, measured, predict, 1.0, 120.0)


def found(outputs: Sequence[Output], library: Sequence[Effect], rig: Rig | None = None) -> Choice:
    """Return what a search of these outputs finds."""
    return search_sets(Case(rig or bench(), "column", outputs), library)[1]


def names(choice: Choice) -> set[str]:
    """Return the effects found."""
    return {step.effect.name for step in choice.steps}


def offset_and_weight(apart: float) -> Callable[[Rig], Floats]:
    """Return a constant force, and a weight that acts alike but for so much of another motion."""

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * (FIRST + apart * SECOND))

    return predict


@pytest.mark.parametrize(("apart", "separable"), [(0.3, True), (0.0, False)])
def test_two_effects_are_separated_where_their_signatures_differ(
    apart: float, separable: bool
) -> None:
    choice = found([output(FIRST + NOISE, offset_and_weight(apart))], [OFFSET, WEIGHT])
    (step,) = choice.steps
    assert {step.effect.name, *(rival.effect.name for rival in step.rivals)} == (
        {"force_offset"} if separable else {"force_offset", "bob_weight"}
    )
    assert all(rival.gain > step.gain - RIVAL_GAIN for rival in step.rivals)
    assert step.probability == pytest.approx(1.0 if separable else 0.5, abs=0.1)


@pytest.mark.parametrize(
    ("apart", "lag_s", "factor", "named"),
    [
        (0.0, 0.005, 1.0, {"viscous_damping", "modifying_lag"}),
        (0.0, 0.0, 0.5, {"viscous_damping", "modifying_lag"}),
        (0.5, 0.005, 1.0, {"modifying_lag"}),
        (0.5, 0.0, 0.5, {"viscous_damping"}),
    ],
)
def test_laws_that_are_one_in_a_limit_are_alternatives(
    apart: float, lag_s: float, factor: float, named: set[str]
) -> None:
    """A lag of F_mod acts as a negative damping, where little else moves."""
    nominal = bench()
    filed = nominal.controls["column"].loader.damping

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        late = -100.0 * loader.modifying_lag
        return np.asarray(
            10.0 * ((loader.damping / filed - 1.0) * FIRST + late * (FIRST + apart * SECOND))
        )

    keys = {"modifying_lag_s": lag_s, "damping_N_s_per_m": factor * filed}
    real = nominal.changed({f"controls.column.loader.{key}": v for key, v in keys.items()})
    (step,) = found([output(predict(real) + NOISE, predict)], [DAMPING, LAG]).steps
    assert {step.effect.name, *(rival.effect.name for rival in step.rivals)} == named


@pytest.mark.parametrize(
    ("unknown", "expected"), [(0.0, {"force_offset", "bob_weight"}), (3.0, {"force_offset"})]
)
def test_a_second_effect_is_named_where_it_explains_what_the_first_leaves(
    unknown: float, expected: set[str]
) -> None:
    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        return np.asarray(loader.offset * FIRST + loader.bob_weight * SECOND)

    second = 3.0 * SECOND * (unknown == 0.0) + unknown * UNKNOWN
    choice = found([output(30.0 * FIRST + second + NOISE, predict)], [OFFSET, WEIGHT])
    assert names(choice) == expected
    offset = choice.fit.values[OFFSET.value_key(OFFSET.free[0])]
    assert offset == pytest.approx(30.0, rel=0.01)


def test_an_effect_whose_place_another_takes_is_found_beside_it() -> None:
    """The weight alone takes most of the residual; the rest is hardly like the offset's."""

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        weight = loader.bob_weight * (FIRST + 0.045 * SECOND)
        return np.asarray(10.0 * (loader.offset * FIRST + weight))

    keys = {"offset_N": -38.0, "bob_weight_N_per_g": 40.0}
    real = bench().changed({f"controls.column.loader.{key}": v for key, v in keys.items()})
    choice = found([output(predict(real) + NOISE, predict)], [OFFSET, WEIGHT])
    assert names(choice) == {"force_offset", "bob_weight"}
    assert choice.fit.values[OFFSET.value_key(OFFSET.free[0])] == pytest.approx(-38.0, rel=0.02)


@pytest.mark.parametrize("beside", [False, True])
def test_what_gained_is_listed_where_nothing_else_did(beside: bool) -> None:
    """The interval of a size contains zero, and the evidence is not very strong."""

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        return np.asarray(0.1 * (loader.offset * FIRST + loader.bob_weight * SECOND))

    real = bench().changed({"controls.column.loader.offset_N": 0.7})
    problem = Problem(Case(bench(), "column", [output(predict(real) + NOISE, predict)]))
    root, fitted = problem.fit(()), problem.fit((OFFSET,))
    wide = replace(fitted, low={**fitted.low, OFFSET.value_key(OFFSET.free[0]): -1.0})
    beam = Beam(problem, root, problem.model_error(root.rig))
    for one in (root, wide):
        beam.add(one)
    beam.recount()
    name = frozenset({"force_offset"})
    assert 0.0 < beam.log(name) - beam.log(frozenset()) < VERY_STRONG
    if beside:
        weight = problem.fit((WEIGHT,), {"bob_weight.force_N_per_g": 1.0})
        better = replace(beam.known[name], rest=beam.known[name].rest + 1.0)
        sure = replace(weight, low={"bob_weight.force_N_per_g": 0.5})
        beam.fits[frozenset({"bob_weight"})] = sure
        beam.known[frozenset({"bob_weight"})] = better
    assert (name in beam.valid()) is not beside


def test_a_fit_is_not_dropped_for_what_its_nuisance_parameter_spoils() -> None:
    """Least squares took a time stamp within its tolerance, for little beside a gap of 100.

    In an output below its noise floor that cost more evidence than the effect gained: a pair
    (crosstalk and a gradient error) was answered by nothing, beside a gap of 13.
    """

    def loader(rig: Rig) -> Floats:
        column = rig.controls["column"]
        return np.asarray(column.loader.offset * FIRST - 3e3 * column.sensing.force_stamp * SECOND)

    def linkage(rig: Rig) -> Floats:
        return np.asarray(3e3 * rig.controls["column"].sensing.force_stamp * SECOND)

    measured = 20.0 * FIRST + 100.0 * UNKNOWN - 5.0 * SECOND
    outputs = [output(measured, loader), output(0.5 * NOISE, linkage, "linkage")]
    problem = Problem(Case(bench(), "column", outputs))
    root, fitted = problem.fit(()), problem.fit((OFFSET,))
    beam = Beam(problem, root, problem.model_error(root.rig))
    beam.add(root)
    beam.recount()
    assert beam.add(fitted)
    assert beam.log(frozenset({"force_offset"})) > beam.log(frozenset())
    assert fitted.values[OFFSET.value_key(OFFSET.free[0])] == pytest.approx(20.0, rel=0.1)


@pytest.mark.parametrize("late_s", [4e-4, 4e-3])
def test_an_effect_does_not_explain_what_a_tolerance_may(late_s: float) -> None:
    """The time stamps of a motion within its noise are not fitted, and 0.4 ms are tolerated.

    With a bob weight the time stamps show in the loader, too. Beside friction, 0.4 ms of motion
    skew reduced 1.04 noise floors to 1.0, and was named with a probability of 0.89.
    """

    def loader(rig: Rig) -> Floats:
        return np.asarray(rig.controls["column"].loader.offset * FIRST)

    def airframe(rig: Rig) -> Floats:
        assert rig.flight is not None
        return np.asarray(750.0 * rig.flight.motion_stamp * SECOND)

    outputs = [
        output(20.0 * FIRST + NOISE + UNKNOWN, loader),
        output(750.0 * late_s * SECOND + OTHER, airframe, "airframe"),
    ]
    library = [OFFSET, replace(BY_NAME["motion_skew"], outputs=("loader", "airframe"))]
    answer = found(outputs, library, nominal_rig(True))
    assert names(answer) == {"force_offset"} | ({"motion_skew"} if late_s > 5e-4 else set())


@pytest.mark.parametrize("first", [FIRST, np.sin(np.arange(FRAMES) / 9.0)])
def test_an_effect_that_spoils_another_stage_is_not_named(first: Floats) -> None:
    """The zero of the gauge fits the loader as well, but the linkage refutes it."""
    zero = BY_NAME["force_zero"]

    def loader(rig: Rig) -> Floats:
        column = rig.controls["column"]
        return np.asarray((column.loader.offset + column.sensing.force_zero) * first)

    def linkage(rig: Rig) -> Floats:
        return np.asarray(0.2 * rig.controls["column"].sensing.force_zero * first)

    outputs = [output(10.0 * first + NOISE, loader), output(OTHER, linkage, "linkage")]
    choice = found(outputs, [zero, OFFSET])
    assert names(choice) == {"force_offset"}
    assert choice.steps[0].rivals == ()


def test_a_residual_within_its_limit_has_no_effect_of_a_fixed_size() -> None:
    """An arc in the linkage, below a noise floor of twice the noise."""

    def predict(rig: Rig) -> Floats:
        return np.asarray(FIRST * rig.controls["column"].loader.arc_geometry)

    arc = output(FIRST + 0.5 * NOISE, predict, "linkage")
    assert arc.gap(bench()) < arc.limit
    assert names(found([arc], [BY_NAME["arc_geometry"]])) == set()


@pytest.mark.parametrize("size", [0.3, 0.8])
def test_beside_an_effect_noise_not_quite_as_modelled_has_no_other(size: float) -> None:
    """A gust of 7 mm/s, at 0.89, took 1.02 noise floors to 1.01 beside an effectiveness."""

    def loader(rig: Rig) -> Floats:
        return np.asarray(rig.controls["column"].loader.offset * FIRST)

    def beside(rig: Rig) -> Floats:
        return np.asarray(rig.controls["column"].loader.bob_weight * SECOND)

    first = output(20.0 * FIRST + 2.0 * UNKNOWN + NOISE, loader)
    second = replace(output(size * SECOND + OTHER, beside), channel="beside")
    assert (second.gap(bench()) < second.limit) == (size < 0.5)
    assert names(found([first, second], [OFFSET, WEIGHT])) == {
        "force_offset",
        *(["bob_weight"] if size > 0.5 else []),
    }


def test_what_lies_far_below_a_noise_floor_outweighs_no_gap() -> None:
    """Beside an offset of 16 noise floors, δ̂ goes from 0.005 to 0.064 of its own."""

    def offset(rig: Rig) -> Floats:
        return np.full(FRAMES, rig.controls["column"].loader.offset)

    def estimate(rig: Rig) -> Floats:
        return np.full(FRAMES, 0.064 if rig.controls["column"].loader.offset else 0.005)

    slow = output(16.0 + np.repeat(NOISE[::20], 20), offset)
    choice = found([slow, output(np.zeros(FRAMES), estimate, "compensation")], [OFFSET])
    assert names(choice) == {"force_offset"}


def test_a_law_that_fits_worse_than_one_it_contains_is_not_at_its_end() -> None:
    """The mode's fit starts at three times its frequency, with less evidence than a bend."""
    bend, mode = BY_NAME["bend"], BY_NAME["structural_mode"]

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        rate_Hz = loader.bend_frequency
        away = np.tanh(np.log(rate_Hz / 13.8)) if rate_Hz > 0.0 else 0.5
        return np.asarray(1e5 * loader.bend * (FIRST + 0.3 * away * SECOND))

    number = replace(mode.parameters[1], starts=(40.0,))
    slow = replace(mode, parameters=(mode.parameters[0], number))
    real = bench({"bend_m_per_N": 2e-4, "bend_frequency_Hz": 13.8})
    linkage = output(predict(real) + NOISE, predict, "linkage")
    choice = found([linkage], [bend, slow], bench({"bend_m_per_N": 1e-4}))
    assert names(choice) == {"structural_mode"}


@pytest.mark.parametrize(
    ("frame_rate_Hz", "possible"), [(120.0, False), (152.2, False), (240.0, True)]
)
def test_a_mode_that_may_be_faster_than_the_frames_show_is_no_effect(
    frame_rate_Hz: float, possible: bool
) -> None:
    """In a record of 20 min a bend was diagnosed as a bend and a force scale."""
    mode = BY_NAME["structural_mode"]

    def predict(rig: Rig) -> Floats:
        loader = rig.controls["column"].loader
        faster = loader.bend_frequency / 76.0 - 1.0
        more = faster * SECOND + loader.bend_damping_ratio * UNKNOWN
        return np.asarray(1e5 * loader.bend * (FIRST + more))

    number = replace(mode.parameters[1], starts=(70.0,))
    fast = replace(mode, parameters=(mode.parameters[0], number, mode.parameters[2]))
    numbers = {"bend_m_per_N": 2e-4, "bend_frequency_Hz": 76.0, "bend_damping_ratio": 0.5}
    real = bench(numbers)
    linkage = replace(
        output(predict(real) + NOISE, predict, "linkage"), frame_rate_Hz=frame_rate_Hz
    )
    choice = found([linkage], [fast], bench({"bend_m_per_N": 1e-4}))
    assert names(choice) == ({"structural_mode"} if possible else set())


@cache
def stage_of_record(
    stage: str, name: str, values: tuple[tuple[str, float], ...], seed: int
) -> Case:
    """Return one stage of a bench's record with an effect."""
    rig = nominal_rig(False)
    with TemporaryDirectory() as folder:
        record = made(Path(folder), rig, {name: dict(values)}, seed)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    return Case(rig, "column", [one.halved(rig) for one in outputs if one.stage == stage])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("bend", {"bend_{d}_per_N": 1e-4}),
        ("bend_hysteresis", {"bend_{d}_per_N": 1e-4, "share": 0.3, "width_N": 6.0}),
        ("stiffening_bend", {"bend_{d}_per_N": 1e-4, "limit_{d}": 8e-3}),
        (
            "structural_mode",
            {"bend_{d}_per_N": 1e-4, "frequency_Hz": 6.0, "damping_ratio": 0.05},
        ),
        ("servo_delay", {"delay_s": 0.03, "factor": 1.0}),
        ("servo_tuning", {"delay_s": 0.02, "factor": 1.22, "damping_factor": 0.8}),
    ],
)
def test_of_laws_that_contain_one_another_the_one_that_is_there_is_named(
    name: str, values: dict[str, float]
) -> None:
    case = stage_of_record("linkage", name, tuple(values.items()), 31)
    # Where F drives the machine, a contact that yields is a bend, and is not tried (`prepare`).
    library = [e for e in EFFECTS if e.stage == "linkage" and e.name != "yielding_contact"]
    assert names(search_sets(case, library)[1]) == {name}


LIGHT = {"bend_{d}_per_N": 1e-4, "damping_ratio": 0.04}


@pytest.mark.parametrize("frequency_Hz", [0.7, pytest.param(14.0, marks=pytest.mark.slow)])
def test_a_fit_of_a_lightly_damped_mode_starts_within_its_bandwidth(frequency_Hz: float) -> None:
    values = LIGHT | {"frequency_Hz": frequency_Hz}
    case = stage_of_record("linkage", "structural_mode", tuple(values.items()), 31)
    (start,) = starts_of(case, BY_NAME["structural_mode"])
    bandwidth_Hz = 2.0 * LIGHT["damping_ratio"] * frequency_Hz
    assert start["structural_mode.frequency_Hz"] == pytest.approx(frequency_Hz, abs=bandwidth_Hz)
    assert start["structural_mode.bend_{d}_per_N"] == pytest.approx(1e-4, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("frequency_Hz", [0.7, 1.5, 14.0])
def test_a_lightly_damped_mode_of_any_frequency_is_named(frequency_Hz: float) -> None:
    """From 8 Hz, 0.7 and 1.5 Hz led to no effect, and 14 Hz to a mode of 24 Hz."""
    values = LIGHT | {"frequency_Hz": frequency_Hz}
    case = stage_of_record("linkage", "structural_mode", tuple(values.items()), 31)
    library = [e for e in EFFECTS if e.stage == "linkage" and e.name != "yielding_contact"]
    choice = search_sets(case, library)[1]
    assert names(choice) == {"structural_mode"}
    assert choice.fit.values["structural_mode.frequency_Hz"] == pytest.approx(
        frequency_Hz, rel=0.01
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", [35, 38, 42, 43])
def test_a_breakaway_is_found_among_the_local_minima_of_dry_friction(seed: int) -> None:
    """The law's own starts end where the control sticks in another order than in the record."""
    law = BY_NAME["stribeck_friction"]
    true = {"friction_N": 2.0, "breakaway_N": 6.0, "stribeck_{d}_per_s": 2e-3}
    case = stage_of_record("loader", law.name, tuple(true.items()), seed)
    choice = search_sets(case, [effect for effect in EFFECTS if effect.dry])[1]
    assert names(choice) == {law.name}
    assert choice.fit.values[f"{law.name}.breakaway_N"] == pytest.approx(6.0, rel=0.03)


@pytest.mark.slow
def test_plain_friction_is_plain_friction() -> None:
    case = stage_of_record("loader", "coulomb_friction", (("friction_N", 3.0),), 31)
    choice = search_sets(case, [effect for effect in EFFECTS if effect.dry])[1]
    assert names(choice) == {"coulomb_friction"}
