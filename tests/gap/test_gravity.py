"""Gravity on a joint is named and measured; in a small motion it is a spring, and not tried."""

from __future__ import annotations

import pytest

from coupled.errors import InputError
from coupled.gap.chain import Part
from coupled.gap.diagnose import diagnose
from coupled.gap.prepare import prepare
from coupled.plots.gapview import View
from coupled.plots.signatures import draw_signature
from tests.support.pendulum import WEIGHT_N, ANGLE_rad, moved, moved_rig


@pytest.mark.slow
@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_a_weight_on_a_joint_is_named_and_measured(size: float) -> None:
    found = diagnose(moved_rig(size), {"r": moved(seconds=12.0, size=size)}, "wheel")
    assert (found.verdict, [effect.name for effect in found.effects]) == ("effect", ["gravity"])
    weight, angle = found.effects[0].parameters
    assert weight.found == pytest.approx(size * WEIGHT_N, rel=0.01)
    assert angle.found == pytest.approx(ANGLE_rad, abs=0.01)


@pytest.mark.slow
def test_a_weight_and_dry_friction_are_named_together() -> None:
    found = diagnose(moved_rig(), {"r": moved(seconds=12.0, friction_N=2.0)}, "wheel")
    by_name = {effect.name: effect for effect in found.effects}
    assert set(by_name) == {"gravity", "coulomb_friction"}
    assert by_name["gravity"].value == pytest.approx(WEIGHT_N, rel=0.02)
    assert by_name["coulomb_friction"].value == pytest.approx(2.0, rel=0.05)


@pytest.mark.parametrize(("most_rad", "tried"), [(0.2, False), (1.5, True)])
def test_a_weight_is_tried_only_where_it_is_no_spring_with_an_offset(
    most_rad: float, tried: bool
) -> None:
    """To 0.2 rad sin differs from a line by less than the model error of a right effect."""
    known = prepare(
        moved_rig(), {"r": moved(seconds=6.0, most_rad=most_rad)}, Part("wheel")
    ).library
    assert ("gravity" in {effect.name for effect in known}) is tried


@pytest.mark.slow
def test_a_record_of_three_seconds_is_judged_where_it_swings() -> None:
    found = diagnose(moved_rig(), {"r": moved(seconds=3.0, pace=2.0)}, "wheel")
    assert found.effects[0].name == "gravity"
    assert found.effects[0].value == pytest.approx(WEIGHT_N, rel=0.05)  # a mass known to 2 %
    (part,) = found.parts
    assert "gravity" in draw_signature(View(part)).subfigs[0].get_suptitle()


def test_a_short_record_without_swings_is_refused() -> None:
    with pytest.raises(InputError, match=r"3\.0 s long with 2 swings in 300 rows; 5 s are needed"):
        diagnose(moved_rig(), {"r": moved(seconds=3.0)}, "wheel")
