"""Sensors with a reversed sign or a clipped range: refused, or named beside the verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.gap.checks import check_record, clipped
from coupled.gap.diagnose import diagnose
from coupled.record.importing.plausible import drives_the_hand
from coupled.record.record import Record
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import bench

TIME_s = np.arange(1200) / 100.0
NAMES = ("time_s", "column_force_N", "column_computed_m", "column_deflection_m")


def moved(rate_Hz: float, signs: tuple[int, int, int] = (1, 1, 1)) -> Record:
    """Return a loader of 4 kg, 75 N·s/m and 560 N/m that moves in a sine, K = 9.1e-5 m/N."""
    turn = 2.0 * np.pi * rate_Hz
    place = 0.02 * np.sin(turn * TIME_s)
    rate = 0.02 * turn * np.cos(turn * TIME_s)
    force: NDArray[np.float64] = (560.0 - 4.0 * turn**2) * place + 75.0 * rate
    columns = [sign * each for sign, each in zip(signs, (force, place, place), strict=True)]
    noise = 1e-5 * np.random.default_rng(4).standard_normal((3, TIME_s.size))
    return Record(NAMES, np.column_stack([TIME_s, *(columns + noise)]))


@pytest.mark.parametrize("rate_Hz", [0.2, 1.0, 3.0])
def test_a_loader_takes_power_at_any_rate(rate_Hz: float) -> None:
    """At 3 Hz its inertia turns the force against the deflection: that is no reversed sign."""
    two = moved(rate_Hz), moved(rate_Hz * 1.3)
    force, place = (np.concatenate([each[name] for each in two]) for name in NAMES[1:3])
    assert not drives_the_hand(force, place)
    assert drives_the_hand(-force, place)


@pytest.mark.parametrize(
    ("signs", "name"),
    [((-1, 1, 1), "column_force_N"), ((1, 1, -1), "column_deflection_m")],
)
def test_a_reversed_sensor_is_refused_by_name(signs: tuple[int, int, int], name: str) -> None:
    rig = bench({})
    check_record(rig, moved(0.2), "column", "r.csv")
    with pytest.raises(InputError, match=f"r.csv: {name}: moves against column_computed_m"):
        check_record(rig, moved(0.2, signs), "column", "r.csv")


def test_a_clipped_sensor_is_named() -> None:
    record = moved(0.2)
    assert clipped(record, "column", "r.csv") == []
    data = record.data.copy()
    data[:, 1] = np.clip(data[:, 1], -10.0, 10.0)
    [said] = clipped(Record(NAMES, data), "column", "r.csv")
    assert "column_force_N of r.csv is clipped at 10" in said


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """Return a record of a T-37 as its rig file says."""
    return made(tmp_path_factory.mktemp("flown"), nominal_rig(True), {}, 5)


@pytest.mark.parametrize(
    "name", ["elevator_rad", pytest.param("pitch_rate_rad_per_s", marks=pytest.mark.slow)]
)
def test_a_motion_of_another_sign_than_the_models_is_refused(flown: Record, name: str) -> None:
    """A reversed surface was a gap that no effect explains."""
    data = flown.data.copy()
    data[:, flown.channels.index(name)] *= -1.0
    with pytest.raises(InputError, match=rf"r.csv: {name}: moves against that of .*reversed\?"):
        diagnose(nominal_rig(True), {"r.csv": replace(flown, data=data)}, "column")


@pytest.mark.slow
def test_a_motion_of_the_models_sign_is_judged(flown: Record) -> None:
    assert diagnose(nominal_rig(True), {"r.csv": flown}, "column").verdict == "no_gap"
