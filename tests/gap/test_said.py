"""What a diagnosis says in words: a list of sentences, one share, and why a rig has a key."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import cast

from coupled.cli.gaps import _write_improved, in_words
from coupled.gap.findings.budget import Share, StageBudget, share_of
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.result import ParameterEstimate
from coupled.rig.rigwrite import rig_text
from tests.support.rigs import bench

SUMMARY = "Play of 1 mm explains 60 % of the gap. Friction explains 30 %. Set q̄ first."


def said(effects: int) -> str:
    effect = SimpleNamespace(parameters=())
    whole = SimpleNamespace(summary=SUMMARY, effects=(effect,) * effects)
    return in_words(cast("Diagnosis", whole), "si")


def test_two_effects_make_a_list_and_one_a_paragraph() -> None:
    assert said(1) == SUMMARY
    lines = said(2).splitlines()
    assert lines == [
        "- Play of 1 mm explains 60 % of the gap.",
        "- Friction explains 30 %.",
        "- Set q̄ first.",
    ]


def test_a_share_is_one_number_wherever_it_is_written() -> None:
    noise, rest = Share("noise", 0.2, 0.1, 0.3), Share("unexplained", 0.1, 0.0, 0.2)
    budget = StageBudget("loader", (Share("play", 0.7, 0.6, 0.8),), rest, noise)
    assert share_of((budget,), "loader", "play") == "70.0 %"
    assert share_of((budget,), "loader", "friction") == ""
    assert share_of((budget,), "linkage", "play") == ""


def test_a_key_that_is_no_effect_is_explained(tmp_path: Path) -> None:
    """A servo found on a rig without one: its damping ratio is written, and is no effect."""
    loader = "controls.column.loader"
    old = bench({"servo_frequency_Hz": 0.0})
    new = old.changed({f"{loader}.servo_frequency_Hz": 9.0, f"{loader}.servo_damping_ratio": 0.7})
    found = ParameterEstimate(
        "frequency_Hz", 9.0, 8.9, 9.1, key="loader.servo_frequency_Hz", unit="Hz", found=9.0
    )
    whole = SimpleNamespace(
        summary="A servo.",
        effects=(SimpleNamespace(parameters=(found,), key_of=lambda p: p.key),),
        settings=(),
        nominal=old,
        improved=new,
    )
    filed, target = tmp_path / "old.toml", tmp_path / "new.toml"
    filed.write_text(rig_text(old), encoding="utf-8")
    _write_improved(target, cast("Diagnosis", whole), filed, {}, with_curves=False)
    head = [line for line in target.read_text(encoding="utf-8").splitlines() if line[:1] == "#"]
    assert (
        "# written beside these: controls.column.loader.servo_damping_ratio, since a file gives"
        " both numbers of a servo or none" in head
    )
    assert not any("written beside" in line and "servo_frequency" in line for line in head)
