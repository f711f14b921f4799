"""Gains of channels as nuisances: a log may be off by as much as its rig file says."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.effects.settings import settings
from tests.support.gaps import made, nominal_rig

LOOSE = {"sensing.force_scale": 0.01, "sensing.deflection_scale": 0.01}
CLOSE = nominal_rig(False)
RIG = CLOSE.changed({"controls.column.tolerance": LOOSE})


def test_a_gain_that_the_file_says_is_fitted_wherever_it_shows() -> None:
    """Fitted to the loader alone, where two scales are one, it opened the linkage."""
    known = settings(RIG, "column")
    for name in ("force_scale", "deflection_scale"):
        assert name not in settings(CLOSE, "column")
        assert known[name].shows_in == BY_NAME[name].shows_in
        assert (known[name].free[0].low, known[name].free[0].high) == (0.99, 1.01)
    assert known["inertia"].shows_in == ("loader",)
    assert known["force_skew"].shows_in == ("loader",)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        pytest.param("force_scale", 1.006, marks=pytest.mark.slow),
        ("deflection_scale", 0.995),
    ],
)
def test_a_gain_within_its_tolerance_is_no_gap_and_is_said(
    tmp_path: Path, name: str, factor: float
) -> None:
    record = made(tmp_path, CLOSE, {name: {"factor": factor}}, 5)
    found = diagnose(RIG, {"r": record})
    assert found.verdict == "no_gap", found.summary
    said = {setting.name: setting.factor for setting in found.settings}
    assert said[name] == pytest.approx(factor, abs=4e-4)
    assert [effect.name for effect in diagnose(CLOSE, {"r": record}).effects] == [name]


@pytest.mark.slow
def test_an_effect_is_found_beside_a_gain_that_is_off(tmp_path: Path) -> None:
    real = {"coulomb_friction": {"friction_N": 3.0}, "force_scale": {"factor": 1.006}}
    found = diagnose(RIG, {"r": made(tmp_path, CLOSE, real, 6)})
    assert found.verdict == "effect", found.summary
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    assert found.effects[0].value == pytest.approx(3.0, rel=0.02)
