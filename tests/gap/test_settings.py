"""What a rig may be set to, or have, without that being an effect."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.settings import YIELDING, settings
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import bench

LOADER = "controls.column.loader."


def test_a_tolerance_of_the_file_is_that_of_the_setting() -> None:
    rig = bench({"friction_N": 2.0, "friction_stiffness_N_per_m": 1e5})
    known = settings(rig, "column")
    [mass] = known["inertia"].free
    assert (mass.low, mass.high) == pytest.approx((0.98, 1.02))
    assert "coulomb_friction" not in known
    given = {"loader.mass_kg": 0.4, "loader.friction_N": 3.0}
    known = settings(rig.changed({"controls.column.tolerance": given}), "column")
    [mass], [friction] = known["inertia"].free, known["coulomb_friction"].free
    assert (mass.low, mass.high) == pytest.approx((0.9, 1.1))  # 0.4 of 4 kg
    assert (friction.low, friction.high) == (-2.0, 3.0)  # no more than what is filed comes off


def test_the_contact_of_a_filed_friction_is_a_setting_where_the_file_does_not_say_it() -> None:
    [contact] = settings(bench({"friction_N": 2.0}), "column")[YIELDING].free
    assert contact.low == pytest.approx(2.0 / 5e-4)  # half a millimetre
    for said in ({}, {"friction_N": 2.0, "friction_stiffness_N_per_m": 1e5}):
        assert YIELDING not in settings(bench(said), "column")


def test_a_filed_friction_that_yields_before_it_slips_is_no_gap(tmp_path: Path) -> None:
    rough = nominal_rig(False).changed({LOADER + "friction_N": 1.5})
    real = rough.changed({LOADER + "friction_stiffness_N_per_m": 1e4})
    record = made(tmp_path, real, {}, 4).between(0.0, 15.0)
    found = diagnose(rough, {"r": record})
    assert found.verdict == "no_gap"
    loader = found.stage("loader")
    assert loader.gap is not None and loader.gap > 2.0  # as filed, it slips at once
    yields = found.improved.controls["column"].loader.friction_stiffness
    assert yields == pytest.approx(1e4, rel=0.1)
