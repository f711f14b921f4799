"""Authority maps: the closed form on the grid, and stick forces against flown ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from coupled.authority.maps import FELT, Feel, envelope, feel, loss_maps
from coupled.cli import app
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, configure
from coupled.flight.pilot import Step
from coupled.plots.maps import draw_losses
from coupled.record.csvfile import read_columns
from coupled.resources import find, shipped_rigs
from coupled.rig.equations import specified_gradient
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.commands import coupled
from tests.support.readings import report_rig
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


def test_the_figure_explains_its_grey() -> None:
    """With no number at all, too: numpy's warnings are errors in these tests."""
    place = "controls.column.loader."

    def said(changes: dict[str, float]) -> list[str]:
        rig = bench({place + key: value for key, value in changes.items()})
        drawn = draw_losses("r", {"column": loss_maps(rig, "column")}, {"column": np.empty((2, 0))})
        title = drawn.get_suptitle().removeprefix("r: deflection lost on the way to the surface")
        return title.replace("\n(", " (").split("\n")

    nothing = "Nothing is lost on column, deflection only and compensated."
    rests = "The loader rests within its breakout on column"
    assert said({}) == ["", nothing]
    assert said({"breakout_N": 9.0}) == [" (grey: within the breakout)", nothing]
    assert " ".join(said({"breakout_N": 3e4})).strip().startswith(f"{rests}, uncompensated")
    rigid_stop = {"bend_m_per_N": 0.0, "stop_aft_m": 0.03}
    nothing = "Nothing is lost on column, uncompensated and gradient only."
    assert said(rigid_stop) == [" (grey: beyond where the grip can go)", nothing]


def felt(rig: Rig) -> Feel:
    found = feel(rig, Path("rig.toml"), lambda *_: None)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def plain() -> Feel:
    """Return the stick forces of the report's column, without bob weight and breakout."""
    return felt(report_rig())


def test_a_bob_weight_adds_itself_less_what_the_host_makes_of_its_bend(plain: Feel) -> None:
    """F = G·δ̂ + b·(1 − K̂·G) where δ̂ = δc + K̂·F; G·δ̂ + b where the host adds nothing.

    Forces are past the breakout, so that a breakout changes none.
    """
    weight_N, loader = 40.0, "controls.column.loader"
    changes = {f"{loader}.bob_weight_N_per_g": weight_N, f"{loader}.breakout_N": 6.0}
    rig = report_rig()
    found = felt(rig.changed(changes))
    column = rig.controls["column"]
    gradient = specified_gradient(column.schedule, plain.pressure_Pa)
    spared = {"compensated": column.compensation.bend * gradient}
    for name in FELT:
        wanted = weight_N * (1.0 - spared.get(name, 0.0 * gradient))
        assert found.per_g_N[name] - plain.per_g_N[name] == pytest.approx(wanted, rel=1e-4)
        assert found.per_knot_N[name] == pytest.approx(plain.per_knot_N[name], rel=1e-4)


def test_a_force_per_g_is_what_a_flown_pull_takes(plain: Feel) -> None:
    """A pull and a push of 3 N on the rigid column: half their difference at its greatest."""
    force_N, at = 3.0, len(plain.pressure_Pa) // 2
    speed = {"flight.calibrated_airspeed_m_per_s": float(plain.calibrated_airspeed_m_per_s[at])}
    rig = configure(report_rig(), "rigid").changed(speed)
    pull, push = (
        fly(Manoeuvre(rig, {"column": Step(force_N=side * force_N, start_s=0.5)}, 3.5))
        for side in (1.0, -1.0)
    )
    load = 0.5 * (pull["load_factor"] - push["load_factor"])
    assert plain.per_g_N["rigid"][at] == pytest.approx(force_N / np.max(load), rel=0.02)


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
def test_an_impossible_map_is_refused_in_one_line_and_writes_nothing(
    tmp_path: Path, words: list[str], says: str
) -> None:
    (tmp_path / "alien.csv").write_text("time_s,column_force_N\n0.0,1.0\n0.1,1.0\n")
    done = coupled(tmp_path, "map", *words, columns=200)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert [path.name for path in tmp_path.rglob("*")] == ["alien.csv"]
