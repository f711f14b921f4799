"""Effects far from where their fits start: a large one is no less clear than a small one."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from tests.support.gaps import made, nominal_rig

LARGE = {
    "coulomb_friction": {"friction_N": 30.0},
    "viscous_damping": {"factor": 4.0},
    "modifying_lag": {"lag_s": 1.0},
    "bend_hysteresis": {"bend_{d}_per_N": 2e-4, "share": 0.8, "width_N": 40.0},
    "mains_hum": {"amplitude_{d}": 2e-4, "frequency_Hz": 7.0, "phase_rad": 0.4},
    "surface_lag": {"lag_s": 1.5},
}
FLOWN = ("surface_lag",)


@pytest.mark.slow
@pytest.mark.parametrize("name", LARGE)
def test_a_large_effect_is_named_with_its_size(name: str, tmp_path: Path) -> None:
    rig, true = nominal_rig(name in FLOWN), LARGE[name]
    record = made(tmp_path, rig, {name: true}, 31)
    (found,) = diagnose(rig, {"flown": record}, "column").effects
    assert (found.name, found.probability > 0.8) == (name, True)
    for one, (key, value) in zip(found.parameters, true.items(), strict=True):
        assert one.value == pytest.approx(value, rel=0.03), key


@pytest.mark.slow
@pytest.mark.parametrize(
    ("filed", "bend", "limit"), [(0.0, 5e-6, 5e-4), (6e-5, 6e-5, 3e-3), (0.0, 2e-4, 6e-3)]
)
def test_a_bend_stiffens_at_any_scale(
    tmp_path: Path, filed: float, bend: float, limit: float
) -> None:
    """At 0.15 mm it was a soft backlash; a filed bend with a limit had no effect beside 2.9."""
    keys = ("loader.bend_m_per_N", "compensation.bend_m_per_N")
    rig = nominal_rig(False).changed({f"controls.column.{key}": filed for key in keys})
    true = {"bend_{d}_per_N": bend, "limit_{d}": limit}
    record = made(tmp_path, rig, {"stiffening_bend": true}, 31, noisier=0.2)
    (found,) = diagnose(rig, {"r": record}, "column").effects
    assert (found.name, found.probability > 0.8) == ("stiffening_bend", True)
    for one, value in zip(found.parameters, true.values(), strict=True):
        assert one.value == pytest.approx(value, rel=0.05)


@pytest.mark.slow
def test_values_that_the_record_does_not_separate_are_no_doubt_of_the_law(tmp_path: Path) -> None:
    """Each interval of the servo's values contains the neutral value, but not all together."""
    rig, true = nominal_rig(False), {"delay_s": 0.0, "factor": 1.3, "damping_factor": 2.0}
    record = made(tmp_path, rig, {"servo_tuning": true}, 31)
    found = diagnose(rig, {"flown": record}, "column")
    assert [effect.name for effect in found.effects] == ["servo_tuning"]
    assert found.verdict == "effect"
    for one, value in zip(found.effects[0].parameters, true.values(), strict=True):
        assert one.low is not None and one.high is not None
        assert one.low <= value <= one.high
