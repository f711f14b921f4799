"""Channels in another unit or with a reversed sign: refused by name, unlike a gap of its size."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import coupled
from coupled.errors import InputError
from coupled.gap.chain import Part
from coupled.gap.checks import check_units
from coupled.gap.prepare import prepare
from coupled.record.importing.judging import judge
from coupled.record.importing.redundant import other_units
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.units import POUND_N, DEGREE_rad, FOOT_m, GRAVITY_m_per_s2, KNOT_m_per_s, PSF_Pa
from tests.support.records import NOISE

Floats = NDArray[np.float64]
MOTION = ("elevator_rad", "pitch_rate_rad_per_s", "load_factor", "pitch_rad", "alpha_rad")
FEEL = ("column_force_N", "column_computed_m", "column_deflection_m", "dynamic_pressure_Pa")
NAMES = ("time_s", *FEEL, *MOTION, "true_airspeed_m_per_s", "altitude_m")
RIG = coupled.load_rig("report-column")
BY_RIG = {"altitude_m"}  # left out: the altitude is then the rig's


def flown(rig: Rig) -> Record:
    """Return a noisy record of a column that is swept, without the host's own channels."""
    sweep = coupled.FrequencySweep(force_N=40, low_Hz=0.1, high_Hz=2, duration_s=18)
    record = coupled.fly(rig.changed({"noise": NOISE}), column=sweep, duration_s=20).record
    return Record(NAMES, np.column_stack([record[name] for name in NAMES]))


def spoiled(record: Record, name: str, factor: float, without: set[str] = BY_RIG) -> Record:
    kept = tuple(one for one in record.channels if one not in without)
    columns = [record[one] * (factor if one == name else 1.0) for one in kept]
    return Record(kept, np.column_stack(columns))


@pytest.fixture(scope="module")
def healthy() -> Record:
    return flown(RIG)


FAULTS = [
    ("dynamic_pressure_Pa", 1.0 / PSF_Pa, "is in psf", "psf"),
    ("dynamic_pressure_Pa", 0.01, "is in hPa", "hPa"),
    ("dynamic_pressure_Pa", 1.0 / 3386.389, "is in inHg", "inHg"),
    ("true_airspeed_m_per_s", 1.0 / KNOT_m_per_s, "is in kt", "kt"),
    ("pitch_rate_rad_per_s", 1.0 / DEGREE_rad, "is in deg/s", "deg/s"),
    ("pitch_rad", 1.0 / DEGREE_rad, "is in deg", "deg"),
    ("load_factor", GRAVITY_m_per_s2, "looks like m/s²", "m/s²"),
    ("load_factor", GRAVITY_m_per_s2 / FOOT_m, "looks like ft/s²", "ft/s²"),
    ("column_force_N", 1.0 / POUND_N, "is in pounds", "pounds"),
    ("elevator_rad", -1.0, "is its sign reversed", "sign"),
    ("pitch_rate_rad_per_s", -1.0, "moves against pitch_rad", "sign"),
]


@pytest.mark.parametrize(("name", "factor", "says", "word"), FAULTS)
def test_another_unit_or_sign_is_refused_and_doubted_by_name(
    healthy: Record, name: str, factor: float, says: str, word: str
) -> None:
    """A q̄ in psf was a gradient error of 383 %, a force in pounds a force scale of 0.22."""
    record = spoiled(healthy, name, factor)
    with pytest.raises(InputError, match=rf"^r: {name}: .*{says}"):
        prepare(RIG, {"r": record}, Part("column"))
    columns = {one: record[one] for one in record.channels[1:]}
    found = judge(columns, columns, record.time_s, RIG, "r")
    doubted = {one: judged.doubts for one, judged in found.items() if judged.doubts}
    assert list(doubted) == [name]
    assert word in " ".join(doubted[name])


def test_an_altitude_in_feet_changes_faster_than_the_flight_path(healthy: Record) -> None:
    record = spoiled(healthy, "altitude_m", 1.0 / FOOT_m, without=set())
    with pytest.raises(InputError, match=r"^r: altitude_m: .* is in ft"):
        check_units(RIG, record, "column", "r")


def test_without_an_airspeed_the_feel_shows_the_unit_of_a_pressure(healthy: Record) -> None:
    without = {*BY_RIG, "true_airspeed_m_per_s"}
    with pytest.raises(InputError, match=r"^r: dynamic_pressure_Pa: .* is in psf"):
        record = spoiled(healthy, "dynamic_pressure_Pa", 1.0 / PSF_Pa, without)
        check_units(RIG, record, "column", "r")


def test_without_altitude_and_rig_the_air_may_be_of_any_height(healthy: Record) -> None:
    """At 15 km the density is a seventh of that at sea level, which is no unit of a pressure."""
    for factor, unit in ((1.0, None), (1.0 / 6.0, None), (1.0 / PSF_Pa, "psf")):
        record = spoiled(healthy, "dynamic_pressure_Pa", factor)
        found = other_units({one: record[one] for one in record.channels}, None)
        assert [one.unit for one in found.values()] == ([unit] if unit else [])


def stiffer(factor: float) -> Rig:
    """Return the rig with another gradient of its loader and of its host."""
    key = "controls.column.schedule.total_gradient_N_per_m"
    old = RIG.controls["column"].schedule.total_gradient
    basic = factor * RIG.controls["column"].loader.basic_gradient
    table = {key: [factor * one for one in old]}
    return RIG.changed({**table, "controls.column.loader.basic_gradient_N_per_m": basic})


@pytest.mark.parametrize(
    ("newtons", "unit"), [(1e3, "kN"), (9.80665, "kgf or daN"), (POUND_N, "pounds")]
)
def test_a_force_in_a_larger_unit_is_refused(healthy: Record, newtons: float, unit: str) -> None:
    """In kN the loader and the linkage were "unexplained", without a word on the unit."""
    record = spoiled(healthy, "column_force_N", 1.0 / newtons)
    with pytest.raises(InputError, match=f"^r: column_force_N: .* it is in {unit}"):
        check_units(RIG, record, "column", "r")


@pytest.mark.parametrize(
    ("gradient", "channel", "factor"),
    [
        (0.225, "", 1.0),
        (0.25, "", 1.0),
        (0.5, "", 1.0),
        (2.0, "", 1.0),
        (1.0, "column_force_N", 0.5),
        (1.0, "pitch_rate_rad_per_s", 0.5),
    ],
)
def test_a_large_gap_is_no_unit(gradient: float, channel: str, factor: float) -> None:
    """A gradient of 0.225 has the static force of pounds, but bend and damping of the rig."""
    check_units(RIG, spoiled(flown(stiffer(gradient)), channel, factor), "column", "r")


def test_a_reversed_surface_is_named_without_the_attitude(healthy: Record) -> None:
    record = spoiled(healthy, "elevator_rad", -1.0, {*BY_RIG, "pitch_rad"})
    with pytest.raises(InputError, match=r"^r: elevator_rad: .* is its sign reversed"):
        prepare(RIG, {"r": record}, Part("column"))
