"""Effects of the airframe, on records of models edited by hand, diagnosed by the nominal rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from coupled.flight import loop
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.flown import fly_force
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.gaps import pushes
from tests.support.models import edited_model, multiplied
from tests.support.records import NOISE


def flown_by(
    folder: Path, monkeypatch: pytest.MonkeyPatch, rig: Rig, factors: dict[str, float]
) -> Record:
    """Return a noisy record of a rig whose model has coefficients that are off."""
    assert rig.flight is not None
    models = edited_model(folder, rig.flight.model, multiplied(factors))
    _, force = pushes(11, 25.0)
    with monkeypatch.context() as patch:
        patch.setattr(loop, "aircraft_folder", lambda: models)
        return fly_force(rig.changed({"noise": NOISE}), {"column": force[:-1]}, seed=7)


def effect(found: dict[str, Any], name: str) -> dict[str, Any]:
    (only,) = found["effects"]
    assert only["name"] == name
    factor: dict[str, Any] = only["parameters"]["factor"]
    return factor


@pytest.mark.slow
def test_a_cessna_damped_by_half_is_diagnosed_as_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """C_mq × 0.53, all else as filed: a moment made by the elevator once gave 0.70 ± 0.01."""
    full = read_rig(shipped_rigs()["c172p"])
    rig = full.changed({"controls": {"column": full.controls["column"]}})
    record = flown_by(tmp_path, monkeypatch, rig, {"/Cmq": 0.53})
    assert not record.manifest["ended_early"]
    found = diagnose(rig, {"worn.csv": record}, "column").as_dict()
    assert found["verdict"] == "effect"
    factor = effect(found, "pitch_damping")
    assert factor["low"] < 0.53 < factor["high"]
    assert factor["value"] == pytest.approx(0.53, abs=0.02)


@pytest.mark.slow
def test_a_cessna_that_is_less_stable_and_trims_elsewhere_is_diagnosed_as_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """C_mα × 0.8: its elevator stands 0.008 rad off the nominal trim."""
    full = read_rig(shipped_rigs()["c172p"])
    rig = full.changed({"controls": {"column": full.controls["column"]}})
    record = flown_by(tmp_path, monkeypatch, rig, {"/Cmalpha": 0.8})
    assert not record.manifest["ended_early"]
    whole = diagnose(rig, {"aft.csv": record}, "column")
    airframe = whole.stage("airframe")
    assert airframe.guilty and not airframe.unexplained
    factor = effect(whole.as_dict(), "pitch_stiffness")
    assert factor["low"] < 0.8 < factor["high"]
    assert factor["value"] == pytest.approx(0.8, abs=0.01)
