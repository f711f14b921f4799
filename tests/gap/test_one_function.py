"""One function of the aircraft's model in place of several effects that approximate it."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from tests.support.alone import alone, noisy
from tests.support.gaps import know_only
from tests.support.ownlogs import flown

DRAG = "aero/coefficient/CDo"


def log_of(folder: Path, factors: dict[str, float], length_s: float) -> Record:
    return noisy(import_log(flown(folder, factors, length_s)[0])[0])


@pytest.mark.slow
def test_a_wrong_drag_at_no_lift_is_that_function_alone(tmp_path: Path) -> None:
    """Drag as a whole approximates it, beside a wrong inertia and a yawing moment."""
    found = diagnose(alone(), {"log": log_of(tmp_path, {"/CDo": 1.4}, 30.0)})
    (effect,) = found.effects
    (factor,) = effect.parameters
    assert (found.verdict, effect.of) == ("effect", DRAG)
    assert factor.low is not None and factor.high is not None
    assert factor.low < 1.4 < factor.high < factor.low + 0.1


@pytest.mark.slow
def test_a_function_for_which_the_library_has_no_effect_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    know_only(monkeypatch, [BY_NAME["pitch_damping"]])
    found = diagnose(alone(), {"log": log_of(tmp_path, {"/Clr": 1.5}, 20.0)})
    (effect,) = found.effects
    assert (found.verdict, effect.of) == ("effect", "aero/coefficient/Clr")


@pytest.mark.slow
def test_two_faults_are_not_taken_for_one_function(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    both = {"pitch_damping", "roll_damping"}
    know_only(monkeypatch, [BY_NAME[name] for name in both])
    record = log_of(tmp_path, {"/Cmq": 0.7, "/Clp": 0.7}, 20.0)
    found = diagnose(alone(), {"log": record})
    assert {effect.name for effect in found.effects} == both
