"""The frame step by its arrays' addresses does what the frame step does."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.resources import shipped_rigs
from coupled.rig.frame import CHANNELS_PER_CONTROL, step_frame
from coupled.rig.packing import pack
from coupled.rig.placed import Placed
from coupled.rig.rigfile import read_rig

FRAMES = 40
MOTION = (3000.0, 1.2, *np.linspace(-1.0, 1.0, 13).tolist())


@pytest.mark.parametrize("rig_name", ["737", "bench"])
def test_a_frame_by_address_is_the_frame_by_array(rig_name: str) -> None:
    rig = read_rig(shipped_rigs()[rig_name])
    width = 1 + CHANNELS_PER_CONTROL * len(rig.controls) + len(MOTION)
    rng = np.random.default_rng(5)
    noise = 1e-3 * rng.standard_normal((FRAMES, width))
    script = rng.standard_normal((len(rig.controls), 2, FRAMES * rig.substeps + 1)).cumsum(axis=2)
    given, placed = (pack(rig), noise.copy()), (pack(rig), noise.copy())
    at = Placed(placed[0], script, placed[1], rig.frame_rate)
    for k in range(FRAMES):
        by_array = step_frame(given[0], script, given[1], k, MOTION, MOTION[1])
        by_address = at.frame(k, MOTION)
        assert by_array == by_address
    assert np.array_equal(given[1][:, 1:], placed[1][:, 1:])
    assert np.array_equal(placed[1][:, 0], np.arange(FRAMES) / rig.frame_rate)
    assert given[0].tobytes() == placed[0].tobytes()
    assert placed[1][:, -len(MOTION) :] == pytest.approx(noise[:, -len(MOTION) :] + MOTION)


def test_a_non_contiguous_array_is_refused() -> None:
    rig = read_rig(shipped_rigs()["bench"])
    controls, script = pack(rig), np.zeros((1, 2, 9))
    with pytest.raises(AssertionError):
        Placed(controls, script, np.zeros((8, 12))[:, ::2], rig.frame_rate)
