"""A share of another control's force that reaches a loader: superposed, and read by no gauge."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.rig.crossing import leaks
from coupled.rig.frame import CHANNELS_PER_CONTROL, step_frame
from coupled.rig.hosted import Feel
from coupled.rig.nodes import on_nodes
from coupled.rig.packing import pack
from coupled.rig.replay import drive_loader
from coupled.rig.rig import Rig
from tests.support.joined import joined

SHARE = 0.2
APART: dict[str, Any] = {
    "structure.column_by_wheel_m_per_N": 0.0,
    "structure.wheel_by_column_rad_per_N": 0.0,
    "structure.reciprocal": False,
}
Floats = np.ndarray[Any, np.dtype[np.float64]]


def run(rig: Rig, column_N: Floats, wheel_N: Floats) -> tuple[Floats, Floats]:
    """Return the channels of column and wheel under forces on the loader's nodes."""
    packed = pack(rig)
    frames = (len(column_N) - 1) // rig.substeps
    script = np.zeros((2, 2, len(column_N)))
    script[0, 0], script[1, 0] = column_N, wheel_N
    record = np.zeros((frames, 2 + 2 * CHANNELS_PER_CONTROL))
    for k in range(frames):
        step_frame(packed, script, record, k, (1000.0,), 1.0)
    both = record[:, 1:-1].reshape(frames, 2, CHANNELS_PER_CONTROL)
    return both[:, 0], both[:, 1]


@pytest.mark.parametrize(("name", "own"), [("column", 0), ("wheel", 1)])
def test_a_linear_loader_superposes_what_leaks_into_it(name: str, own: int) -> None:
    rig = joined(APART)
    times = np.arange(120 * rig.substeps + 1) / (rig.frame_rate * rig.substeps)
    forces = [60.0 * np.sin(5.0 * times), 40.0 * np.cos(7.0 * times)]
    leaking = rig.changed({f"controls.{name}.loader.crosstalk": SHARE})
    got = run(leaking, *forces)
    alone = run(rig, *forces)
    more = list(forces)
    more[own] = forces[own] + SHARE * forces[1 - own]
    wanted = run(rig, *more)
    np.testing.assert_allclose(got[own][:, 1], wanted[own][:, 1], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(got[own][:, 0], alone[own][:, 0])  # F as read is the hand's
    np.testing.assert_array_equal(got[1 - own], alone[1 - own])


def test_a_replay_has_the_crosstalk_of_the_flight() -> None:
    rig = joined(APART | {"controls.column.loader.crosstalk": SHARE})
    times = np.arange(120 * rig.substeps + 1) / (rig.frame_rate * rig.substeps)
    column, wheel = 60.0 * np.sin(5.0 * times), 40.0 * np.sin(7.0 * times)
    flown, _ = run(rig, column, wheel)
    at = slice(0, 120 * rig.substeps, rig.substeps)
    gradient = Feel(flown[:, 4])
    force = column[at] + SHARE * wheel[at]
    made, _ = drive_loader(rig, "column", on_nodes(rig, force), gradient, np.zeros(120))
    np.testing.assert_allclose(made, flown[:, 1], rtol=0, atol=2e-8)


def test_crosstalk_comes_from_the_wheel_or_from_the_control_that_the_rig_has() -> None:
    assert leaks("column", 0.1, ["column", "wheel", "pedals"]) == (0.0, 0.1, 0.0)
    assert leaks("wheel", 0.1, ["column", "wheel", "pedals"]) == (0.1, 0.0, 0.0)
    assert leaks("pedals", 0.1, ["column", "pedals"]) == (0.1, 0.0)
    assert leaks("column", 0.1, ["column"]) == (0.0,)
