"""Which effects are fitted, of those that a screen lets pass."""

from __future__ import annotations

import math

import numpy as np
import pytest

from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.candidates import fitted_candidates
from coupled.gap.search.case import Case
from coupled.gap.signals.output import Output
from coupled.rig.rig import Rig
from tests.support.gaps import nominal_rig

FRAMES = 2400


@pytest.mark.parametrize(("alike", "asked"), [(0.0, False), (0.995, True)])
def test_a_flight_is_not_fitted_that_takes_far_too_little(alike: float, asked: bool) -> None:
    """Beside two of which one leaves noise alone: each evaluation of such a fit is a flight.

    One whose signature takes nearly as much may be as good with its settings, and is fitted.
    """
    acts = np.random.default_rng(3).normal(size=(4, FRAMES))
    names = ("pitch_damping", "elevator_effectiveness", "pitch_stiffness")
    turned = alike * acts[0] + math.sqrt(1.0 - alike**2) * acts[2]
    shapes = dict(zip(names, (acts[0], 0.99 * acts[0] + 0.1 * acts[1], turned), strict=True))

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        assert rig.flight is not None
        numbers = {name: getattr(rig.flight, name) for name in names}
        return np.asarray(sum(100.0 * (numbers[name] - 1.0) * shapes[name] for name in names))

    rig = nominal_rig(True)
    assert rig.flight is not None
    airframe = Output("airframe", "x", 40.0 * acts[0] + acts[3], predict, 1.0, 120.0)
    told = list[str]()
    case = Case(rig, "column", [airframe], lambda what, *_: told.append(what))
    effects = [BY_NAME[name] for name in names]
    ranked = fitted_candidates(case, case.fit(()), effects, {"airframe"})
    assert ranked[0].effect.name == "pitch_damping"
    assert ("fitting pitch_stiffness" in told) == asked
    assert "fitting elevator_effectiveness" in told
