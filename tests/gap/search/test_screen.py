"""The screen: the right effect is fitted, however far the gap is from linear in its size."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import coupled
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import fly_force
from tests.support import threecontrols
from tests.support.airframes import noisy

# A doublet and a 3-2-1-1: the length of each pulse, s, and its sign.
PULSES = ((1.0, 1), (1.0, -1), (4.0, 0), (2.1, 1), (1.4, -1), (0.7, 1), (0.7, -1))


def pulses(times: NDArray[np.float64], begun_s: float) -> NDArray[np.float64]:
    """Return pulses of unit size that rise and fall within 0.15 s."""
    found = np.zeros_like(times)
    for length_s, sign in PULSES:
        for edge_s, step in ((begun_s, sign), (begun_s + length_s, -sign)):
            found += step * np.clip((times - edge_s) / 0.15, 0.0, 1.0)
        begun_s += length_s
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("offset_N", "push_N", "begun_s"),
    [(-1.0, 22.0, 2.0), (-0.5, 22.0, 2.0), (0.5, 28.0, 14.0)],
)
def test_a_constant_force_on_a_wheel_that_sticks_has_its_name(
    offset_N: float, push_N: float, begun_s: float
) -> None:
    """20 N of breakout and friction hold the wheel: where it stops depends on the sign."""
    noise = {"force_N": 0.05, "computed_rad": 2e-4, "deflection_rad": 2e-4}
    jet = coupled.load_rig("737").changed({"noise": {f"wheel_{k}": v for k, v in noise.items()}})
    real = apply(jet, "wheel", [BY_NAME["force_offset"]], {"force_offset.offset_N": offset_N})
    times = np.arange(round(40.0 * jet.frame_rate)) / jet.frame_rate
    force = push_N * pulses(times, begun_s)
    found = diagnose(jet, {"r": fly_force(real, {"wheel": force}, seed=3)}, "wheel")
    (effect,) = found.effects
    (number,) = effect.parameters
    assert (found.verdict, effect.name) == ("effect", "force_offset")
    assert number.low is not None and number.high is not None
    assert number.low < offset_N < number.high


@pytest.mark.slow
def test_a_large_gap_has_the_name_whose_signature_is_out_of_phase_with_it() -> None:
    """At 0.8 of the yaw inertia the motion is faster: the gap is no multiple of the slope."""
    jet = noisy(coupled.load_rig("t37"))
    record = threecontrols.flown(jet, {"flight.yaw_inertia": 0.8}, 40.0, pedals=160.0)
    (effect,) = diagnose(jet, {"r": record}).effects
    assert effect.name == "yaw_inertia"
    assert effect.parameters[0].value == pytest.approx(0.8, rel=0.01)
