"""The force document: every check in a test, each test with its conditions and its figure."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from pypdf import PdfReader

from coupled.calibration.documentation import Documentation, document
from coupled.calibration.qualification import NOT_GIVEN, Issue, cover_rows, feel_tests
from coupled.files import sha256
from coupled.plots.documentation import draw_pages
from coupled.resources import shipped_rigs
from tests.support.commands import coupled
from tests.support.rigs import bench as bench_rig

ISSUE = Issue("my.toml", "ab12", "what the rig's own file specifies")


@pytest.fixture(scope="module")
def found() -> Documentation:
    return document(bench_rig(), "column", 0.3)


def test_every_check_stands_in_one_test(found: Documentation) -> None:
    tests = list(feel_tests(found, ISSUE.reference))
    assert sorted(
        (check for test in tests for check in test.checks), key=lambda c: (c.pressure_Pa, c.name)
    ) == sorted(found.checks, key=lambda c: (c.pressure_Pa, c.name))
    cases = len(found.conditions)
    assert [test.number for test in tests] == [
        f"2.{part}.1-{i}" for part in "ab" for i in range(1, cases + 1)
    ]
    for test in tests:
        assert {check.pressure_Pa for check in test.checks} == {test.condition.pressure_Pa}
        released = any("crossing" in c.name or "90 %" in c.name for c in test.checks)
        assert released == (test.kind == "release")


def test_conditions_say_where_and_how(found: Documentation) -> None:
    static, *_ = feel_tests(found, ISSUE.reference)
    said = dict(static.conditions)
    match = re.match(r"([\d.]+) kPa, ([\d.]+) m/s", said["feel pressure q̄"])
    assert match is not None
    pressure, airspeed = match.groups()
    assert 0.5 * 1.225 * float(airspeed) ** 2 == pytest.approx(1000 * float(pressure), rel=0.02)
    assert "100 s" in said["method"]
    assert said["reference"] == ISSUE.reference
    assert dict(static.tolerances)["force"] == "±10 % or ±22.2 N (5 lb), the wider"
    assert dict(static.tolerances)["breakout"] == "±8.9 N (2 lb)"


def test_a_date_is_given_and_not_taken(found: Documentation) -> None:
    said = dict(cover_rows([found], ISSUE, "1"))
    assert said["date"] == said["revision"] == NOT_GIVEN
    issue = Issue("my.toml", "ab12", "x", date="1974-02-04", revision="B")
    said = dict(cover_rows([found], issue, "1"))
    assert (said["date"], said["revision"]) == ("1974-02-04", "B")


@pytest.mark.slow
def test_each_check_names_the_figure_that_shows_it(found: Documentation, tmp_path: Path) -> None:
    pages = draw_pages([found], {}, ISSUE, tmp_path, tmp_path / "d.pdf")
    cover, table, *figures = PdfReader(tmp_path / "d.pdf").pages
    assert len(figures) == len(pages)
    assert "ab12" in cover.extract_text()
    said = table.extract_text().split()
    assert said.count("pass") == sum(check.passed for check in found.checks)
    titles = [figure.extract_text() for figure in figures]
    assert "Figure 3. " in titles[2]
    assert "2.a" in titles[2]
    assert "Figure 4. " in titles[3]
    assert "2.b" in titles[3]


@pytest.mark.slow
def test_the_document_is_issued_as_pdf_and_html(tmp_path: Path) -> None:
    made = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        issue = ("--revision", "B", "--date", "1974-02-04", "--report", "doc.html")
        words = ("document", "t37", "--control", "pedals", "-o", "doc", "--json", "d.json")
        done = coupled(tmp_path / name, *words, *issue)
        assert done.returncode == 1, done.stderr  # its releases fail
        made.append([(tmp_path / name / f).read_bytes() for f in ("doc/t37.pdf", "doc.html")])
    assert made[0] == made[1]
    digest = sha256(shipped_rigs()["t37"])
    checks = json.loads((tmp_path / "a/d.json").read_text())["pedals"]
    cover, table, *figures = PdfReader(tmp_path / "a/doc/t37.pdf").pages
    text = cover.extract_text()
    assert digest in text.replace("\n", "")
    assert "1974-02-04" in text
    assert table.extract_text().count("pass") == sum(check["passed"] for check in checks)
    numbered = [re.findall(r"Figure (\d+)\.", figure.extract_text()) for figure in figures]
    assert numbered == [[str(i)] for i in range(1, len(figures) + 1)]
    html = made[0][1].decode()
    assert digest in html
    rows = re.findall(r'<th scope="row">(2\.[ab]\.3-\d)</th>.*?<td>(\d+)</td>\s*</tr>', html, re.S)
    assert len(rows) == len(checks)
    for number, figure in rows:
        assert f"<b>Figure {figure}.</b> {number}:" in html
