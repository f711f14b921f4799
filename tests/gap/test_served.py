"""A record that tells of its services is diagnosed as one without them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from coupled.api.gaps import diagnose
from coupled.flight.conditions import Conditions
from coupled.flight.event import Event
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import FrequencySweep
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.schema import build

SERVICES = {
    "autopilot_stiffness_N_per_m": 2000.0,
    "autopilot_damping_N_s_per_m": 100.0,
    "override_N": 30.0,
    "pusher_N": 15.0,
}
NOISE = {"column_force_N": 0.15, "column_computed_m": 2e-5, "column_deflection_m": 4e-5}
EVENTS: dict[str, dict[str, Any]] = {
    "trim": {"service": "trim_m", "at_s": 4.0, "to": 0.01, "over_s": 1.0},
    "engage": {"service": "autopilot", "at_s": 8.0, "to": 1.0},
    "let go": {"service": "autopilot", "at_s": 11.0, "to": 0.0},
    "push": {"service": "pusher", "at_s": 13.0, "to": 1.0},
    "push no more": {"service": "pusher", "at_s": 14.5, "to": 0.0},
    "fail": {"service": "feel_lost", "at_s": 16.0, "to": 0.3, "over_s": 1.0},
}


def flown(changes: dict[str, Any]) -> tuple[Rig, Record]:
    """Return the report's column as filed, and a record of it changed, with services led."""
    rig = read_rig(shipped_rigs()["report-column"])
    given = {f"controls.column.services.{key}": value for key, value in SERVICES.items()}
    rig = rig.changed({**given, "noise": NOISE})
    events = {
        name: build(Event, {"control": "column", **keys}, "test", name)
        for name, keys in EVENTS.items()
    }
    sweep = FrequencySweep(force_N=30.0, low_Hz=0.1, high_Hz=2.0, duration_s=20.0)
    manoeuvre = Manoeuvre(rig.changed(changes), {"column": sweep}, 22.0)
    manoeuvre = replace(manoeuvre, conditions=Conditions(event=events))
    return rig, fly(manoeuvre)


@pytest.mark.slow
def test_services_that_the_record_tells_of_are_no_effect() -> None:
    rig, record = flown({})
    assert np.abs(record["column_service_force_N"]).max() > 10.0
    assert record["column_trim_m"].max() == pytest.approx(0.01)
    found = diagnose(rig, record)
    assert found.verdict == "no_gap", found.summary


@pytest.mark.slow
def test_a_backlash_beside_services_is_found() -> None:
    rig, record = flown({"controls.column.loader.play_m": 1e-3})
    found = diagnose(rig, record)
    assert [effect.name for effect in found.effects] == ["backlash"], found.summary
    assert found.effects[0].value == pytest.approx(1e-3, rel=0.05)
