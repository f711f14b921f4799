"""A damper on a bench that imposes its motion: the force is the answer. A machine not ours.

What each answer must be was written down before it was run.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import EFFECTS
from coupled.gap.findings.proposal import next_tests, pushes
from coupled.gap.freed import default_keys
from coupled.gap.nominal import fit_nominal
from coupled.gap.prepare import as_driven, readers_of
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.stages.tried import as_judged
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.machines import damper, damper_rig, soft_damper, soft_damper_rig
from tests.support.rigs import BENCH, bench

HEAVY_kg = 8.0


@pytest.mark.slow
def test_damping_that_falls_from_the_start_is_no_drift_of_a_sensor() -> None:
    """The scale of a growing motion explained it nearly as well, and was certain."""
    steady = damper(play_m=0.0)
    force, falls = "column_force_N", np.linspace(0.0, 0.3, len(steady))
    data = steady.data.copy()
    data[:, steady.channels.index(force)] *= 1.0 - falls
    found = diagnose(damper_rig(), {"r": replace(steady, data=data)})
    (effect,) = found.effects
    assert (effect.name, found.verdict) == ("viscous_damping", "effect")
    assert effect.value == pytest.approx(0.7, rel=0.02)
    assert effect.course is not None and effect.course.kind == "grows"
    assert effect.course.onset_s is None


def test_a_damper_beside_its_own_numbers_has_no_gap() -> None:
    found = diagnose(damper_rig(), {"r": damper(play_m=0.0)})
    assert found.verdict == "no_gap"
    assert found.stage("loader").gap == pytest.approx(1.0, abs=0.15)
    assert found.closed_loop is None  # nobody flies it by its force


@pytest.mark.slow
@pytest.mark.parametrize("yields_m", [2e-4, 2e-3])
def test_friction_that_yields_far_is_found_beside_a_spring_that_carries_little(
    yields_m: float,
) -> None:
    """Dry contacts yield by less than half a millimetre, a magnetorheological damper by more."""
    found = diagnose(soft_damper_rig(), {"r": soft_damper(yields_m)})
    (effect,) = found.effects
    assert (effect.name, found.verdict) == ("presliding_friction", "effect")
    friction, stiffness, _ = effect.parameters
    assert friction.value == pytest.approx(600.0, rel=0.01)
    assert stiffness.value == pytest.approx(600.0 / yields_m, rel=0.1)


def heavy(rate_Hz: float, mass_kg: float = HEAVY_kg, seconds: float = 40.0) -> tuple[Rig, Record]:
    """Return a bench of `HEAVY_kg` and its record, of a machine of another mass.

    Sines up to 2 Hz in few rows a second, to the last row: F = m·a + c·v + k·x, and white noise.
    """
    damping, stiffness = 80.0, 600.0
    time = np.arange(round(seconds * rate_Hz)) / rate_Hz
    turns = 2.0 * np.pi * np.array([0.13, 0.41, 0.83, 1.31, 1.97])
    angle = np.outer(time, turns) + np.array([0.3, 2.1, 4.0, 5.2, 1.1])
    place, speed = 0.02 * np.sin(angle).sum(axis=1), 0.02 * np.cos(angle) @ turns
    rng = np.random.default_rng(4)
    force = mass_kg * -0.02 * np.sin(angle) @ turns**2 + damping * speed + stiffness * place
    force += rng.normal(0.0, 0.02, len(time))
    place += rng.normal(0.0, 2e-6, len(time))
    numbers = {"mass_kg": HEAVY_kg, "damping_N_s_per_m": damping, "bend_m_per_N": 0.0}
    numbers |= {"basic_gradient_N_per_m": stiffness}
    of_column = {"drive": "displacement", "compensation.gradient": False}
    of_column |= {"schedule.dynamic_pressure_Pa": [0.0]}
    of_column |= {"schedule.total_gradient_N_per_m": [stiffness]}
    dotted = {f"controls.column.{key}": value for key, value in of_column.items()}
    rig = bench({**numbers, **dotted}, {**BENCH, "frame_rate_Hz": rate_Hz})
    names = ("time_s", "column_force_N", "column_computed_m")
    return rig, Record(names, np.column_stack((time, force, place)))


@pytest.mark.parametrize("rate_Hz", [25.0, 40.0])
def test_a_heavy_bench_whose_record_ends_in_motion_has_no_gap(rate_Hz: float) -> None:
    rig, record = heavy(rate_Hz)
    assert diagnose(rig, {"r": record}).verdict == "no_gap"


@pytest.mark.parametrize("rate_Hz", [60.0, 250.0, 1000.0])
def test_the_floor_of_a_heavy_bench_is_the_noise_of_its_gauge_at_any_rate(rate_Hz: float) -> None:
    rig, record = heavy(rate_Hz, seconds=20.0)
    [reader] = readers_of({"r": rig}, {"r": record}, "column")
    [output] = reader.outputs()
    assert output.gap(rig) == pytest.approx(1.0, abs=0.1)
    assert output.floor < 0.025


@pytest.mark.slow
@pytest.mark.parametrize("rate_Hz", [60.0, 1000.0])
def test_a_structure_that_bends_more_is_named_and_measured_at_any_rate(rate_Hz: float) -> None:
    """The grip is moved, and the structure's bend is part of its motion."""
    filed, real = 1e-4, 3e-4
    rig, record = heavy(rate_Hz, seconds=20.0)
    time, force, place = record.data.T
    hiss = 2e-6 * np.random.default_rng(5).normal(size=len(time))
    smooth = force - 0.02 * np.random.default_rng(4).normal(size=len(time))
    names = (*record.channels, "column_deflection_m")
    data = np.column_stack((time, force, place, place + real * smooth + hiss))
    loader = {"bend_m_per_N": filed, "servo_frequency_Hz": 0.0}
    rig = rig.changed({f"controls.column.loader.{key}": value for key, value in loader.items()})
    found = diagnose(rig, {"r": Record(names, data)})
    [effect] = found.effects
    assert (found.verdict, effect.name) == ("effect", "bend")
    assert effect.parameters[0].value == pytest.approx(real, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("rate_Hz", [25.0, 40.0])
def test_the_mass_of_a_heavy_bench_is_known_closely(rate_Hz: float) -> None:
    rig, record = heavy(rate_Hz, 1.1 * HEAVY_kg)
    found = diagnose(rig, {"r": record})
    assert found.verdict == "effect"
    [effect] = found.effects
    [number] = effect.parameters
    assert effect.name == "inertia"
    assert number.low is not None
    assert number.high is not None
    assert 1.09 < number.low < 1.1 < number.high < 1.11


def test_a_grip_with_its_force_and_nothing_else_is_taken_as_moved() -> None:
    rig = damper_rig(drive="force")
    both = [damper(seconds=2.0, grip=True), damper(seconds=2.0)]
    assert as_driven(rig, both[:1], "column") == damper_rig()
    assert as_driven(rig, both[1:], "column") == rig  # a δc may be a loader's answer
    assert as_driven(rig, both, "column") == rig


def test_no_force_is_proposed_to_a_bench_that_imposes_the_motion() -> None:
    """A robot's joint was to be moved by "slow triangles of ±129 N at 0 kPa"."""
    named = {effect.name: effect for effect in EFFECTS}
    effect, rival = named["viscous_damping"], named["coulomb_friction"]
    fits = [
        Fit((one,), {value: size}, {}, {}, (), damper_rig(drive="force"))
        for one, value, size in (
            (effect, "viscous_damping.factor", 0.8),
            (rival, "coulomb_friction.friction_N", 20.0),
        )
    ]
    step = Found(effect, 9.0, 0.5, (Candidate(9.0, rival, fits[1]),))
    choice, record = Choice((step,), fits[0], fits[0], {}, ()), damper(seconds=6.0)
    assert next_tests(damper_rig(), record, "column", choice) == ()
    [first, *_] = pushes(damper_rig(drive="force"), record, "column")
    assert first.text.startswith("slow triangles of ±")
    assert first.text.endswith("N for 15 s")  # the spring is the same at any q̄


def test_of_the_linkage_play_and_contact_alone_show_in_the_force_of_a_moved_loader() -> None:
    reader = readers_of({"r": damper_rig()}, {"r": damper(seconds=6.0)}, "column")[0]
    library = as_judged(EFFECTS, [reader], reader.outputs())
    moved = [effect for effect in library if effect.stage == "linkage"]
    names = ["backlash", "soft_backlash", "yielding_contact"]
    assert [(effect.name, effect.shows_in) for effect in moved] == [(n, ("loader",)) for n in names]


# The joints of this machine end in a spring of 1e7 N/m, which may be resolved or not.
PLAYS = ("backlash", "soft_backlash")


@pytest.mark.slow
@pytest.mark.parametrize("grip", [False, True])
def test_play_in_a_dampers_joints_is_named_and_measured(grip: bool) -> None:
    rig = damper_rig(drive="force" if grip else "displacement")
    if grip:  # what moves a damper at its end is no servo
        rig = rig.changed({"controls.column.loader.servo_frequency_Hz": 0.0})
    found = diagnose(rig, {"r": damper(grip=grip)})
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name in PLAYS
    assert effect.stage == "linkage"
    assert found.guilty == ("linkage",)
    assert effect.value == pytest.approx(1.5e-3, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("play_m", "damping"), [(0.8e-3, 900.0), (3e-3, 2000.0)])
def test_other_plays_are_measured_as_well(play_m: float, damping: float) -> None:
    found = diagnose(damper_rig(damping), {"r": damper(play_m=play_m, damping=damping)})
    number = found.effects[0].parameters[0]
    assert found.effects[0].name in PLAYS
    assert number.low is not None and number.high is not None
    assert number.low < play_m < number.high


@pytest.mark.slow
@pytest.mark.parametrize(("play_m", "stiffness"), [(0.0, 1e5), (1.5e-3, 1e5), (3e-3, 3e4)])
def test_joints_that_yield_are_named_and_measured(play_m: float, stiffness: float) -> None:
    """Without play a spring before a damper delays the force; it is no late time stamp."""
    found = diagnose(damper_rig(), {"r": damper(play_m=play_m, stiffness=stiffness)})
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name == ("soft_backlash" if play_m else "yielding_contact")
    numbers = {p.name: p.value for p in effect.parameters}
    assert numbers["stiffness_N_per_m"] == pytest.approx(stiffness, rel=0.03)
    assert numbers.get("play_m", 0.0) == pytest.approx(play_m, rel=0.01)


@pytest.mark.slow
def test_a_damper_without_mass_and_spring_is_as_well_a_gauge_that_is_off() -> None:
    """F = c·v: scale of the force, of the motion, and damping are one number."""
    record = damper(play_m=0.0)
    found = diagnose(damper_rig(damping=1600.0), {"r": record})
    assert found.verdict == "ambiguous"
    [group] = found.rivals
    assert {"viscous_damping", "force_scale", "deflection_scale"} <= set(group)
    fitted = fit_nominal(damper_rig(damping=1000.0), {"r": record}, ["loader.damping_N_s_per_m"])
    assert fitted.numbers[0].found == pytest.approx(2000.0, rel=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("damping", [2000.0, 900.0])
def test_a_fit_finds_the_play_of_a_damper_and_no_friction(damping: float) -> None:
    """Its joints delay the force by 0.1 to 0.2 ms, which is no friction."""
    record = damper(seconds=8.0, damping=damping)
    keys = [f"loader.{key}" for key in ("play_m", "damping_N_s_per_m", "friction_N")]
    fitted = fit_nominal(damper_rig(), {"r": record}, keys)
    play, found, _ = fitted.numbers
    assert play.interval is not None
    assert play.found == pytest.approx(1.5e-3, rel=0.05)
    assert found.found == pytest.approx(damping, rel=0.02)
    assert fitted.unknown == ("loader.friction_N",)


def test_a_fit_frees_the_play_of_a_machine_that_is_moved() -> None:
    assert "loader.play_m" in default_keys(damper_rig(), "column", {"loader", "linkage"}, True)
    rig = damper_rig().changed({"controls.column.loader.bend_m_per_N": 1e-6})
    keys = default_keys(rig, "column", {"loader", "linkage"}, True)
    assert not any("bend" in key or "servo" in key for key in keys)


def test_a_component_that_the_record_does_not_show_stays_absent() -> None:
    """A damper without offset: it stays 0, and the limit is stated and above the truth."""
    keys = ["loader.damping_N_s_per_m", "loader.offset_N"]
    for offset_N in (0.0, 3.0):
        record = damper(seconds=8.0, play_m=0.0, offset_N=-offset_N)
        damping, offset = fit_nominal(damper_rig(1500.0), {"r": record}, keys).numbers
        assert damping.found == pytest.approx(2000.0, rel=0.01)
        if offset_N:
            assert offset.found == pytest.approx(offset_N, rel=0.2)
            continue
        assert (offset.found, offset.half) == (0.0, None)
        assert offset.most is not None
        assert 0.0 < offset.most < 1.0
        assert offset.words.startswith("not shown by these records: loader.offset_N; it stays 0")
