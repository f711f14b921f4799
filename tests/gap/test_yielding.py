"""Dry friction of a twin whose contact yields by 0.05 to 0.5 mm: named as a law of friction."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.blind.trials.deck import read_deck
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.setting import draw_setting
from coupled.blind.twin.twin import Bristles, fly_twin, nominal_twin, set_friction
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME

pytestmark = pytest.mark.slow
LAWS = {"coulomb_friction", "presliding_friction"}
SHARES = (0.05, 0.3, 0.8)  # of the bristles' length, bent before any of it slips


@pytest.mark.parametrize("friction_N", [1.0, 3.5, 12.0])
@pytest.mark.parametrize("travel_m", [5e-5, 1.6e-4, 5e-4])
def test_friction_that_yields_is_never_unexplained(friction_N: float, travel_m: float) -> None:
    assert set(BY_NAME) >= LAWS
    at = [1.0, 3.5, 12.0].index(friction_N), [5e-5, 1.6e-4, 5e-4].index(travel_m)
    deck = read_deck(2)
    rig = deck.rigs["bench-rigid"]
    setting = draw_setting(np.random.default_rng([9, *at]), rig)
    twin = nominal_twin(rig)
    loader = rig.controls["column"].loader
    running = loader.friction + friction_N
    share = SHARES[sum(at) % 3]
    set_friction(twin, running, running, 0.002, Bristles(travel_m, elastic_share=share))
    force = 60.0 * setting.shape[: setting.frames * NODES + 1]
    record = fly_twin(rig, twin, force, setting.frames, setting.pressures, setting.noise)
    found = diagnose(rig, {"r.csv": record})
    assert found.verdict in ("effect", "mostly", "ambiguous"), found.summary
    assert found.effects[0].name in LAWS
    assert found.effects[0].probability > 0.7
    assert found.effects[0].value == pytest.approx(friction_N, rel=0.06)
