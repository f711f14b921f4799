"""What a pilot feels, held against what is specified, on a rig that flies."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.authority.heldcontrol import average_held_forces
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, configure
from coupled.flight.pilot import PILOTS
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.schema import build


def test_a_bob_weight_is_no_part_of_the_felt_gradient() -> None:
    """In a pull-up the held force contains b·(n_z − 1), which is subtracted."""
    loader = "controls.column.loader"
    heavy = {f"{loader}.bob_weight_N_per_g": 60.0, f"{loader}.friction_N": 0.0}
    rig = read_rig(shipped_rigs()["c172p"]).changed(heavy)
    rigid = configure(rig, "rigid")
    clamp = build(PILOTS["clamp"], {"kind": "clamp", "deflection_m": 0.05}, "t", "pilot.column")
    manoeuvre = Manoeuvre(rigid, {"column": clamp}, 2.0)
    record = fly(manoeuvre)
    assert np.max(record["load_factor"]) > 1.3
    felt, specified = average_held_forces(manoeuvre, "column", record)
    assert felt == pytest.approx(specified, rel=0.03)
    assert 60.0 * (np.mean(record["load_factor"]) - 1.0) > 0.1 * specified
