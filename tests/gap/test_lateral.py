"""Wheel and pedals: all three controls move, and the gap of one is put down to nothing else."""

from __future__ import annotations

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import Again, closed_loop, fly_force
from coupled.gap.stages.surfaces import surface_points
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support import threecontrols
from tests.support.airframes import noisy
from tests.support.threecontrols import pushes


@pytest.fixture(scope="module")
def cessna() -> Rig:
    return noisy(read_rig(aircraft_folder() / "c172p" / "c172p.toml"))


def flown(rig: Rig, control: ControlName, name: str, value: float) -> Record:
    effect = BY_NAME[name]
    real = apply(rig, control, [effect], {f"{name}.{effect.free[0].name}": value})
    return fly_force(real, pushes(rig), seed=3)


@pytest.mark.slow
def test_three_moving_controls_are_no_gap(cessna: Rig) -> None:
    record = fly_force(cessna, pushes(cessna), seed=3)
    assert max(abs(record["roll_rad"])) > 0.1  # it does roll, which pitches it, too
    for control in cessna.controls:
        found = diagnose(cessna, {"r": record}, control)
        assert found.verdict == "no_gap"
        gaps = [stage.gap for stage in found.stages if stage.gap is not None]
        assert len(gaps) == 6 and max(gaps) < 1.2
        assert found.stage("sensing").shown_in == ("loader", "linkage")


@pytest.mark.slow
@pytest.mark.parametrize(("name", "value"), [("yawing_moment", 0.002), ("side_force", 0.02)])
def test_an_aircraft_that_is_not_alike_on_both_sides_is_found(
    cessna: Rig, name: str, value: float
) -> None:
    record = threecontrols.flown(cessna, {f"flight.{name}": value}, 30.0, pedals=160.0)
    found = diagnose(cessna, {"r": record})
    (effect,) = found.effects
    (number,) = effect.parameters
    assert (found.verdict, effect.name) == ("effect", name)
    assert number.low is not None and number.high is not None
    assert number.low < value < number.high


@pytest.mark.parametrize(
    ("control", "name", "value"),
    [
        ("wheel", "surface_lag", 0.06),
        pytest.param("pedals", "rigging_offset", 0.02, marks=pytest.mark.slow),
    ],
)
def test_a_surface_of_wheel_and_pedals_is_judged(
    cessna: Rig, control: ControlName, name: str, value: float
) -> None:
    record = flown(cessna, control, name, value)
    whole = diagnose(cessna, {"r": record}, control)
    (effect,) = whole.effects
    (number,) = effect.parameters
    assert (whole.verdict, effect.name) == ("effect", name)
    assert number.low is not None and number.high is not None
    assert number.low < value < number.high
    assert whole.guilty == ("surface",)
    again = closed_loop(cessna, whole.improved, [control], Again.of(cessna, [control], record))
    assert again is not None
    rate = "roll_rate_rad_per_s" if control == "wheel" else "yaw_rate_rad_per_s"
    [turned] = [one for one in again if one.channel == rate]
    assert turned.after < 0.5 * turned.before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value"),
    [("inertia", 0.5), ("backlash", 0.12)],
    ids=["a contact that absorbed it", "turns that a column cannot move"],
)
def test_a_large_gap_of_a_wheel_has_one_name(cessna: Rig, name: str, value: float) -> None:
    """The rig file has dry friction, so that presliding parameters are fitted before the effect."""
    (number,) = BY_NAME[name].free
    real = apply(cessna, "wheel", [BY_NAME[name]], {f"{name}.{number.name}": value})
    record = fly_force(real, pushes(cessna, pedals=160.0, wheel=40.0), seed=3)
    (found,) = diagnose(cessna, {"r": record}, "wheel").effects
    assert found.name == name
    assert found.parameters[0].value == pytest.approx(value, rel=0.03)


def test_a_damped_rudder_is_not_judged_by_its_command() -> None:
    jet = noisy(read_rig(aircraft_folder() / "737" / "737.toml"))
    assert surface_points(jet, "pedals") is None  # the yaw damper moves it
    assert surface_points(jet, "wheel") is not None
    pushed = fly_force(jet, pushes(jet, pedals=160.0), seed=3)
    found = diagnose(jet, {"r": pushed}, "pedals")
    assert found.verdict == "no_gap"
    assert found.stage("loader").judged
    assert not found.stage("surface").judged
    airframe = found.stage("airframe").gap
    assert airframe is not None and airframe < 1.1


def test_pedals_held_by_their_breakout_show_nothing_of_their_loader() -> None:
    """80 N does not overcome 67 N of breakout with 15 N of friction: δc is noise alone."""
    jet = noisy(read_rig(aircraft_folder() / "737" / "737.toml"))
    found = diagnose(jet, {"r": fly_force(jet, pushes(jet, pedals=80.0), seed=3)}, "pedals")
    assert found.verdict == "ambiguous"
    loader = found.stage("loader")
    assert not loader.judged
    assert loader.why == "pedals_computed_m shows little but noise"
    assert "a force that moves pedals_computed_m" in found.next_test
    assert found.stage("airframe").judged
