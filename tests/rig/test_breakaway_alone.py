"""Friction that breaks away and leaves none behind, on a contact that yields."""

from __future__ import annotations

import numpy as np

from coupled import load_rig
from coupled.rig.hosted import Feel
from coupled.rig.nodes import on_nodes
from coupled.rig.replay import drive_loader


def test_a_loader_with_breakaway_alone_moves_on_without_friction() -> None:
    loader = {"breakaway_N": 0.4, "stribeck_rate_m_per_s": 1e-4, "friction_stiffness_N_per_m": 1e3}
    keys = {f"controls.column.loader.{key}": value for key, value in loader.items()}
    plain = load_rig("report-column").changed({"controls.column.loader.friction_N": 0.0})
    time_s = np.arange(240) / plain.frame_rate
    nodes = on_nodes(plain, 60.0 * np.sin(2.0 * np.pi * time_s))
    gradient = np.full(len(time_s), 800.0)
    still = np.zeros(len(time_s))
    rigs = (plain.changed(keys), plain)
    moved = [drive_loader(rig, "column", nodes, Feel(gradient), still)[0] for rig in rigs]
    with_it, without = moved
    assert np.all(np.isfinite(with_it))
    assert np.abs(with_it - without).max() < 0.4 / 800.0  # less than the breakaway would hold
