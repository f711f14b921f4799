"""Reports of commands: the numbers of the tables are those of the results, whole or not at all."""

from __future__ import annotations

import json
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
        assert f"{100 * row['loss_closed_form']:.2f}<" in text
        assert f"{row['force_N']:.1f}<" in text
    for file in (shipped_runs()["appendix-c"], shipped_rigs()["bench"]):
        assert sha256(file) in text
    assert "coupled compare appendix-c --no-figure" in text


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
