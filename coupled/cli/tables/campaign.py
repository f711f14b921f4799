"""Verdicts and sweeps on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import polars as pl
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from coupled.campaign.verdict import figures as figures_of
from coupled.campaign.verdict import wanted
from coupled.cli.tables.whole import print_whole
from coupled.display import System, parameter_label, shown, unit_in

if TYPE_CHECKING:
    from coupled.campaign.sensitivity import SobolIndex
    from coupled.campaign.survival import SurvivalLimit
    from coupled.campaign.verdict import Verdict

_SHOWN = 6  # parameters of a figure, the strongest


def print_verdicts(console: Console, verdicts: Sequence[Verdict], system: System = "si") -> None:
    """Print a table for each case, figures with their units, and the number passed."""
    for (run, case), group in groupby(verdicts, key=lambda v: (v.run, v.case)):
        console.print(escape(run if run == case else f"{run}: {case}"), style="bold")
        table = Table("", "expected of", box=None, pad_edge=False)
        for head in ("found", "wanted", "margin"):
            table.add_column(head, justify="right", overflow="fold")
        for verdict in group:
            table.add_row(*_cells(verdict, system))
        print_whole(console, table)
        console.print()
    passed = sum(verdict.passed for verdict in verdicts)
    console.print(f"{passed} of {len(verdicts)} expectations hold", highlight=False)


def _cells(verdict: Verdict, system: System) -> tuple[str, ...]:
    mark = "[green]pass[/]" if verdict.passed else "[red]FAIL[/]"
    what = f"{verdict.what} \\[{verdict.configuration}]"
    if verdict.value is None or verdict.margin is None:
        return mark, f"{what}: {escape(verdict.problem)}", "–", wanted(verdict, system), "–"
    found, margin = figures_of(verdict, system)
    return mark, what, found, wanted(verdict, system), margin


def print_sweep(
    console: Console, found: pl.DataFrame, figures: Sequence[str], system: System = "si"
) -> None:
    """Print each figure's distribution over complete flights, and why others ended early."""
    flown = found.filter(pl.col("ended_early") == "")
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", no_wrap=True)
    for head in ("least", "5 %", "median", "95 %", "greatest", "of"):
        table.add_column(head, justify="right", no_wrap=True)
    for configuration in flown["configuration"].unique(maintain_order=True):
        rows = flown.filter(pl.col("configuration") == configuration)
        table.add_row(f"[bold]{escape(configuration)}[/]", *[""] * 6)
        for name in figures:
            values = rows[name].drop_nulls()
            shares = [values.quantile(share, "linear") for share in (0.0, 0.05, 0.5, 0.95, 1.0)]
            unit = shown(name, system)
            cells = ["–" if value is None else unit.written(value, 3) for value in shares]
            table.add_row(f" {_named(name, unit.unit)}", *cells, str(len(values)))
    print_whole(console, table)
    ended = found.filter(pl.col("ended_early") != "")
    if len(ended):
        first = ended.row(0, named=True)
        why = f"the first, flight {first['flight']}: {first['ended_early']}"
        console.print(f"[yellow]{len(ended)} of {len(found)} ended early[/]; {escape(why)}")


def _named(name: str, unit: str) -> str:
    """Return a figure's name in words, with its unit."""
    plain = name.removesuffix(f"_{unit_in(name)}") if unit_in(name) else name
    return f"{plain.replace('_', ' ')}, {unit}" if unit else plain.replace("_", " ")


def print_indices(console: Console, indices: Sequence[SobolIndex]) -> None:
    """Print the parameters with the largest total index for each figure."""
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("shares of the variance", overflow="fold")
    for head in ("alone", "95 %", "with others", "95 %"):
        table.add_column(head, justify="right", no_wrap=True)
    groups = groupby(indices, key=lambda index: (index.configuration, index.figure))
    for (configuration, figure), group in groups:
        ordered = sorted(group, key=lambda i: -(i.total.value if i.total else 0.0))
        table.add_row(f"[bold]{escape(configuration)}: {figure}[/]", *[""] * 4)
        for index in ordered[:_SHOWN]:
            label = parameter_label(index.key).partition(",")[0]
            table.add_row(f" {escape(label)}", *_shares(index))
    print_whole(console, table)


def _shares(index: SobolIndex) -> tuple[str, ...]:
    cells: list[str] = []
    for share in (index.first, index.total):
        if share is None:
            cells += ["–", ""]
        else:
            cells += [f"{share.value:.3f}", f"{share.low:.3f} to {share.high:.3f}"]
    return tuple(cells)


def print_survival(console: Console, limits: Sequence[SurvivalLimit]) -> None:
    """Print each configuration's boundary of survival, and that of the closed form."""
    if not limits:
        return
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("", no_wrap=True)
    for head in ("survived", "boundary", "closed form"):
        table.add_column(head, justify="right", no_wrap=True)
    for limit in limits:
        places = (limit.boundary, limit.predicted)
        cells = ["–" if value is None else f"{value:.4g}" for value in places]
        name = f"[bold]{escape(limit.configuration)}[/]"
        table.add_row(name, f"{limit.survived} of {limit.flights}", *cells)
    print_whole(console, table)
