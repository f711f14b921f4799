"""Authority maps: the closed form on the grid, and stick forces against flown ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from coupled.authority.maps import FELT, envelope, feel, loss_maps
from coupled.cli import app
from coupled.record.csvfile import read_columns
from coupled.resources import find, shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.commands import coupled
from tests.support.rigs import G_STIFF, K_REPORT, bench


def test_the_map_is_the_closed_form_of_each_configuration() -> None:
    maps = {one.configuration: one for one in loss_maps(bench(), "column")}
    gradient = np.interp(maps["compensated"].pressure_Pa, [0.0, 3000.0], [560.0, G_STIFF])
    lost = K_REPORT * gradient[:, None]
    expected = {
        "uncompensated": lost / (1.0 + lost),
        "gradient only": lost,
        "deflection only": 0.0 * lost,
        "compensated": 0.0 * lost,
    }
    for name, found in maps.items():
        # Far out the stop at δc = travel holds the loader, before the grip is at its travel.
        inside = found.deflection < 0.75 * 0.1778
        shares = np.broadcast_to(expected[name], found.loss.shape)
        assert found.loss[:, inside] == pytest.approx(shares[:, inside], abs=2e-5)


@pytest.mark.parametrize("rig", ["report-column", "737"])
def test_stick_force_is_as_specified_with_and_without_compensation(rig: str) -> None:
    """δ̂ = δc = F/G_T without it, δ̂ = δ = F/G_T with it, past the breakout."""
    file = find(rig, shipped_rigs(), "rig")
    found = feel(read_rig(file), file, lambda *_: None)
    assert found is not None
    assert len(found.pressure_Pa) >= 4
    for name in FELT:
        assert found.per_g_N[name] == pytest.approx(found.per_g_N["rigid"], rel=1e-3)
        assert np.all(found.per_g_N[name] > 10.0)
        # Stable in speed. The 737's knot is less than the bend moves within the breakout.
        rests = rig == "737" and name == "compensated"
        assert np.all(np.isnan(found.per_knot_N[name]) if rests else found.per_knot_N[name] > 0.0)


def test_a_bench_has_no_stick_force_per_g(tmp_path: Path) -> None:
    assert feel(bench(), tmp_path, lambda *_: None) is None
    assert envelope([], "column").shape == (2, 0)


@pytest.mark.slow
def test_the_command_writes_figures_and_tables(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    ran = CliRunner().invoke(app, ["map", "bench", "--output", "map.pdf"])
    assert ran.exit_code == 0, ran.output
    assert {path.name for path in tmp_path.iterdir()} == {"map.pdf", "map.csv"}
    assert "loss" in (tmp_path / "map.csv").read_text().splitlines()[0]
    ran = CliRunner().invoke(app, ["map", "t37", "--output", "t37.png"])
    assert ran.exit_code == 0, ran.output
    assert np.all(read_columns(tmp_path / "t37-feel.csv")["specified_force_per_g_N"] > 0.0)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["nonsense"], "nonsense: is no shipped rig"),
        (["bench", "--record", "alien.csv"], "alien.csv: dynamic_pressure_Pa: no such column"),
    ],
)
def test_a_map_of_nothing_is_one_line_and_writes_nothing(
    tmp_path: Path, words: list[str], says: str
) -> None:
    (tmp_path / "alien.csv").write_text("time_s,column_force_N\n0.0,1.0\n0.1,1.0\n")
    done = coupled(tmp_path, "map", *words, columns=200)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert [path.name for path in tmp_path.rglob("*")] == ["alien.csv"]
