"""The command that maps stability, its planes and its refusals."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

from coupled.authority.stability import planes
from coupled.authority.stability.linear import (
    growth,
)
from coupled.authority.stability.planes import (
    PlaneAtGradient,
    plane,
)
from coupled.cli import app
from coupled.errors import InputError
from coupled.rig.rigwrite import rig_text
from tests.support.commands import files
from tests.support.rigs import K_REPORT, bench


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planes, "CELLS", (7, 9))
    monkeypatch.setattr(planes, "POINTS", (15, 13))


def test_a_plane_holds_cells_and_limits(coarse: None) -> None:
    found = plane(bench(), "column", "frame")
    assert found.simulated.shape == found.theory.shape == (7, 9)
    assert found.fine.shape == (15, 13)
    assert np.array_equal(found.simulated > 0.0, found.theory > 0.0)
    assert found.crossings
    for crossing in found.crossings:
        assert crossing.difference is not None
        assert crossing.difference < 0.01
        along = PlaneAtGradient(bench(), "column", "frame", crossing.share / K_REPORT)
        rig, hand = along.linear_with(crossing.simulated)
        assert growth(rig, hand) == pytest.approx(0.0, abs=0.1)


@pytest.mark.slow
def test_the_command_writes_figure_table_and_json(
    coarse: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["stability", "737", "--control", "wheel", "-o", "w.png", "--json", "w.json"]
    ran = CliRunner().invoke(app, words)
    assert ran.exit_code == 0, ran.output
    assert files(tmp_path) == {"w.png", "w.csv", "w.json"}
    cells = pl.read_csv(tmp_path / "w.csv")
    assert len(cells) == 6 * 7 * 9
    assert set(cells["gradient_unit"]) == {"N/rad"}
    found = json.loads((tmp_path / "w.json").read_text())
    assert [each["control"] for each in found["controls"]] == ["wheel"]
    assert found["greatest_difference_percent"] < 1.0
    assert "limits on the map" in ran.output


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["stiff.toml"], "stiff.toml: controls.column.loader.bend_m_per_N: is 0 and nothing bends"),
        (["737", "--control", "whel"], "--control: no 'whel'; did you mean wheel?"),
        (["737", "-o", "x.gif"], "x.gif: a figure ends in .png, .pdf, .svg"),
        (["7377"], "7377: is no shipped rig"),
    ],
)
def test_what_cannot_be_mapped_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stiff.toml").write_text(rig_text(bench({"bend_m_per_N": 0.0}), "a rigid rig"))
    ran = CliRunner().invoke(app, ["stability", *words])
    assert isinstance(ran.exception, InputError)  # which the command line makes one line, code 2
    assert says in str(ran.exception)
    assert "\n" not in str(ran.exception)
    assert files(tmp_path) == {"stiff.toml"}
