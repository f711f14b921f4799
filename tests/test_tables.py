"""A table is data: the terminal and HTML show the same cells, and each result has one table."""

from __future__ import annotations

import re
from io import StringIO
from typing import get_args

import pytest

from coupled.authority.figures import kept_figure
from coupled.campaign.check import CheckResult
from coupled.campaign.verdict import Verdict
from coupled.cli.tables import print_table
from coupled.cli.terminal import SafeConsole
from coupled.display import drawn
from coupled.flight.expectation import Figure
from coupled.reports.check import check_report
from coupled.reports.page import Provenance, Report, Section, render
from coupled.reports.page import Verdict as Sentence
from coupled.tables.campaign import verdict_tables
from coupled.tables.table import Mark, Table

MADE = Provenance("coupled", (), ())
TABLE = Table(
    ("", "found, N", "", "remark"),
    (
        ("rigid",),
        ("force [hand]", "1.5", Mark("pass", "good"), "a few words"),
        ("compensated",),
        ("force", "12.25", Mark("FAIL", "bad"), ""),
    ),
    "Forces",
    "lrl",
    ("remark",),
)


def printed(table: Table, width: int) -> str:
    console = SafeConsole(file=StringIO(), width=width, color_system=None)
    print_table(console, table)
    assert isinstance(console.file, StringIO)
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())


def test_rows_below_a_heading_are_indented_and_numbers_stand_at_the_right() -> None:
    assert printed(TABLE, 60).splitlines() == [
        "Forces",
        "               found, N        remark",
        "rigid",
        " force [hand]       1.5  pass  a few words",
        "compensated",
        " force            12.25  FAIL",
    ]


def test_html_and_terminal_show_the_same_cells() -> None:
    section = Section("s", (TABLE,))
    page = render(Report("k", "t", Sentence("v"), (section,), (), MADE))
    assert page.count('<th scope="colgroup" colspan="4">') == 2
    assert '<span class="bad">FAIL</span>' in page
    words = re.sub(r"<[^>]*>", " ", page[page.index("<caption>") : page.index("</table>")]).split()
    assert words == printed(TABLE, 60).split()


def test_a_table_without_a_column_keeps_headings_and_sides() -> None:
    less = TABLE.without("found, N")
    assert less.heads == ("", "", "remark")
    assert less.rows[0] == ("rigid",)
    assert less.rows[1] == ("force [hand]", Mark("pass", "good"), "a few words")
    assert [less.has_words(i) for i in range(3)] == [True, True, True]
    assert [TABLE.has_words(i) for i in range(5)] == [True, False, True, True, True]


def test_a_report_of_a_check_has_the_tables_of_the_terminal() -> None:
    verdicts = tuple(
        Verdict(run, case, "rigid", "force", 10.0, None, most, quantity="force_N")
        for run, case, most in (("r", "r", 12.0), ("r", "a", 8.0), ("s", "b", 12.0))
    )
    report = check_report(CheckResult(verdicts), MADE, "us")
    assert [section.head for section in report.sections] == ["r", "s"]
    blocks = [block for section in report.sections for block in section.blocks]
    assert blocks == list(verdict_tables(verdicts, "us"))
    assert [block.caption for block in blocks if isinstance(block, Table)] == ["r", "r: a", "s: b"]


@pytest.mark.parametrize("name", get_args(Figure))
def test_every_figure_that_a_sweep_keeps_has_words(name: str) -> None:
    assert "," not in kept_figure(name).words  # as the label of a name with a unit has
    assert kept_figure(name).label.endswith("% of travel") == name.endswith("_norm")


@pytest.mark.parametrize(
    ("name", "si", "us"),
    [
        ("column_deflection_m", "1.2 cm", "0.4724 in"),
        ("wheel_deflection_rad", "0.6875 °", "0.6875 °"),
        ("dynamic_pressure_Pa", "1.2e-05 kPa", "0.0002506 lb/ft²"),
        ("altitude_m", "0.012 m", "0.03937 ft"),
        ("load_factor", "0.012 g", "0.012 g"),
        ("column_gain", "0.012", "0.012"),
    ],
)
def test_a_quantity_is_drawn_in_the_units_of_figures(name: str, si: str, us: str) -> None:
    shown = [drawn(name), drawn(name, "us")]
    assert [f"{unit.written(0.012)} {unit.unit}".strip() for unit in shown] == [si, us]
    assert drawn("column_deflection_m", fine=True).factor == 1000.0
