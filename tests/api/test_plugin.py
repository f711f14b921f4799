"""Run files as tests of pytest, in a project of somebody else's."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import coupled
from tests.support.commands import ROOT

RUN = """
name = "hold"
card = "A steady pull on the bench."
rig = "bench"
duration_s = 2.0
configurations = ["uncompensated"]
[bench]
time_s = [0.0]
dynamic_pressure_Pa = [3000.0]
[pilot.column]
kind = "ramp"
force_N = 60.0
ramp_s = 1.0
[[expect]]
channel = "column_force_N"
take = "greatest"
most = {most}
why = "what one hand holds"
[[expect]]
measure = "loss"
least = 0.0
"""

OWN = """
import sys
def test_own():
    assert 'coupled.pytest_plugin' in sys.modules
    loaded = {'numba', 'jsbsim', 'pydantic', 'polars'} & set(sys.modules)
    assert not loaded or 'coupled.campaign.check' in sys.modules
"""


def run_pytest(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run pytest in a folder with this plugin alone."""
    return subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "coupled.pytest_plugin",
            "-p",
            "no:cacheprovider",
            *words,
        ],
        cwd=folder,
        env={**os.environ, "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "PYTEST_ADDOPTS": ""},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def project(folder: Path, most: float, settings: str = "") -> None:
    """Make a project with one run of two expectations, and a test of its own."""
    (folder / "pytest.ini").write_text(f"[pytest]\n{settings}\n")
    (folder / "runs").mkdir()
    (folder / "runs" / "hold.toml").write_text(RUN.format(most=most))
    (folder / "runs" / "other.toml").write_text("[tool]\nname = 'not a run'\n")
    (folder / "test_own.py").write_text(OWN)


@pytest.mark.slow
def test_what_fails_shows_figure_bounds_margin_time_and_why(tmp_path: Path) -> None:
    project(tmp_path, 50.0)
    done = run_pytest(tmp_path, "runs", "--coupled-report", "failed.html")
    assert done.returncode == 1, done.stdout + done.stderr
    assert "1 failed, 1 passed" in done.stdout
    said = [
        "measured  59.5 N",
        "expected  ≤ 50 N",
        "margin    -9.5 N",
        "time      1.992 s",
        "why       what one hand holds",
    ]
    for line in said:
        assert re.search(line, done.stdout), (line, done.stdout)
    assert "Traceback" not in done.stdout
    page = (tmp_path / "failed.html").read_text(encoding="utf-8")
    assert "1 of 2 expectations hold." in page
    assert "what one hand holds" in page
    # The same text from Python.
    checked = coupled.check(tmp_path / "runs" / "hold.toml")
    assert not checked
    with pytest.raises(AssertionError, match="1 of 2 expectations hold") as raised:
        checked.require()
    for line in said:
        assert re.search(line, str(raised.value)), line


@pytest.mark.slow
def test_what_holds_passes_and_each_expectation_is_a_test(tmp_path: Path) -> None:
    project(tmp_path, 70.0)
    done = run_pytest(tmp_path, "-v", "--coupled-report", "failed.html")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3 passed" in done.stdout
    assert "column_force_N, greatest [uncompensated]" in done.stdout
    assert "2 of 2 expectations hold." in (tmp_path / "failed.html").read_text(encoding="utf-8")
    assert coupled.check(tmp_path / "runs" / "hold.toml").require()


def test_other_tests_load_nothing_of_ours(tmp_path: Path) -> None:
    project(tmp_path, 70.0, "coupled_runs = flights/*.toml")
    own = OWN + "    assert 'coupled.campaign.check' not in sys.modules\n"
    (tmp_path / "test_own.py").write_text(own)
    done = run_pytest(tmp_path, "-v")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "1 passed" in done.stdout


def test_the_patterns_choose_the_runs_and_a_fault_is_one_line(tmp_path: Path) -> None:
    project(tmp_path, 70.0, "coupled_runs = runs/o*.toml")
    done = run_pytest(tmp_path, "runs")
    assert done.returncode == 2, done.stdout
    assert "other.toml: tool: no such key" in done.stdout or "other.toml" in done.stdout
    assert "hold.toml" not in done.stdout
    assert "Traceback" not in done.stdout


def test_a_report_that_is_no_html_is_refused(tmp_path: Path) -> None:
    project(tmp_path, 70.0)
    done = run_pytest(tmp_path, "--coupled-report", "failed.pdf")
    assert done.returncode == 4
    assert "end its name in .html" in done.stderr


def test_an_installation_brings_the_plugin() -> None:
    table = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert table["project"]["entry-points"]["pytest11"] == {"coupled": "coupled.pytest_plugin"}
