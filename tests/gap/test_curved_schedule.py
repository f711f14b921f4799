"""Rigs whose feel is a curve over deflection and dynamic pressure are diagnosed and fitted."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.chain import Part
from coupled.gap.diagnose import findings
from coupled.gap.effects.library import library_of
from coupled.gap.nominal import fit_nominal
from coupled.gap.prepare import prepare
from coupled.gap.search.histories import search
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.curves import CYCLIC, CYCLIC_N, column, curved
from tests.support.gaps import made

Values = dict[str, dict[str, float]]
FRAMES = {"frame_rate_Hz": 120.0}
COLUMN = column().changed(FRAMES)
FLAT = curved(CYCLIC, [CYCLIC_N], {"friction_N": 3.0, "breakout_N": 2.0}).changed(FRAMES)
RIGS = {"column": (COLUMN, 120.0), "cyclic": (FLAT, 45.0)}  # the largest force of the hand, N
SLOPE: Values = {"schedule_slope": {"factor": 1.1}}
BEND: Values = {"bend": {"bend_{d}_per_N": 1.6e-4}}
FRICTION: Values = {"coulomb_friction": {"friction_N": 6.0}}
SCALE: Values = {"force_scale": {"factor": 1.06}}


def flown(folder: Path, of: str, values: Values) -> tuple[Rig, Record]:
    """Return a rig, and a record of it with the effects of `values`."""
    rig, most = RIGS[of]
    return rig, made(folder, rig, values, 7, most)


@pytest.mark.parametrize("of", RIGS)
def test_each_stage_of_a_healthy_rig_is_reproduced(tmp_path: Path, of: str) -> None:
    rig, record = flown(tmp_path, of, {})
    outputs = prepare(rig, {"r": record}, Part("column")).case.outputs
    stages = ["schedule", "loader", "multiplier", "linkage", "compensation"]
    assert [one.stage for one in outputs] == stages
    assert all(one.gap(rig) < one.limit for one in outputs)


def test_a_slope_of_the_schedule_explains_gradient_position_and_force(tmp_path: Path) -> None:
    rig, record = flown(tmp_path, "column", SLOPE)
    case = prepare(rig, {"r": record}, Part("column")).case
    shown = [one for one in case.outputs if one.gap(rig) > one.limit]
    assert [one.stage for one in shown] == ["schedule", "loader", "multiplier"]
    (effect,) = (one for one in library_of(rig, "column") if one.name == "schedule_slope")
    assert effect.shows_in == ("schedule", "loader", "multiplier")
    sloped = rig.changed({"controls.column.schedule.slope": 1.1})
    assert all(one.gap(sloped) < one.limit for one in shown)


def test_a_curve_needs_the_pressure_and_not_the_gradient(tmp_path: Path) -> None:
    rig, record = flown(tmp_path, "column", {})
    table = record.to_polars()
    without = Record.from_frame(table.drop("column_gradient_N_per_m"))
    loader = prepare(rig, {"r": without}, Part("column")).case.outputs[0]
    assert loader.stage == "loader" and loader.gap(rig) < loader.limit
    blind = Record.from_frame(table.drop("dynamic_pressure_Pa"))
    lacking = Reader(rig, blind, "column", surface_points).missing()
    assert lacking["loader"] == lacking["multiplier"] == ["dynamic_pressure_Pa"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "values"),
    [
        *((of, each) for of in RIGS for each in ({}, BEND, FRICTION, SCALE)),
        ("column", SLOPE),  # the cyclic's curve is the same at any pressure
    ],
)
def test_an_effect_is_found_with_its_number_and_no_other(
    tmp_path: Path, of: str, values: Values
) -> None:
    rig, record = flown(tmp_path, of, values)
    made_ready = prepare(rig, {"r": record}, Part("column"))
    found = findings(made_ready, *search(made_ready.case, made_ready.library))
    assert found.verdict == ("effect" if values else "no_gap")
    assert [one.name for one in found.effects] == list(values)
    assert found.curves == ()
    for effect in found.effects:
        (true,) = values[effect.name].values()
        (parameter,) = effect.parameters
        assert parameter.value == pytest.approx(true, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("of", RIGS)
def test_a_fit_finds_the_numbers_of_a_loader_with_a_curve(tmp_path: Path, of: str) -> None:
    rig, record = flown(tmp_path, of, {})
    loader = rig.controls["column"].loader
    numbers = {"mass_kg": loader.mass, "damping_N_s_per_m": loader.damping}
    numbers["friction_N"] = loader.friction
    start = rig.changed({f"controls.column.loader.{key}": 1.4 * v for key, v in numbers.items()})
    fitted = fit_nominal(start, {"r": record}, [f"loader.{key}" for key in numbers], "column")
    found = {one.key.rpartition(".")[2]: one.found for one in fitted.numbers}
    assert found == pytest.approx(numbers, rel=0.02)
