"""Verdicts on a terminal of 80 columns: a row an expectation."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from coupled.campaign.words import wanted

if TYPE_CHECKING:
    from coupled.campaign.verdict import Verdict


def print_verdicts(console: Console, verdicts: Sequence[Verdict]) -> None:
    """Print a table a case, and how many passed."""
    for (run, case), group in groupby(verdicts, key=lambda v: (v.run, v.case)):
        console.print(escape(run if run == case else f"{run}: {case}"), style="bold")
        table = Table("", "expected of", box=None, pad_edge=False)
        for head in ("found", "wanted", "margin"):
            table.add_column(head, justify="right", overflow="fold")
        for verdict in group:
            table.add_row(*_cells(verdict))
        console.print(table)
        console.print()
    passed = sum(verdict.passed for verdict in verdicts)
    console.print(f"{passed} of {len(verdicts)} expectations hold", highlight=False)


def _cells(verdict: Verdict) -> tuple[str, ...]:
    mark = "[green]pass[/]" if verdict.passed else "[red]FAIL[/]"
    what = f"{verdict.what} \\[{verdict.configuration}]"
    if verdict.value is None or verdict.margin is None:
        return mark, f"{what}: {escape(verdict.problem)}", "–", wanted(verdict), "–"
    return mark, what, f"{verdict.value:.4g}", wanted(verdict), f"{verdict.margin:.2g}"
