"""Reasons of failed control checks: each is present exactly when its cause is."""

from __future__ import annotations

from typing import Any

import pytest

from coupled.calibration.documentation import check_feel
from coupled.calibration.reasons import reasons
from coupled.calibration.releaseschedule import schedule_for_release
from coupled.rig.rig import Rig
from tests.support.readings import report_rig

COLUMN = "controls.column"


def said(rig: Rig) -> str:
    return " ".join(reasons(rig, "column", check_feel(rig, "column")))


def test_a_release_fails_by_the_bend_and_no_reason_is_left_where_it_is_put_right() -> None:
    rig = report_rig()
    assert "springs back by the structure's bend" in said(rig)
    assert "coupled document RIG --write" in said(rig)
    assert said(schedule_for_release(rig, "column")) == ""
    assert (
        said(
            rig.changed(
                {f"{COLUMN}.loader.bend_m_per_N": 0.0, f"{COLUMN}.compensation.bend_m_per_N": 0.0}
            )
        )
        == ""
    )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"compensation.gradient": False}, "The gradient's correction is off"),
        ({"compensation.deflection": False}, "The deflection's correction is off"),
        (
            {"compensation.bend_m_per_N": 4e-5},
            "assumes K = 4e-05 m/N, and the structure has 9.136e-05",
        ),
        ({"sensing.modifying_scale": 0.7}, "Scales are off (modifying_scale = 0.7)"),
        ({"loader.breakout_N": 200.0}, "within the breakout of 200 N the loader rests"),
    ],
)
def test_each_cause_is_named(changes: dict[str, Any], words: str) -> None:
    rig = report_rig()
    assert words in said(rig.changed({f"{COLUMN}.{key}": value for key, value in changes.items()}))


def test_a_fault_that_the_file_does_not_say_is_left_to_a_diagnosis() -> None:
    rigid = {f"{COLUMN}.loader.bend_m_per_N": 0.0, f"{COLUMN}.compensation.bend_m_per_N": 0.0}
    rig = report_rig().changed({**rigid, f"{COLUMN}.loader.cubic_N_per_m3": 1e5})
    assert "coupled diagnose" in said(rig)


def test_a_force_error_above_the_breakout_is_not_blamed_on_it() -> None:
    """The bend within a breakout of 4 N was given as the reason of a force error of 100 N."""
    loader = {"breakout_N": 4.0, "cubic_N_per_m3": 1e5}
    rig = report_rig().changed({f"{COLUMN}.loader.{key}": value for key, value in loader.items()})
    words = said(rig)
    assert "within the breakout" not in words
    assert "does not show the reason of the force's error" in words
