"""A damper on a bench that imposes its motion: the force is the answer. A machine not ours.

What each answer must be was written down before it was run.
"""

from __future__ import annotations

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import EFFECTS
from coupled.gap.nominal import fit_nominal
from coupled.gap.prepare import readers_of
from coupled.gap.signals.drives import as_driven
from coupled.gap.stages.tried import as_judged
from tests.support.machines import damper, damper_rig


def test_a_damper_beside_its_own_numbers_has_no_gap() -> None:
    found = diagnose(damper_rig(), {"r": damper(play_m=0.0)})
    assert found.verdict == "no_gap"
    assert found.stage("loader").gap == pytest.approx(1.0, abs=0.15)
    assert found.closed_loop is None  # nobody flies it by its force


def test_a_grip_with_its_force_and_nothing_else_is_taken_as_moved() -> None:
    rig = damper_rig(drive="force")
    both = [damper(seconds=2.0, grip=True), damper(seconds=2.0)]
    assert as_driven(rig, both[:1], "column") == damper_rig()
    assert as_driven(rig, both[1:], "column") == rig  # a δc may be a loader's answer
    assert as_driven(rig, both, "column") == rig


def test_of_the_linkage_play_alone_shows_in_the_force_of_a_loader_that_is_moved() -> None:
    reader = readers_of(damper_rig(), {"r": damper(seconds=6.0)}, "column")[0]
    library = as_judged(EFFECTS, [reader], reader.outputs())
    moved = [effect for effect in library if effect.stage == "linkage"]
    assert [(effect.name, effect.shows_in) for effect in moved] == [("backlash", ("loader",))]


@pytest.mark.slow
@pytest.mark.parametrize("grip", [False, True])
def test_play_in_a_dampers_joints_is_named_and_measured(grip: bool) -> None:
    rig = damper_rig(drive="force" if grip else "displacement")
    if grip:  # what moves a damper at its end is no servo
        rig = rig.changed({"controls.column.loader.servo_frequency_Hz": 0.0})
    found = diagnose(rig, {"r": damper(grip=grip)})
    assert found.verdict == "effect"
    [effect] = found.effects
    assert (effect.name, effect.stage) == ("backlash", "linkage")
    assert found.guilty == ("linkage",)
    assert effect.value == pytest.approx(1.5e-3, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize(("play_m", "damping"), [(0.8e-3, 900.0), (3e-3, 2000.0)])
def test_other_plays_are_measured_as_well(play_m: float, damping: float) -> None:
    found = diagnose(damper_rig(damping), {"r": damper(play_m=play_m, damping=damping)})
    [number] = found.effects[0].parameters
    assert found.effects[0].name == "backlash"
    assert number.low is not None and number.high is not None
    assert number.low < play_m < number.high


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


@pytest.mark.parametrize("damping", [2000.0, 900.0])
def test_a_fit_finds_the_play_of_a_damper(damping: float) -> None:
    record = damper(seconds=8.0, damping=damping)
    fitted = fit_nominal(damper_rig(), {"r": record}, ["loader.play_m", "loader.damping_N_s_per_m"])
    play, found = fitted.numbers
    assert play.interval is not None
    assert play.found == pytest.approx(1.5e-3, rel=0.05)
    assert found.found == pytest.approx(damping, rel=0.02)
    assert fitted.unknown == ()
