"""Zeros of the motion's sensors and a constant pitching moment, which imitate aerodynamic faults.

The records are of bare JSBSim, and of its model edited by hand.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.flight.aircraft import make_aircraft
from coupled.gap.checks import trimmed
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.credibility import credibility
from coupled.gap.findings.flown import fly_force
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.gap.stages.airframe import airframe_outputs
from coupled.record.channels import ControlName
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.recorder import ZEROS
from coupled.rig.rigfile import read_rig
from tests.support import threecontrols
from tests.support.airframes import noisy as noisy_rig
from tests.support.alone import alone, gaps, noisy
from tests.support.ownlogs import flown

# Zeros in the order of good sensors, far above the noise of a mean.
OFF = {
    "elevator_rad": 0.009,
    "alpha_rad": 0.012,
    "sideslip_rad": 0.01,
    "pitch_rad": 0.009,
    "load_factor": 0.01,
    "pitch_rate_rad_per_s": 0.002,
    "roll_rate_rad_per_s": 0.004,
    "yaw_rate_rad_per_s": 0.002,
}


def offset(record: Record, name: str) -> Record:
    data = record.data.copy()
    data[:, record.channels.index(name)] += OFF[name]
    return Record(record.channels, data, record.manifest)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Record:
    log, _ = flown(tmp_path_factory.mktemp("healthy"), {}, 12.0)
    return noisy(import_log(log)[0])


@pytest.mark.slow
@pytest.mark.parametrize("name", OFF)
def test_a_zero_explains_the_offset_of_its_channel(healthy: Record, name: str) -> None:
    assert {*OFF} == {*ZEROS}
    record = offset(healthy, name)
    unit = name.removeprefix(ZEROS[name].removesuffix("_zero")).removeprefix("_")
    key = f"{ZEROS[name]}_{unit}".rstrip("_")
    assert max(gaps(alone(), record, {}).values()) > 1.3
    assert max(gaps(alone(), record, {key: OFF[name]}).values()) < 1.2


def test_a_constant_moment_is_that_of_the_models_own_function(tmp_path: Path) -> None:
    log, _ = flown(tmp_path, {"/Cmo": 1.2}, 9.0)
    record = noisy(import_log(log)[0])
    assert max(gaps(alone(), record, {}).values()) > 2.0
    assert max(gaps(alone(), record, {"pitching_moment": 0.02}).values()) < 1.2  # C_m0 is 0.1


@pytest.mark.slow
def test_an_aircraft_with_other_fuel_is_named_as_that(tmp_path: Path) -> None:
    """Its mass, its centre of gravity and all its moments of inertia differ."""
    log, _ = flown(tmp_path, {}, 20.0, fuel=0.4)
    found = diagnose(alone(), {"log": noisy(import_log(log)[0])})
    (effect,) = found.effects
    (factor,) = effect.parameters
    assert (found.verdict, effect.name) == ("effect", "fuel")
    assert factor.low is not None and factor.high is not None
    assert factor.low < 0.4 < factor.high < factor.low + 0.1


@pytest.mark.slow
def test_a_mass_is_not_named_as_fuel_in_tanks_at_the_centre_of_gravity() -> None:
    """In a T-37 the two act alike."""
    jet = noisy_rig(read_rig(shipped_rigs()["t37"]))
    record = threecontrols.flown(jet, {"flight.mass": 1.03}, 20.0, pedals=160.0)
    found = diagnose(jet, {"r": record})
    assert [effect.name for effect in found.effects] == ["mass"]


def test_a_constant_lift_is_added_along_the_lift() -> None:
    """With C_L more the aircraft trims at less lift due to the angle of attack."""
    names = ("aero/alpha-rad", "aero/cl-squared")

    def trim(lift: float) -> list[float]:
        rig = alone().changed({"flight.lift_offset": lift})
        assert rig.flight is not None
        made = make_aircraft(rig.flight, 1.0 / 120.0, ["column"], [aircraft_folder()], record=names)
        return list(made.extra())

    (alpha, squared), (less, same) = trim(0.0), trim(0.05)
    assert same == pytest.approx(squared, rel=0.02)  # the weight is the same
    assert 0.05 / 6.0 < alpha - less < 0.05 / 4.5  # C_Lα of the model is 5.2 to 5.5 there


def test_a_recorder_adds_the_zeros_to_its_channels_alone() -> None:
    rig = read_rig(shipped_rigs()["c172p"]).changed({"noise": {}})
    force: dict[ControlName, NDArray[np.float64]] = {"column": np.full(60, 10.0)}
    plain = fly_force(rig, force)
    read = fly_force(rig.changed({"flight.alpha_zero_rad": 0.02}), force)
    off = read.data - plain.data
    at = plain.channels.index("alpha_rad")
    assert off[:, at] == pytest.approx(0.02)
    assert not np.delete(off, at, axis=1).any()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["alpha_rad", "load_factor", "pitch_rad", "elevator_rad"])
def test_a_zero_of_a_sensor_is_found_as_such(healthy: Record, name: str) -> None:
    found = diagnose(alone(), {"log": offset(healthy, name)})
    (effect,) = found.effects
    (number,) = effect.parameters
    assert (found.verdict, effect.name, effect.stage) == ("effect", ZEROS[name], "sensing")
    assert number.low is not None and number.high is not None
    assert number.low < OFF[name] < number.high


@pytest.mark.slow
def test_a_wrong_elevator_moment_from_neutral_is_that_function(tmp_path: Path) -> None:
    """The factor of the effect counts from trim, so it needs a constant pitching moment beside."""
    log, _ = flown(tmp_path, {"/Cmde": 0.9}, 16.0, controls=1)
    found = diagnose(alone(), {"log": noisy(import_log(log)[0])})
    (effect,) = found.effects
    (factor,) = effect.parameters
    assert (found.verdict, effect.of) == ("effect", "aero/coefficient/Cmde")
    assert factor.low is not None and factor.high is not None
    assert factor.low < 0.9 < factor.high < factor.low + 0.1


def test_what_remains_of_the_motion_counts_in_full_against_a_zero(healthy: Record) -> None:
    """No function of the present signals gives the motion, so none is compared with the effect."""
    record = offset(healthy, "alpha_rad")
    rig = trimmed(alone(), {"log": record})[0]["log"]
    effect = BY_NAME["alpha_zero"]
    key, off = effect.value_key(effect.free[0]), OFF["alpha_rad"]
    right = apply(rig, "column", [effect], {key: off})
    fit = Fit((effect,), {key: off}, {key: off}, {key: off}, (), right)
    case = Case(rig, "column", airframe_outputs(rig, record))
    found = credibility(effect, case, fit, [record], 0.9)
    assert found.in_full
    assert found.value < 0.2
