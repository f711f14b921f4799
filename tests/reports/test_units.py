"""--units us in figures, reports and written forms, and one unit for a sweep's table and figure."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from coupled.authority.figures import kept_figure
from coupled.calibration.documentation import document
from coupled.calibration.qualification import Issue, feel_tests
from coupled.calibration.readingsfile import read_readings
from coupled.campaign.check import CheckResult
from coupled.campaign.verdict import Verdict
from coupled.cli.tables import print_table
from coupled.cli.terminal import SafeConsole
from coupled.display import System, in_system
from coupled.plots.campaign import draw_sweep
from coupled.plots.checks import draw_static_checks
from coupled.plots.documentation import draw_forces
from coupled.reports.check import check_report
from coupled.reports.forces import force_summary
from coupled.reports.page import render
from coupled.reports.provenance import provenance_of
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.tables.campaign import spread_table
from coupled.units import POUND_N
from tests.support.commands import coupled
from tests.support.runs import SHORT

GRADIENT = "specified gradient G_T there"
SYSTEMS: tuple[System, System] = ("si", "us")


def text_of(file: Path) -> str:
    """Return the words of an HTML file."""
    return " ".join(re.sub(r"<[^>]*>", " ", file.read_text(encoding="utf-8")).split())


def test_a_comparison_in_us_units_has_them_in_report_and_figure(tmp_path: Path) -> None:
    (tmp_path / "short.toml").write_text(SHORT)
    words = ("compare", "./short.toml", "--units", "us", "--report", "r.html", "--figure", "f.svg")
    assert coupled(tmp_path, *words).returncode == 0
    said = text_of(tmp_path / "r.html")
    assert "force needed, lb" in said
    assert "force needed, N" not in said
    drawn = (tmp_path / "f.svg").read_text(encoding="utf-8")  # an axis's text is a comment there
    assert "<!-- pilot's force, lb -->" in drawn
    assert "of the column, in -->" in drawn


def test_a_plans_form_in_us_units_is_read_as_such(tmp_path: Path) -> None:
    for system in ("si", "us"):
        words = ("calibrate", "--plan", "--write", f"{system}.csv", "--units", system)
        assert coupled(tmp_path, *words).returncode == 0
    rows = {
        system: list(csv.DictReader((tmp_path / f"{system}.csv").read_text("utf-8").splitlines()))
        for system in ("si", "us")
    }
    assert {"deflection_in", "force_lb", "force_after_lb"} <= set(rows["us"][0])
    held = {
        system: [float(row["remark"].split()[2]) for row in each] for system, each in rows.items()
    }
    assert held["si"] == [pytest.approx(0.0254 * x, rel=1e-3) for x in held["us"]]
    assert "lb/ft² given to the host" in rows["us"][0]["remark"]


def test_a_calibration_in_us_units_has_them_in_report_and_figure(tmp_path: Path) -> None:
    assert coupled(tmp_path, "bench", "-o", "b.csv").returncode == 0
    assert len(read_readings(tmp_path / "b.csv", "column").row) == 25
    words = ("calibrate", "b.csv", "--units", "us", "--report", "r.html", "--figure", "f.svg")
    assert coupled(tmp_path, *words).returncode == 0
    said = text_of(tmp_path / "r.html")
    assert "S1 = " in said
    assert "V/in" in said
    assert "δ, in F, lb" in said
    assert "<!-- deflection δ, in -->" in (tmp_path / "f.svg").read_text(encoding="utf-8")


TABLE = pl.DataFrame(
    {
        "flight": [0, 1],
        "k": [1.0, 2.0],
        "configuration": ["uncompensated"] * 2,
        "peak_rate_rad_per_s": [0.1, 0.2],
        "force_N": [10.0, 20.0],
        "felt_ratio": [0.9, 0.8],
        "ended_early": ["", ""],
    }
)


@pytest.mark.parametrize("system", ["si", "us"])
def test_a_sweeps_table_and_figure_have_the_same_units(
    system: System, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ["peak_rate_rad_per_s", "force_N", "felt_ratio"]
    drawn = draw_sweep(TABLE, ["k"], names, system=system)
    print_table(SafeConsole(width=100), spread_table(TABLE, names, system))
    printed = capsys.readouterr().out
    for axes, name in zip(drawn.axes, names, strict=True):
        word, _, unit = axes.get_ylabel().partition(", ")
        assert word == kept_figure(name).words
        line = next(each for each in printed.splitlines() if f", {unit} " in each)
        most = float(np.asarray(axes.get_lines()[0].get_ydata())[-1])
        assert f"{most:.3g}" in line
        assert kept_figure(name, system).factor * TABLE[name][1] == pytest.approx(most)


def test_a_check_in_us_units_has_them_in_its_report() -> None:
    verdict = Verdict("r", "a", "rigid", "largest force", 44.482, None, 40.0, quantity="force_N")
    checked = CheckResult((verdict,))
    for system, found in zip(SYSTEMS, ("44.48 N", "10 lb"), strict=True):
        report = render(check_report(checked, provenance_of("c", []), system))
        assert found in report.replace("\N{NO-BREAK SPACE}", " ")


def test_a_force_document_in_us_units_has_them_in_figures_and_report() -> None:
    data = read_rig(shipped_rigs()["bench"])
    found = document(data, "column", None)
    issue = Issue("bench.toml", "", "")
    drawn = {}
    for system, force, pressure in zip(SYSTEMS, ("N", "lb"), ("kPa", "lb/ft²"), strict=True):
        report = render(force_summary([found], issue, provenance_of("c", []), system))
        assert f"q̄, {pressure}" in report and f">{force}<" in report
        drawn[system] = [draw_forces(found, system), draw_static_checks(found, system)]
        for figure in drawn[system]:
            assert figure.axes[0].get_ylabel() == f"force at the grip F, {force}"
            assert pressure in figure.axes[0].get_title()
        [test, *_] = feel_tests(found, "", system)
        assert f" {in_system('N/m', system).unit}" in dict(test.conditions)[GRADIENT]
    for si, us in zip(*drawn.values(), strict=True):
        assert us.axes[0].get_ylim()[1] == pytest.approx(si.axes[0].get_ylim()[1] / POUND_N)
