"""Reports of commands: the numbers of the tables are those of the results, whole or not at all."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from pypdf import PdfReader

from coupled.files import sha256
from coupled.resources import shipped_rigs, shipped_runs
from tests.support.browser import CHROMIUM, PAPERS, printed
from tests.support.commands import ROOT, coupled, files

REPORT = "out/report.html"


def test_a_comparison_is_reported_with_its_numbers_and_hashes(tmp_path: Path) -> None:
    words = ("compare", "appendix-c", "--no-figure", "--report", REPORT, "--json", "out/t.json")
    done = coupled(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    assert f"report: {REPORT}" in done.stdout
    text = (tmp_path / REPORT).read_text(encoding="utf-8")
    for row in json.loads((tmp_path / "out/t.json").read_text(encoding="utf-8")):
        assert f"{100 * abs(row['loss_closed_form']):.2f}<" in text
        assert f"{row['force_N']:.1f}<" in text
    for file in (shipped_runs()["appendix-c"], shipped_rigs()["bench"]):
        assert sha256(file) in text
    assert "coupled compare appendix-c --no-figure" in text


@pytest.mark.slow
def test_the_same_command_gives_the_same_bytes(tmp_path: Path) -> None:
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        words = ("compare", "appendix-c", "--no-figure", "--report", REPORT)
        assert coupled(tmp_path / name, *words).returncode == 0
        made.append((tmp_path / name / REPORT).read_bytes())
    assert made[0] == made[1]


@pytest.mark.parametrize(
    ("target", "problem"),
    [("r.pdf", "ends in .html"), ("run.html", "another file"), ("no/such.html/r.html", "written")],
)
def test_a_report_that_cannot_be_written_is_refused_before_the_work(
    target: str, problem: str, tmp_path: Path
) -> None:
    shutil.copy(shipped_runs()["appendix-c"], tmp_path / "run.html.toml")
    (tmp_path / "run.html").symlink_to("run.html.toml")
    (tmp_path / "no").mkdir()
    (tmp_path / "no/such.html").write_text("")
    before = files(tmp_path)
    done = coupled(tmp_path, "compare", "./run.html.toml", "--no-figure", "--report", target)
    assert done.returncode == 2
    assert problem in done.stderr
    assert files(tmp_path) == before


def test_a_calibration_is_reported_with_its_intervals(tmp_path: Path) -> None:
    assert coupled(tmp_path, "bench").returncode == 0
    words = ("calibrate", "out/report-column-readings.csv", "--date", "1974-02-04")
    done = coupled(tmp_path, *words, "--report", REPORT, "--json", "out/c.json")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / REPORT).read_text(encoding="utf-8")
    found = json.loads((tmp_path / "out/c.json").read_text(encoding="utf-8"))
    bend = found["errors_in_variables"]["bend_m_per_N"]
    assert f"K = {bend['value']:.2e}" in text
    assert f"({bend['low']:.2e} to {bend['high']:.2e})" in text
    assert "1974-02-04" in text
    assert len(re.findall('<th scope="row">[0-9]+</th>', text)) == found["readings"]
    done = coupled(tmp_path, "calibrate", "--plan", "--report", REPORT)
    assert done.returncode == 2


def test_a_check_is_reported_pass_and_fail(tmp_path: Path) -> None:
    shutil.copy(shipped_rigs()["bench"], tmp_path)
    run = shipped_runs()["appendix-c"].read_text(encoding="utf-8")
    run += '\n[[expect]]\nmeasure = "force_N"\nleast = 9999\n'
    (tmp_path / "my.toml").write_text(run, encoding="utf-8")
    done = coupled(tmp_path, "check", "my.toml", "--report", REPORT, "--json", "out/c.json")
    assert done.returncode == 1
    text = (tmp_path / REPORT).read_text(encoding="utf-8")
    verdicts = json.loads((tmp_path / "out/c.json").read_text(encoding="utf-8"))
    failed = sum(not verdict["passed"] for verdict in verdicts)
    assert 0 < failed < len(verdicts)
    assert text.count('<span class="bad">FAIL</span>') == failed
    assert text.count('<span class="good">pass</span>') == len(verdicts) - failed
    assert f"{len(verdicts) - failed} of {len(verdicts)} expectations hold." in text
    assert '<section class="verdict bad">' in text


def test_a_sweep_is_reported_with_what_was_varied(tmp_path: Path) -> None:
    sweep = """name = "bends"
run = "appendix-c"
configurations = ["uncompensated"]
keep = ["loss"]
[[vary]]
key = "rig.controls.column.loader.bend_m_per_N"
values = [1e-5, 9e-5]
"""
    (tmp_path / "s.toml").write_text(sweep)
    done = coupled(tmp_path, "sweep", "s.toml", "-j", "1", "--report", REPORT, "--json", "t.json")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / REPORT).read_text(encoding="utf-8")
    losses = [row["loss"] for row in json.loads((tmp_path / "t.json").read_text())]
    assert "2 flights over one parameter, 0 ended early." in text
    assert f"{100 * min(losses):.4g} to {100 * max(losses):.4g}, median" in text
    assert sha256(tmp_path / "s.toml") in text


@pytest.mark.slow
def test_a_diagnosis_is_reported_and_prints(tmp_path: Path) -> None:
    shutil.copy(ROOT / "tests/data/loose.toml", tmp_path)
    assert coupled(tmp_path, "fly", "loose.toml", "-o", "loose.csv").returncode == 0
    words = ("diagnose", "loose.csv", "--rig", "report-column", "--report", REPORT)
    done = coupled(tmp_path, *words)
    assert done.returncode == 0, done.stderr
    text = (tmp_path / REPORT).read_text(encoding="utf-8")
    assert '<th scope="row">backlash</th>' in text
    assert "loader.play_m" in text
    assert sha256(tmp_path / "loose.csv") in text
    assert text.count("<svg") == 3
    if CHROMIUM is None:
        return
    for paper in PAPERS:
        pdf, said = printed(tmp_path / REPORT, paper)
        assert said == []
        first = PdfReader(pdf).pages[0].extract_text() or ""
        assert "Backlash" in first
        assert first.index("Backlash") < first.index("Stages of the chain")
