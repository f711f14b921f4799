"""A share of the wheel's force that reaches the column's loader, named by the wheel's record."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import fly_force
from coupled.record.record import Record
from tests.support.gaps import pushes
from tests.support.joined import joined
from tests.support.records import NOISE

SHARE = 0.15
APART = {
    "structure.column_by_wheel_m_per_N": 0.0,
    "structure.wheel_by_column_rad_per_N": 0.0,
    "structure.reciprocal": False,
    "frame_rate_Hz": 120.0,
}


def recorded(share: float) -> Record:
    """Return 40 s of pushes on column and wheel at once, with noise."""
    noise = {name: level for name, level in NOISE.items() if name.startswith("column")}
    noise |= {"wheel_force_N": 0.15, "dynamic_pressure_Pa": 1.0}
    rig = joined(APART | {"controls.column.loader.crosstalk": share, "noise": noise})
    (_, column), (_, wheel) = pushes(3), pushes(8, 40.0)
    pressure = np.interp(np.arange(len(column)), [0.0, 2000.0, 4800.0], [500.0, 2500.0, 1200.0])
    return fly_force(rig, {"column": column[:-1], "wheel": wheel[:-1]}, pressure[:-1], seed=3)


@pytest.mark.slow
def test_it_is_named_at_its_size() -> None:
    found = diagnose(joined(APART), {"r.csv": recorded(SHARE)}, "column")
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert effect.name == "crosstalk"
    (number,) = effect.parameters
    assert number.low is not None and number.high is not None
    assert number.low < SHARE < number.high
    assert number.high - number.low < 0.1 * SHARE
    assert found.closed_loop is not None  # the improved rig has the wheel, and flies nearer
    assert found.improves
    again = {one.channel: one for one in found.closed_loop}["column_computed_m"]
    assert again.after < 0.2 * again.before


def test_without_another_force_in_the_record_it_is_not_tried() -> None:
    record = recorded(0.0)
    keep = [name for name in record.channels if not name.startswith("wheel")]
    alone = Record(tuple(keep), np.column_stack([record[name] for name in keep]))
    assert BY_NAME["crosstalk"].can_be_tried([record], "column")
    assert not BY_NAME["crosstalk"].can_be_tried([record, alone], "column")
    assert not BY_NAME["crosstalk"].can_be_tried([alone], "column")
