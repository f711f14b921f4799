"""The examples run as they are, and what they show is so."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from coupled.rig.rig import Rig

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_every_example_is_run_here() -> None:
    shown = {"authority_lost", "calibrating_a_loader", "diagnosing_a_record"}
    assert {path.stem for path in EXAMPLES.glob("*.py")} == shown
    for path in EXAMPLES.glob("*.py"):
        assert path.read_text(encoding="utf-8").startswith("# %% [markdown]\n# # "), path


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.stem)
def test_help_says_what_an_example_does(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.argv", [path.name, "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(path))
    assert ended.value.code == 0
    said = capsys.readouterr().out
    assert f"usage: {path.name}" in said and len(said.split()) > 15


def test_the_example_authority_lost_prints_the_closed_form(
    capsys: pytest.CaptureFixture[str],
) -> None:
    shown = runpy.run_path(str(EXAMPLES / "authority_lost.py"))
    table = shown["table"]
    assert table.loss("uncompensated") == pytest.approx(shown["bent"].loss_closed_form, abs=0.02)
    assert table.loss("uncompensated") > 0.2
    assert abs(table.loss("compensated")) < 0.001
    assert shown["share"] < 0.9
    printed = capsys.readouterr().out
    assert f"{100 * table.loss('uncompensated'):.1f} % authority lost" in printed
    assert "-0.0 %" not in printed
    assert len(shown["figure"].axes) == 4


def test_the_example_calibration_finds_the_rig_s_scales(capsys: pytest.CaptureFixture[str]) -> None:
    shown = runpy.run_path(str(EXAMPLES / "calibrating_a_loader.py"))
    assert shown["bend"].holds(shown["true"])
    before, after = (shown[name].outcome.loss for name in ("before", "after"))
    assert "-0.0 %" not in capsys.readouterr().out
    # S1 of the electronics is 4 % low, in what the host reads and in the analog product, and the
    # host knows of no K: the loader holds G_B + 0.96·(G_T − G_B). Then what the readings' errors
    # leave.
    held = 560.4 + 0.96 * (2189.1 - 560.4)
    lost = 1.0 - 0.96 / (1.0 + shown["true"] * held)
    assert before == pytest.approx(lost, abs=0.001)
    assert abs(after) < 0.015


def test_the_example_diagnosis_finds_the_effects() -> None:
    shown = runpy.run_path(str(EXAMPLES / "diagnosing_a_record.py"))
    found = shown["found"]
    assert found.verdict == "effect"
    [effect] = found.effects
    assert effect.name == "viscous_damping"
    improved: Rig = found.improved
    assert improved.controls["column"].loader.damping == pytest.approx(110.0, rel=0.01)
    assert shown["off"] < 1e-4
