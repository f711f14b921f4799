"""Records that do not begin at rest, as after a cut, and rigs without a radius of an arc."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import coupled
from coupled.gap.diagnose import diagnose
from coupled.gap.prepare import readers_of
from coupled.gap.stages.tried import has_arc
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.rigs import bench

LOADER = "controls.column.loader."
CHANNELS = ("column_force_N", "column_computed_m", "column_deflection_m", "dynamic_pressure_Pa")
NOISE = {
    "noise.column_force_N": 0.15,
    "noise.column_computed_m": 2e-5,
    "noise.column_deflection_m": 4e-5,
}
CUT_s = 5.37


def moved(rig: Rig, changes: dict[str, Any], without: str = "", from_s: float = CUT_s) -> Record:
    """Return a record of a bench that begins in the midst of a sweep."""
    sweep = coupled.FrequencySweep(force_N=60.0, low_Hz=0.2, high_Hz=2.0, duration_s=17.0)
    flown = rig.changed({**NOISE, **changes})
    record = coupled.fly(flown, column=sweep, duration_s=18.0, dynamic_pressure_Pa=0.0).record
    kept = record.time_s >= from_s
    names = [name for name in CHANNELS if name != without]
    time_s = record.time_s[kept] - record.time_s[kept][0]
    return Record(("time_s", *names), np.column_stack([time_s, *(record[n][kept] for n in names)]))


@pytest.mark.parametrize("without", ["", "column_computed_m", "column_deflection_m"])
def test_a_healthy_record_may_begin_in_motion(without: str) -> None:
    rig = bench({})
    record = moved(rig, {}, without)
    [reader] = readers_of({"r": rig}, {"r": record}, "column")
    assert reader.begins_moved
    assert not readers_of({"r": rig}, {"r": moved(rig, {}, without, 0.0)}, "column")[0].begins_moved
    found = diagnose(rig, {"r": record})
    assert found.verdict == "no_gap", found.summary
    assert any(stage.name == "loader" and stage.gap is not None for stage in found.stages)


@pytest.mark.parametrize("without", ["", pytest.param("column_computed_m", marks=pytest.mark.slow)])
def test_what_is_found_does_not_depend_on_the_cut(without: str) -> None:
    rig = bench({})
    found = diagnose(rig, {"r": moved(rig, {LOADER + "friction_N": 4.0}, without)})
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name == "coulomb_friction"
    assert effect.value == pytest.approx(4.0, rel=0.02)


def test_an_arc_without_a_radius_is_no_effect() -> None:
    """A gauge of 1 N a step made an arc of no radius explain 0 % of a healthy linkage."""
    rig = bench({"controls.column.length_m": 0.0})
    assert not has_arc(rig, "column")
    assert has_arc(bench({}), "column")
    record = moved(rig, {}, from_s=0.0)
    data = record.data.copy()
    data[:, 1] = np.round(data[:, 1])
    found = diagnose(rig, {"r": Record(record.channels, data)})
    assert found.verdict == "no_gap", found.summary
