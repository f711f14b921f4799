"""Why a model does not trim, in words, and the speeds at which it does."""

from __future__ import annotations

import re

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.imbalance import Floats, imbalance
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Step
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.units import FOOT_m

LOW, HIGH = np.array([-0.35, 0.0, -1.0]), np.array([0.5, 1.0, 1.0])
NEEDS = (0.1, 0.5, -0.2)


@pytest.mark.parametrize(
    ("needs", "says"),
    [
        (NEEDS, ""),
        ((0.1, 1.5, -0.2), "5 m/s² backwards remain with the throttle full"),
        ((0.1, -0.5, -0.2), "5 m/s² forwards remain with the throttle closed"),
        (
            (0.6, 0.5, -0.2),
            "2 m/s² downwards remain with the angle of attack at its limit, 0.5 rad",
        ),
        ((0.1, 0.5, -1.5), "2 rad/s² nose down remain with the elevator full up"),
    ],
)
def test_the_control_at_its_limit_is_named(needs: tuple[float, float, float], says: str) -> None:
    """Each acceleration by one control: throttle, α, elevator."""
    gains = np.array([10.0 / FOOT_m, -20.0 / FOOT_m, -4.0])
    assert (
        imbalance(
            lambda x: np.asarray(gains * (x[[1, 0, 2]] - np.array(needs)[[1, 0, 2]])), LOW, HIGH
        )
        == says
    )


def test_a_wing_that_stalls_is_said_to_give_no_more_lift() -> None:
    def stalls(x: Floats) -> Floats:
        lift = 8.0 - 200.0 * (x[0] - 0.2) ** 2
        return np.array([x[1] - 0.5, (9.8 - lift) / FOOT_m, x[2]])

    said = imbalance(stalls, LOW, HIGH)
    assert (
        said == "1.8 m/s² downwards remain with the lift at its greatest (angle of attack 0.2 rad)"
    )


def slow(trim: str) -> Rig:
    keys = {"flight.calibrated_airspeed_m_per_s": 30.0, "flight.trim": trim}
    return read_rig(shipped_rigs()["t37"]).changed(keys)


@pytest.mark.parametrize("trim", ["jsbsim", "newton"])
def test_a_speed_below_the_stall_is_explained_and_others_are_given(trim: str) -> None:
    rig = slow(trim)
    with pytest.raises(InputError, match=r"flight\.calibrated_airspeed_m_per_s: T37 ") as caught:
        fly(Manoeuvre(rig, {"column": Step(force_N=1.0)}, 1.0))
    said = str(caught.value)
    assert re.search(r"= 30: [\d.]+ m/s² downwards remain with the lift at its greatest", said)
    ends = re.search(r"it trims at ([\d.]+) to ([\d.]+) m/s, as tried$", said)
    assert ends is not None, said
    assert 40.0 < float(ends[1]) < 60.0  # the stall of a T-37 is near 80 kt
    assert rig.flight is not None
    for end in ends.groups():
        there = rig.flight.model_copy(update={"calibrated_airspeed": float(end)})
        make_aircraft(there, 1.0 / rig.frame_rate)


@pytest.mark.slow
def test_a_height_without_any_speed_is_said_to_have_none() -> None:
    high = read_rig(shipped_rigs()["t37"]).changed({"flight.altitude_m": 25000.0})
    with pytest.raises(InputError, match="nor does it at any other speed tried, 10 to 576 m/s"):
        fly(Manoeuvre(high, {"column": Step(force_N=1.0)}, 1.0))
