"""A slide without a spring, logged at 25 Hz, with bristles for friction: not our physics."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.findings.flown import Again, closed_loop
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.machines import axis, axis_rig, sprung, sprung_rig


@pytest.mark.slow
def test_a_slide_logged_at_25_hz_has_no_gap_beside_its_own_numbers() -> None:
    """Its friction is filed, and how its contact yields is a setting."""
    found = diagnose(axis_rig(friction_N=20.0), {"r": axis()})
    assert found.verdict == "no_gap"
    assert found.effects == ()


@pytest.mark.slow
def test_its_friction_is_found_where_none_is_filed() -> None:
    found = diagnose(axis_rig(), {"r": axis(seconds=40.0)})
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name == "presliding_friction"  # its bristles of 1e6 N/m yield by 20 μm
    assert effect.value == pytest.approx(20.0, rel=0.03)
    stiffness = next(p for p in effect.parameters if p.name == "stiffness_N_per_m")
    assert stiffness.low is not None and stiffness.high is not None
    assert stiffness.low < 1e6 < stiffness.high


def test_a_bench_is_flown_again_only_if_a_spring_holds_it() -> None:
    """Without a spring any error of the force makes the motion drift."""

    def flown(rig: Rig, record: Record) -> bool:
        level = np.zeros(len(record))
        channels = (*record.channels, "dynamic_pressure_Pa")
        known = Record(channels, np.column_stack((record.data, level)))
        again = Again.of(rig, ["column"], known)
        return closed_loop(rig, rig, ["column"], again) is not None

    assert not flown(axis_rig(), axis(seconds=6.0))
    assert flown(sprung_rig(), sprung(np.zeros_like, seconds=6.0))
