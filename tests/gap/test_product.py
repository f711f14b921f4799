"""The multiplier's product: what repeats the noise of δc is how it is made, and no noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.signals.floors import remove_projection
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from tests.support.gaps import made, nominal_rig


def test_only_the_projection_on_a_signal_is_removed() -> None:
    rng = np.random.default_rng(1)
    own, echo = rng.normal(0.0, 1.0, (2, 20_000))
    for share in (0.0, 1.0, -1.0):
        left = remove_projection(own + share * echo, echo)
        assert np.std(left) == pytest.approx(1.0, rel=0.02)
        assert abs(left @ echo) < 1e-6 * float(echo @ echo)
    assert remove_projection(own, None) is own
    assert remove_projection(own, 0.0 * echo) is own


def test_the_floor_of_a_digital_product_is_that_of_an_analog_one(tmp_path: Path) -> None:
    """With what it repeats of δc's noise, the floor was half as high again, and its gap 1.0.

    Of three samples the two floors differ by 4 to 6 %, as two estimates of one noise do.
    """
    rig = nominal_rig(False).changed({"controls.column.schedule.slope": 3.0})
    floors, gaps = [], []
    for names in ((), ("digital_multiplier",)):
        record = made(tmp_path, rig, {name: {} for name in names}, 3)
        outputs = Reader(rig, record, "column", surface_points).outputs()
        (product,) = (output for output in outputs if output.stage == "multiplier")
        floors.append(product.floor)
        gaps.append(product.gap(rig))
    assert floors[1] == pytest.approx(floors[0], rel=0.1)
    assert gaps[0] == pytest.approx(1.0, abs=0.05)
    assert gaps[1] > 1.4


@pytest.mark.slow
def test_a_digital_product_is_named_by_the_noise_that_it_repeats(tmp_path: Path) -> None:
    """Half a frame of a light control's ΔG is damping a little low, within what a pot is set to."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {"digital_multiplier": {}}, 4)
    found = diagnose(rig, {"r.csv": record})
    assert [effect.name for effect in found.effects] == ["digital_multiplier"]
