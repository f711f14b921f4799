"""Where the fit of a contact starts: by a search that hollows do not hold."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.search.case import allowing_for_contact, contact_start
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import FAULTY_FROM, MISMATCH
from tests.support import gaps
from tests.support.rigs import bench


@pytest.mark.parametrize("length", [2.3e-5, 1.4e-4, 5e-4])
@pytest.mark.parametrize("share", [0.0, 0.45, 0.95])
def test_a_contact_is_found_between_hollows(length: float, share: float) -> None:
    """Of a bowl with ripples, whose slopes lead from no start of a grid to its least."""

    def left(tried: float, part: float) -> float:
        far, off = math.log(tried / length), part - share
        ripples = 0.02 * (math.sin(80.0 * far) ** 2 + math.sin(60.0 * off) ** 2)
        return 1.0 + far**2 + 2.0 * off**2 + ripples

    found = contact_start(left, 5e-4, 0.95)
    assert found[0] == pytest.approx(length, rel=0.15)
    assert found[1] == pytest.approx(share, abs=0.12)
    assert left(*found) < 1.05


@pytest.mark.parametrize("share", [0.15, 0.45])
def test_a_contact_is_found_along_a_valley(share: float) -> None:
    """A healthy column of 15 N of friction was unexplained: its start stuck across the valley."""

    def left(tried: float, part: float) -> float:
        far, off = math.log(tried / 4.5e-4), part - share
        return 1.0 + 50.0 * (far - 1.2 * off) ** 2 + off**2

    found = contact_start(left, 5e-4, 0.95)
    assert found[0] == pytest.approx(4.5e-4, rel=0.02)
    assert found[1] == pytest.approx(share, abs=0.02)


def test_a_contact_stays_within_its_bounds() -> None:
    assert contact_start(lambda length, share: -length - share, 5e-4, 0.95) == (5e-4, 0.95)
    assert contact_start(lambda length, share: length + share, 5e-4, 0.95) == (5e-7, 0.0)


@pytest.mark.parametrize(
    ("stage", "friction_N", "stiffness_N_per_m", "allowed"),
    [
        ("loader", 12.0, 0.0, True),
        ("loader", 12.0, 1e5, False),
        ("loader", 0.0, 0.0, False),
        ("linkage", 12.0, 0.0, False),
    ],
)
def test_how_filed_friction_yields_is_known_as_well_as_an_effects_physics(
    stage: str, friction_N: float, stiffness_N_per_m: float, allowed: bool
) -> None:
    """Where the file says how far its friction yields, no more than noise may remain."""
    key = "controls.column.loader.friction"
    rig = bench({f"{key}_N": friction_N, f"{key}_stiffness_N_per_m": stiffness_N_per_m})
    gap = Output(stage, "x", np.full(2400, 21.0), lambda rig: np.zeros(2400), 1.0, 120.0)
    found = allowing_for_contact(gap, rig, "column")
    assert found.limit == pytest.approx(1.0 + 20.0 * MISMATCH if allowed else FAULTY_FROM)


@pytest.mark.slow
def test_a_long_record_of_a_rigid_contact_has_no_presliding(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The shortest length that is fitted was significant, by the interval of so many frames."""
    monkeypatch.setattr(gaps, "LONG_s", 240.0)
    nominal = gaps.nominal_rig(False)
    record = gaps.made(tmp_path, nominal, {"coulomb_friction": {"friction_N": 3.0}}, 65)
    (found,) = diagnose(nominal, {"r": record}).effects
    assert found.name == "coulomb_friction"
    assert found.parameters[0].value == pytest.approx(3.0, rel=0.02)
