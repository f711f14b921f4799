"""The multiplier's product: what repeats the noise of δc is how it is made, and no noise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.gap.chain import Part
from coupled.gap.diagnose import diagnose
from coupled.gap.prepare import prepare
from coupled.gap.signals.floors import remove_projection
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
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


@pytest.mark.parametrize(("own_N", "shown"), [(0.0, False), (0.05, True)])
def test_a_force_computed_from_the_record_does_not_show_the_multiplier(
    tmp_path: Path, own_N: float, shown: bool
) -> None:
    """A healthy bench was diagnosed as a digital multiplier with 13 % more damping."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {}, 3)
    product = Reader(rig, record, "column", surface_points)._product(record["column_computed_m"])
    data, at = record.data.copy(), record.channels.index("column_modifying_force_N")
    data[:, at] = product + own_N * np.random.default_rng(2).standard_normal(len(product))
    computed = {"r.csv": Record(record.channels, data, record.manifest)}
    prepared = prepare(rig, computed, Part("column"))
    assert any(one.stage == "multiplier" for one in prepared.case.outputs) is shown
    said = "column_modifying_force_N of r.csv was computed from the recorded column_computed_m"
    assert any(words.startswith(said) for words in prepared.left_out) is not shown


@pytest.mark.slow
def test_a_digital_product_is_named_by_the_noise_that_it_repeats(tmp_path: Path) -> None:
    """Half a frame of a light control's ΔG is damping a little low, within what a pot is set to."""
    rig = nominal_rig(False)
    record = made(tmp_path, rig, {"digital_multiplier": {}}, 4)
    found = diagnose(rig, {"r.csv": record})
    assert [effect.name for effect in found.effects] == ["digital_multiplier"]
