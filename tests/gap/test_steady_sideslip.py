"""A log that starts in a steady sideslip, where the model starts without."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.othercauses import steady_sideslip
from coupled.gap.findings.result import EffectResult
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from coupled.units import GRAVITY_m_per_s2
from tests.support.alone import alone, noisy
from tests.support.gaps import know_only
from tests.support.ownlogs import flown

WORDS = "sideslip may be real"
VANE = [EffectResult("sideslip_zero", "sensing", 0.89, ())]
WIND = {"ic/vw-mag-fps": 30.0, "ic/vw-dir-deg": 60.0}


def banked(roll_rad: float, yaw_rate_rad_per_s: float) -> Record:
    names = ("time_s", "roll_rad", "yaw_rate_rad_per_s", "true_airspeed_m_per_s")
    time = np.arange(600) / 60.0
    levels = (0.0, roll_rad, yaw_rate_rad_per_s, 60.0)
    noise = np.random.default_rng(1).normal(0.0, 3e-4, (600, 4)) * [0.0, 1.0, 1.0, 100.0]
    return Record(names, noise + np.array(levels) + np.outer(time, [1.0, 0.0, 0.0, 0.0]), {})


def test_a_bank_without_a_turn_is_a_sideslip() -> None:
    words = steady_sideslip({"log": banked(-0.12, 0.0)}, VANE)
    assert WORDS in words and "log (-6.9°)" in words
    assert steady_sideslip({"log": banked(-0.12, 0.0)}, []) == ""


@pytest.mark.parametrize("roll_rad", [0.0, 0.12])
def test_level_wings_and_a_coordinated_turn_are_none(roll_rad: float) -> None:
    turn = banked(roll_rad, GRAVITY_m_per_s2 * roll_rad / 60.0)
    assert steady_sideslip({"log": turn}, VANE) == ""


@pytest.mark.slow
@pytest.mark.parametrize(("wind", "verdict"), [(WIND, "ambiguous"), ({}, "effect")])
def test_only_a_vane_beside_level_wings_is_certain(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wind: dict[str, float], verdict: str
) -> None:
    """JSBSim trims in wind with a sideslip, a bank and the rudder over."""
    log = noisy(import_log(flown(tmp_path, {}, 15.0, before=wind)[0])[0])
    if not wind:
        data = log.data.copy()
        data[:, log.channels.index("sideslip_rad")] -= 0.1
        log = Record(log.channels, data, log.manifest)
    know_only(monkeypatch, [BY_NAME["sideslip_zero"]])
    found = diagnose(alone(), {"log": log})
    assert (found.verdict, WORDS in found.summary) == (verdict, verdict == "ambiguous")
    assert [effect.name for effect in found.effects] == ["sideslip_zero"]
    assert (found.effects[0].probability < 0.5) == bool(wind)
