"""A loader that no force of a record moves: what holds it is known only by a lower bound."""

from __future__ import annotations

from pathlib import Path

import pytest

from coupled import load_rig
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.othercauses import held_still
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.gaps import know_only, made, nominal_rig
from tests.support.threecontrols import flown

WORDS = "moves the loader of the column"


def still(folder: Path, rig: Rig) -> Record:
    return made(folder, rig, {"breakout": {"breakout_N": 60.0}}, 3, 30.0)


def test_a_still_loader_is_named_with_its_largest_force(tmp_path: Path) -> None:
    rig = nominal_rig(False)
    record = still(tmp_path, rig)
    most = float(abs(record["column_force_N"]).max())
    assert held_still(rig, "column", [record]).startswith(f"No force up to {most:.3g} N {WORDS}")


def test_a_loader_that_one_record_moves_is_not_still(tmp_path: Path) -> None:
    rig = nominal_rig(False)
    moved = made(tmp_path, rig, {"breakout": {"breakout_N": 6.0}}, 3, 30.0)
    assert held_still(rig, "column", [still(tmp_path, rig), moved]) == ""


@pytest.mark.slow
@pytest.mark.parametrize("law", ["load_friction", "breakout"])
def test_no_law_that_holds_a_still_loader_is_certain(
    monkeypatch: pytest.MonkeyPatch, law: str
) -> None:
    """Coulomb friction above all forces: each law of friction that holds the loader fits alike."""
    rig = load_rig("c172p")
    friction = {"controls.column.loader.friction_N": 50.0}
    record = flown(rig, friction, 20.0, column=15.0, wheel=0.0, pedals=0.0)
    know_only(monkeypatch, [BY_NAME[law]])
    found = diagnose(rig, {"r": record}, "column")
    assert found.verdict != "effect"
    assert all(effect.probability < 0.5 for effect in found.effects)
    assert WORDS in found.summary and not found.next_tests
