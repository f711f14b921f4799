"""What a rig may be set to, or have, without that being an effect."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.effects.settings import contact, settings
from coupled.gap.findings.result import SettingResult
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


def test_a_tolerance_of_a_value_that_no_effect_has_alone_is_used() -> None:
    servo = {"servo_frequency_Hz": 18.0, "servo_damping_ratio": 0.6}
    given = {"controls.column.tolerance": {"loader.servo_damping_ratio": 0.3}}
    [ratio] = settings(bench(servo).changed(given), "column")["loader.servo_damping_ratio"].free
    assert (ratio.low, ratio.high) == pytest.approx((0.5, 1.5))
    assert "loader.servo_damping_ratio" not in settings(bench(servo), "column")


def test_a_tolerance_of_a_filed_contact_is_used() -> None:
    key = "loader.friction_stiffness_N_per_m"
    given = {"controls.column.tolerance": {key: 2e4}}
    filed = bench({"friction_N": 2.0, "friction_stiffness_N_per_m": 1e5}).changed(given)
    names = {p.key for one in settings(filed, "column").values() for p in one.free}
    assert "loader.friction_stiffness_N_per_{d}" in names
    # A contact that is not filed is a nuisance parameter already.
    open_ = bench({"friction_N": 2.0}).changed(given)
    names = {p.key for one in settings(open_, "column").values() for p in one.free}
    assert "loader.friction_stiffness_N_per_{d}" not in names


@pytest.mark.slow
@pytest.mark.parametrize(("half", "within"), [(0.2, True), (0.02, False)])
def test_a_servos_damping_within_its_tolerance_is_no_gap(
    tmp_path: Path, half: float, within: bool
) -> None:
    key = "loader.servo_damping_ratio"
    rough = nominal_rig(False).changed({LOADER + "servo_frequency_Hz": 8.0})
    rig = rough.changed({f"controls.column.{key}": 0.6, "controls.column.tolerance": {key: half}})
    record = made(tmp_path, rough.changed({f"controls.column.{key}": 0.7}), {}, 4)
    found = diagnose(rig, {"r": record.between(0.0, 15.0)})
    assert (found.verdict == "no_gap") == within
    if within:
        [ratio] = [one for one in found.settings if one.name == "servo_damping_ratio"]
        assert ratio.factor == pytest.approx(0.7 / 0.6, rel=0.05)


def test_how_far_friction_yields_is_a_setting_where_the_file_does_not_say_it() -> None:
    for friction in ({"friction_N": 2.0}, {}):  # filed, or found
        length, share = (one.free[0] for one in contact(bench(friction), "column"))
        assert length.high == pytest.approx(5e-4)  # half a millimetre
        assert share.starts == (0.3,)
    said = {"friction_N": 2.0, "friction_stiffness_N_per_m": 1e5}
    assert contact(bench(said), "column") == ()


def test_the_length_over_which_friction_yields_sets_its_contact() -> None:
    rig = bench({"friction_N": 2.0})
    length, _ = contact(rig, "column")
    more = BY_NAME["coulomb_friction"]
    for effects, values, stiffness in (
        ((length,), {}, 2.0 / 1e-4),
        ((more, length), {"coulomb_friction.friction_N": 1.0}, 3.0 / 1e-4),
    ):
        found = apply(rig, "column", effects, values | {length.value_key(length.free[0]): 1e-4})
        assert found.controls["column"].loader.friction_stiffness == pytest.approx(stiffness)


@pytest.mark.slow
def test_a_filed_friction_that_yields_before_it_slips_is_no_gap(tmp_path: Path) -> None:
    rough = nominal_rig(False).changed({LOADER + "friction_N": 1.5})
    real = rough.changed({LOADER + "friction_stiffness_N_per_m": 1e4})
    record = made(tmp_path, real, {}, 4).between(0.0, 15.0)
    found = diagnose(rough, {"r": record})
    assert found.verdict == "no_gap"
    loader = found.stage("loader")
    assert loader.gap is not None and loader.gap > 2.0  # as filed, it slips at once
    yields = found.improved.controls["column"].loader.friction_stiffness
    assert yields == pytest.approx(1e4, rel=0.15)  # its share walks with it
    length_m = found.as_dict()["friction_yields_m"]
    assert length_m == pytest.approx(1.5 / yields)
    assert f"friction that yields by {1e3 * length_m:.2g} mm before it slips" in found.summary


@pytest.mark.parametrize(
    ("result", "moved", "words"),
    [
        (SettingResult("damping", "loader", 1.0149), True, "damping +1.5 %"),
        (SettingResult("servo_frequency", "linkage", 0.9996), False, "servo frequency -0.0 %"),
        (
            SettingResult("friction_yields_rad", "loader", yields=2.34e-3),
            True,
            "friction that yields by 2.3 mrad before it slips",
        ),
        (
            SettingResult("motion_stamp_s", "airframe", late_s=-4.37e-3),
            True,
            "motion that is stamped 4.4 ms early",
        ),
        (
            SettingResult("force_stamp_s", "loader", late_s=2e-5),
            False,
            "force that is stamped 0.02 ms late",
        ),
    ],
)
def test_a_setting_says_what_it_was_found_to_be(
    result: SettingResult, moved: bool, words: str
) -> None:
    assert (result.moved, result.words) == (moved, words)
