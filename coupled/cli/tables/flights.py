"""Comparisons on a terminal of 80 columns: rows are figures, columns configurations or cases."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from coupled.authority.figures import named, remarks, rows
from coupled.cli.tables.whole import print_whole
from coupled.display import System

if TYPE_CHECKING:
    from coupled.authority.compare import Flight


def print_comparison(console: Console, flights: Sequence[Flight], system: System = "si") -> None:
    """Print a comparison: its card, and a table for each case or single configuration."""
    run = flights[0].manoeuvre
    width = min(92, console.width)
    console.print(Panel(escape(" ".join(run.card.split())), title=escape(run.name), width=width))
    cases = [list(group) for _, group in groupby(flights, key=lambda f: f.outcome.case)]
    if len(cases) > 1 and all(len(case) == 1 for case in cases):
        _print_table(console, "", [(f.outcome.case, f) for f in flights], system)
    else:
        for case in cases:
            title = case[0].outcome.case if len(cases) > 1 else ""
            _print_table(console, title, [(named(f), f) for f in case], system)
    for sentence in remarks(flights, system):
        console.print(f"{escape(sentence)}\n", highlight=False)
    for flight in flights:
        o = flight.outcome
        if o.ended_early:
            console.print(f"{escape(o.case)}, {o.configuration}: ended early, {o.ended_early}")


def _print_table(
    console: Console, title: str, columns: Sequence[tuple[str, Flight]], system: System
) -> None:
    table = Table(box=None, title=escape(title) or None, title_justify="left", title_style="bold")
    table.add_column("", no_wrap=True)
    for head, _ in columns:
        table.add_column(escape(_broken(head)), justify="right", vertical="bottom")
    for label, cells in rows([flight for _, flight in columns], system):
        table.add_row(label, *cells)
    print_whole(console, table)
    console.print()


def _broken(head: str) -> str:
    """Return a column's heading, broken if it is long, with a remark on the last line."""
    head, bracket, remark = head.partition(" (")
    last = f"\n{remark.rstrip(')')}" if bracket else ""
    if head.endswith("compensated"):
        return head.replace("compensated", "compen-\nsated") + last
    return head.replace(" ", "\n", 1) + last
