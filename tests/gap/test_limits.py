"""A limit is sought from the largest one on that a record meets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.search.case import Case
from coupled.gap.search.screen import is_limit, limits
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import LIMIT_SHARES
from tests.support.gaps import made, nominal_rig, starts_of

FORCE, SERVO = BY_NAME["force_limit"], BY_NAME["servo_rate_limit"]


@given(st.floats(0.002, 1900.0))
def test_the_first_limit_tried_cuts_a_fiftieth_off_the_peak(peak: float) -> None:
    [tried] = limits(FORCE, lambda value: value < peak)
    assert 0.96 * peak < tried[0] < 0.99 * peak
    assert tried == sorted(tried, reverse=True)
    assert tried[-1] >= FORCE.free[0].low


def test_limits_of_a_servo_are_tried_two_per_cent_apart() -> None:
    """A servo made to swing by 2.54 m/s² left 10 floors at that, and 40 by 2.6."""
    servo = BY_NAME["servo_acceleration_limit"]
    few, many = limits(servo, lambda value: value < 4.9)
    assert few == pytest.approx([share * few[0] / LIMIT_SHARES[0] for share in LIMIT_SHARES])
    tried = np.asarray(many)
    assert np.all(tried[:-1] / tried[1:] < 1.021)
    assert tried[-1] < 0.05 * tried[0]


def test_none_is_tried_where_the_lowest_is_never_met() -> None:
    assert limits(SERVO, lambda value: False) == []


def test_limits_are_those_that_are_nothing_else() -> None:
    """What also bends has a size beside its limit, and is screened by that."""
    names = {effect.name for effect in EFFECTS if is_limit(effect)}
    servo = {"servo_rate_limit", "servo_acceleration_limit"}
    assert names == {"force_limit", "surface_rate_limit", "yielding_contact"} | servo


@pytest.mark.parametrize("share", [0.95, 0.88])
def test_a_fit_starts_near_a_limit_that_only_the_peaks_meet(tmp_path: Path, share: float) -> None:
    """Of peaks of 56 N, a limit of 49.5 N cut 55 frames off: 3.9 floors that nothing explained."""
    rig = nominal_rig(False)
    whole = made(tmp_path, rig, {}, 5)["column_modifying_force_N"]
    limit = share * float(np.max(np.abs(whole)))
    record = made(tmp_path, rig, {"force_limit": {"limit_N": limit}}, 5)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    case = Case(rig, "column", [one for one in outputs if one.stage == "loader"])
    [start] = starts_of(case, FORCE)
    assert start[FORCE.value_key(FORCE.free[0])] == pytest.approx(limit, rel=0.06)


def test_a_force_of_hundredths_of_a_newton_may_be_limited() -> None:
    """An F_mod of up to 0.28 N was held to 0.023 N, which was under all that might be tried."""
    [tried] = limits(FORCE, lambda value: value < 0.28)
    assert tried[-1] < 0.023


@pytest.mark.slow
def test_a_servo_that_creeps_is_found(tmp_path: Path) -> None:
    """A rate of 0.6 mm/s was below all that was tried."""
    rig = nominal_rig(False)
    true = {"servo_rate_limit": {"rate_{d}_per_s": 6e-4}}
    found = diagnose(rig, {"r": made(tmp_path, rig, true, 5)})
    assert [effect.name for effect in found.effects] == ["servo_rate_limit"], found.summary
    [number] = found.effects[0].parameters
    assert number.value == pytest.approx(6e-4, rel=0.02)
