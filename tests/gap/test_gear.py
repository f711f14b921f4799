"""The position of the gear, which a log does not show, and the effects that it imitates."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from coupled.gap.chain import Part
from coupled.gap.diagnose import findings
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.diagnosis import PartDiagnosis
from coupled.gap.findings.gear import GEAR
from coupled.gap.prepare import prepare
from coupled.gap.search.found import Choice, Found
from coupled.gap.search.problem import Problem
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.ownlogs import flown

DOWN: Mapping[str, float] = {}  # as JSBSim starts


def beside_the_gear(name: str, log: Record, gear: Mapping[str, float]) -> PartDiagnosis:
    """Return the diagnosis of a log by a rig with a given gear, if an effect has been found."""
    rig = read_rig(shipped_rigs()["t37"])
    rig = rig.changed({"controls": {}, "noise": {}, "flight.properties": gear})
    prepared = prepare(rig, {"log": log}, Part("column", own=False))
    fit, without = (Problem(prepared.case).fit(each) for each in ([BY_NAME[name]], []))
    found = Found(BY_NAME[name], gain=100.0, probability=1.0, rivals=())
    return findings(prepared, prepared.case, Choice((found,), fit, without))


@pytest.mark.slow
def test_a_gear_that_is_down_in_the_log_is_no_drag(tmp_path: Path) -> None:
    """JSBSim starts with the gear down, and a new rig file has it up."""
    log, _ = import_log(flown(tmp_path, {}, 12.0, "T37")[0])
    found = beside_the_gear("drag", log, {GEAR: 0.0})
    assert found.effects[0].probability < 0.1
    (words,) = (one for one in found.left_out if GEAR in one)
    assert words.startswith("With the gear down, and without drag, the model explains the record")
    assert f'set "{GEAR}" to 1.0' in words


@pytest.mark.slow
def test_the_gear_takes_no_effect_that_it_does_not_imitate(tmp_path: Path) -> None:
    log, _ = import_log(flown(tmp_path, {"/Cmq": 0.6}, 12.0, "T37")[0])
    found = beside_the_gear("pitch_damping", log, DOWN)
    assert found.effects[0].probability > 0.6
    assert (found.verdict, found.left_out) == ("effect", ())
