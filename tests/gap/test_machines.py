"""Machines that nobody tuned on: stand-ins by scipy, and what must be said of each.

What each answer must be was written down before it was run.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.prepare import readers_of
from coupled.gap.signals.floors import floor_from
from coupled.gap.signals.reading import worth_recording
from coupled.record.record import Record
from tests.support.gaps import nominal_rig
from tests.support.machines import (
    CUBIC,
    DAMPING,
    MOTOR_DRY_N,
    duffing,
    duffing_rig,
    held_force,
    held_force_rig,
    motor,
    motor_rig,
    slider,
    slider_rig,
)


def test_a_floor_that_hides_a_gap_lets_no_one_say_that_there_is_none() -> None:
    """The damping is 30 % off, and the force's noise nearly half of the force: not to be seen."""
    found = diagnose(duffing_rig(damping=0.7 * DAMPING), {"r": duffing(seconds=8.0, noise=NOISY)})
    assert found.verdict == "ambiguous"
    assert found.effects == ()
    loader = found.stage("loader").as_dict()
    assert loader["judged"] is False
    assert loader["floor_share"] > 0.3
    assert "noise of column_force_N is" in loader["why"]
    assert "less noise" in found.next_test
    assert "cannot be decided" in found.summary


NOISY = (5.0, 2e-6)


@pytest.mark.slow
def test_an_oscillator_of_another_program_has_no_gap_beside_its_own_numbers() -> None:
    found = diagnose(duffing_rig(), {"r": duffing()})
    assert found.verdict == "no_gap"
    assert "filtered or resampled" in found.summary  # its band ends below half of the frame rate
    assert set(found.filtered) == {"column_force_N", "column_computed_m"}
    assert found.next_test == ""  # no advice about a schedule, a host, a grip that it has not


@pytest.mark.slow
@pytest.mark.parametrize("to_Hz", [30.0, 49.0])
def test_a_hardening_spring_and_a_damping_are_found_under_a_broadband_force(to_Hz: float) -> None:
    record = duffing(to_Hz=to_Hz, seed=2)
    spring = diagnose(duffing_rig(cubic=0.0), {"r": record})
    assert [effect.name for effect in spring.effects] == ["cubic_stiffness"]
    assert spring.effects[0].value == pytest.approx(CUBIC, rel=0.03)
    damping = diagnose(duffing_rig(damping=0.7 * DAMPING), {"r": record})
    assert [effect.name for effect in damping.effects] == ["viscous_damping"]
    assert damping.effects[0].value == pytest.approx(1.0 / 0.7, rel=0.02)
    assert damping.verdict == spring.verdict == "effect"


@pytest.mark.slow
def test_a_softening_spring_is_found_under_a_broadband_force() -> None:
    """It was "friction ripple with gradient error with breakout"."""
    found = diagnose(duffing_rig(cubic=0.0), {"r": duffing(seed=2, cubic=SOFTENING)})
    assert [effect.name for effect in found.effects] == ["cubic_stiffness"]
    assert found.effects[0].value == pytest.approx(SOFTENING, rel=0.03)
    assert found.verdict == "effect"


SOFTENING = -0.2 * CUBIC


@pytest.mark.parametrize("factor", [0.6, pytest.param(1.9, marks=pytest.mark.slow)])
def test_the_damping_of_a_slow_machine_without_a_spring_is_found(factor: float) -> None:
    """Restarted four times a second, a machine of 1.7 s followed a record of any damping."""
    found = diagnose(slider_rig(), {"r": slider(1, factor)})
    (damping,) = found.effects
    assert (damping.name, found.verdict) == ("viscous_damping", "effect")
    assert damping.value == pytest.approx(factor, rel=0.02)
    (p,) = damping.parameters
    assert p.low is not None and p.high is not None and p.low <= factor <= p.high


@pytest.mark.parametrize("seed", [1, 2])
def test_that_machine_has_no_gap_beside_its_own_numbers(seed: int) -> None:
    assert diagnose(slider_rig(), {"r": slider(seed)}).verdict == "no_gap"


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.0, "no_gap"), (1.15, "ambiguous"), (1.25, "ambiguous")]
)
def test_noise_that_may_be_coloured_lets_no_one_say_that_there_is_no_gap(
    factor: float, verdict: str
) -> None:
    """A force that changes in every row shows little of its noise: a gap may be noise of it."""
    found = diagnose(slider_rig(), {"r": slider(1, factor, memory=0.9)})
    assert (found.verdict, found.effects) == (verdict, ())
    if verdict == "ambiguous":
        assert "may be coloured noise of its input" in found.summary
        assert found.next_test.startswith("Record an input that changes less often")
        assert found.stage("loader").as_dict()["judged"] is False


def hissing(noise_N: float, factor: float = 1.0) -> Record:
    """Return the slide's record with white noise on its force."""
    record = slider(1, factor)
    data = record.data.copy()
    hiss = np.random.default_rng(1).normal(scale=noise_N, size=len(record))
    data[:, record.channels.index("column_force_N")] += hiss
    return replace(record, data=data)


def test_the_noise_of_a_force_in_steps_is_that_between_them() -> None:
    """It was 2.4 times as large, and 24 times with five steps a second: wrong damping was noise."""
    reader = readers_of({"r": slider_rig()}, {"r": hissing(0.02)}, "column")[0]
    assert reader.driving("force").rms == pytest.approx(0.02, rel=0.15)


@pytest.mark.slow
def test_a_damping_is_found_under_a_force_in_steps() -> None:
    found = diagnose(slider_rig(), {"r": slider(1, 1.5)})
    (damping,) = found.effects
    assert (damping.name, found.verdict) == ("viscous_damping", "effect")
    assert damping.value == pytest.approx(1.5, rel=0.02)


def test_noise_that_hides_a_damping_between_restarts_is_no_proof_of_health() -> None:
    """The floor was compared with the whole travel; a short replay predicts far less motion."""
    found = diagnose(slider_rig(), {"r": hissing(2.0, 1.3)})
    stage = found.stage("loader").as_dict()
    assert (found.verdict, stage["judged"]) == ("ambiguous", False)
    assert 0.15 < stage["floor_share"] < 0.35


@pytest.mark.slow
@pytest.mark.parametrize("noise_N", [0.0, 0.1])
@pytest.mark.parametrize("factor", [1.1, 1.4])
def test_an_effect_is_not_left_to_a_parameter_far_beyond_its_tolerance(
    factor: float, noise_N: float
) -> None:
    """A force held for each frame comes half a frame late; it is read as in between.

    With the damping at ten standard deviations of its prior, a skew alone left noise.
    """
    found = diagnose(held_force_rig(), {"r": held_force(1, factor, noise_N)})
    known = {effect.name: effect for effect in found.effects}
    assert found.verdict == "effect"
    assert known.keys() == {"viscous_damping", "force_skew"}
    assert known["viscous_damping"].value == pytest.approx(factor, rel=0.01)
    assert known["force_skew"].value == pytest.approx(-0.005, abs=0.0005)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [12, 14, 15])
def test_a_damping_is_as_sure_whichever_of_equal_laws_stands_beside_it(seed: int) -> None:
    """Five stretches for seven numbers, of which priors know four, left no degree of freedom."""
    found = diagnose(motor_rig(), {"r": motor(seed, seconds=10.0 + 2.0 * (seed % 6))})
    known = {effect.name: effect for effect in found.effects}
    assert known["viscous_damping"].probability >= 0.6
    assert known["viscous_damping"].value == pytest.approx(2.0, rel=0.05)


@pytest.mark.slow
def test_of_alternatives_one_whose_size_is_determined_is_reported() -> None:
    """Dry friction one way is also an offset; its own interval may contain zero."""
    found = diagnose(motor_rig(), {"r": motor(14, seconds=14.0)})
    assert len(found.rivals[0]) > 2
    for effect in found.effects:
        sizes = [p for p in effect.parameters if p.name in ("friction_N", "offset_N", "pull_N")]
        assert all(p.low is not None and p.high is not None and p.low * p.high > 0 for p in sizes)


@pytest.mark.slow
def test_a_wrong_scale_does_not_stand_for_damping_and_friction_together() -> None:
    """A scale of the force alone takes nearly all of the gap. One way, friction is an offset."""
    found = diagnose(motor_rig(), {"r": motor()})
    known = {effect.name: effect for effect in found.effects}
    assert known["viscous_damping"].value == pytest.approx(2.0, rel=0.05)
    assert known["viscous_damping"].probability >= 0.6
    assert len(known) == 2
    (other,) = known.keys() - {"viscous_damping"}
    assert other in ("force_offset", "force_zero", "coulomb_friction", "breakout")
    value = known[other].value
    assert value is not None and abs(value) == pytest.approx(MOTOR_DRY_N, rel=0.05)
    assert known[other].probability < 0.5


def test_only_what_the_machine_has_is_worth_recording() -> None:
    lacking = ["dynamic_pressure_Pa", "column_deflection_m", "column_estimate_m"]
    rig = duffing_rig()
    for stage in ("schedule", "linkage", "compensation"):
        assert worth_recording(rig, "column", stage, lacking) == set()
    assert worth_recording(rig, "column", "loader", ["column_force_N"]) == {"column_force_N"}
    assert worth_recording(nominal_rig(False), "column", "linkage", lacking) == set(lacking)


def test_a_filtered_log_has_the_rig_files_noise_where_it_gives_some() -> None:
    ramp = np.linspace(0.0, 1.0, 1000)
    rig = duffing_rig()
    assert "1/1000" in floor_from(rig, "column_force_N", ramp)
    known = rig.changed({"noise": {"column_force_N": 0.1}})
    assert floor_from(known, "column_force_N", ramp) == "the rig file"
