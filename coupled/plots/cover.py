"""The first pages of the PDF of a force documentation: the cover and the table of checks."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coupled.calibration.documentation import Documentation
from coupled.calibration.qualification import (
    FeelTest,
    Issue,
    Kind,
    check_numbers,
    cover_rows,
    feel_tests,
)
from coupled.display import System, pressure_in, pressure_shown
from coupled.plots.histories import plain
from coupled.record.channels import ControlName
from coupled.version import __version__

PAGE = (8.27, 11.0)  # inches; fits A4 and Letter
_LEFT, _VALUES, _RIGHT = 0.1, 0.36, 0.92
_LINE = 0.0165  # share of the page height
_ROWS = 46  # rows of the table on one page
_HEADS = ("test", "control", "q̄, kPa", "check", "rig", "reference", "±", "", "result", "fig.")
_AT = (0.07, 0.18, 0.285, 0.31, 0.60, 0.69, 0.76, 0.77, 0.815, 0.92)
_RIGHTS = (False, False, True, False, True, True, True, False, False, True)
Numbers = Mapping[tuple[ControlName, Kind], int]


def draw_cover(documents: Sequence[Documentation], issue: Issue) -> Figure:
    """Draw the cover: the subject of the document, its issue, and lines for signatures."""
    figure = Figure(figsize=PAGE)
    figure.text(_LEFT, 0.86, "Force documentation", fontsize=22, weight="bold")
    figure.text(_LEFT, 0.82, plain(documents[0].rig.name), fontsize=16)
    checks = [check for found in documents for check in found.checks]
    good = sum(check.passed for check in checks)
    y = 0.75
    said = f"{good} of {len(checks)} checks are within their tolerance"
    for name, value in (*cover_rows(documents, issue, __version__), ("result", said)):
        figure.text(_LEFT, y, name, fontsize=10, color="0.35")
        for line in textwrap.wrap(value, 52) or [""]:
            figure.text(_VALUES, y, plain(line), fontsize=10)
            y -= 1.2 * _LINE
        y -= 0.4 * _LINE
    for x, name in zip((0.1, 0.39, 0.68), ("Prepared", "Checked", "Accepted"), strict=True):
        figure.add_artist(_rule(x, x + 0.24, 0.16))
        figure.text(x, 0.14, name, fontsize=9, color="0.35")
    return figure


def _rule(start: float, end: float, y: float) -> Line2D:
    return Line2D([start, end], [y, y], color="black", linewidth=0.8)


def draw_check_table(
    documents: Sequence[Documentation], issue: Issue, numbers: Numbers, system: System = "si"
) -> list[Figure]:
    """Draw the table of all checks; `numbers` are the numbers of the figures that show them."""
    rows = [
        row
        for found in documents
        for test in feel_tests(found, issue.reference, system)
        for row in _rows(test, numbers[found.control, test.kind], system)
    ]
    pages = [rows[i : i + _ROWS] for i in range(0, len(rows), _ROWS)]
    heads = tuple(h.replace("kPa", pressure_shown(system).unit) for h in _HEADS)
    return [_page(part, heads, f"Checks, {i} of {len(pages)}") for i, part in enumerate(pages, 1)]


def _rows(test: FeelTest, number: int, system: System) -> list[tuple[str, ...]]:
    return [
        (
            test.number,
            test.control,
            pressure_in(check.pressure_Pa, system).partition(" ")[0],
            check.name,
            *check_numbers(check, system),
            "pass" if check.passed else "FAIL",
            str(number),
        )
        for check in test.checks
    ]


def _page(rows: Sequence[Sequence[str]], heads: Sequence[str], head: str) -> Figure:
    figure = Figure(figsize=PAGE)
    figure.text(_AT[0], 0.95, head, fontsize=14, weight="bold")
    for row, y in zip((heads, *rows), (0.915 - k * _LINE * 1.1 for k in range(99)), strict=False):
        bold = "bold" if row is heads else "normal"
        for text, x, right in zip(row, _AT, _RIGHTS, strict=True):
            side = "right" if right else "left"
            color = "#b42318" if text == "FAIL" else "black"
            figure.text(x, y, text, fontsize=7.5, ha=side, weight=bold, color=color)
    figure.add_artist(_rule(_AT[0], _RIGHT, 0.909))
    return figure
