"""Records of a rig whose column, wheel and pedals all move, with noise of usual sensors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from coupled.gap.findings.flown import fly_force
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.airframes import noisy

PUSH_N = {"column": 40.0, "wheel": 25.0, "pedals": 80.0}
LONG_s = 30.0


def pushes(
    rig: Rig, long_s: float = LONG_s, **size_N: float
) -> dict[ControlName, NDArray[np.float64]]:
    """Return bell-shaped pushes of each control in turn, N; `size_N` gives those of some."""
    t = np.arange(round(long_s * rig.frame_rate)) / rig.frame_rate
    count = round(8 * long_s / LONG_s)
    made = {}
    for i, control in enumerate(rig.controls):
        rng = np.random.default_rng(i)
        sizes = rng.uniform(0.3, 1.0, count) * np.where(np.arange(count) % 2, 1.0, -1.0)
        at = 2.0 + 0.7 * i + 3.2 * np.arange(count)
        bells = np.exp(-(((t[:, None] - at) / 0.35) ** 2))
        made[control] = size_N.get(control, PUSH_N[control]) * bells @ sizes
    return made


def flown(
    rig: Rig, changes: Mapping[str, float], long_s: float = LONG_s, **size_N: float
) -> Record:
    """Return the record of a rig with some values changed, under pushes of each control."""
    return fly_force(noisy(rig).changed(changes), pushes(rig, long_s, **size_N), seed=3)
