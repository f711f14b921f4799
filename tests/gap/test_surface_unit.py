"""A surface whose position is in another unit than rad acts like another effectiveness."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.findings.othercauses import in_other_unit
from coupled.gap.findings.result import EffectResult, ParameterEstimate
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.ownlogs import flown


def alone() -> Rig:
    return read_rig(shipped_rigs()["c172p"]).changed({"controls": {}, "noise": {}})


@pytest.mark.parametrize(
    ("surface", "factor", "unit"),
    [
        ("rudder", 0.28, "shares of its travel (0.279 rad)"),  # of ±16°
        ("aileron", 0.30, "shares of its travel (0.262 to 0.349 rad)"),  # of 15° and 20°
        ("elevator", 0.44, "shares of its travel (0.401 to 0.489 rad)"),  # of 23° and 28°
        ("rudder", 0.0028, "per cent of its travel (0.279 rad)"),
        ("aileron", 0.0175, "degrees"),
        ("elevator", 0.6, ""),
        ("rudder", 1.4, ""),
    ],
)
def test_a_factor_of_the_size_of_another_unit_is_doubted(
    surface: str, factor: float, unit: str
) -> None:
    number = ParameterEstimate("factor", factor, 0.97 * factor, 1.03 * factor)
    found = in_other_unit(alone(), [EffectResult(f"{surface}_effectiveness", "", 0.9, (number,))])
    assert len(found) == bool(unit)
    for one in found:
        assert one.effects == {f"{surface}_effectiveness", f"{surface}_zero"}
        assert one.words.startswith(f"{surface}_rad may be in {unit} instead")


def test_an_effectiveness_that_may_be_none_shows_no_unit() -> None:
    """A log that starts in a manoeuvre had one of 0.01, -0.004 to 0.03: a surface in per cent."""
    number = ParameterEstimate("factor", 0.014, -0.004, 0.033)
    assert not in_other_unit(alone(), [EffectResult("elevator_effectiveness", "", 0.1, (number,))])


@pytest.mark.slow
def test_an_aileron_in_shares_of_its_travel_is_no_certain_effectiveness(tmp_path: Path) -> None:
    """It was an effectiveness of 0.30 with a probability of 0.89."""
    log, _ = import_log(flown(tmp_path, {}, 12.0)[0])
    data = log.data.copy()
    data[:, log.channels.index("aileron_rad")] /= 0.3
    found = diagnose(alone(), {"log": Record(log.channels, data)})
    (effect,) = found.effects
    assert effect.name == "aileron_effectiveness"
    assert effect.probability < 0.6
    assert found.verdict == "ambiguous"
    assert "aileron_rad may be in shares of its travel" in found.summary
