"""Tables for a terminal of 80 columns: a row a figure, a column a configuration or a case."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.panel import Panel
from rich.table import Table

from coupled.units import DEGREE_rad

if TYPE_CHECKING:
    from coupled.authority.compare import Flight, Outcome

# A figure's field, its name for people, and how it is written.
_ROWS: tuple[tuple[str, str, Callable[[float], str]], ...] = (
    ("asked_norm", "surface asked, % of travel", lambda x: f"{100 * abs(x):.2f}"),
    ("reached_norm", "surface reached, %", lambda x: f"{100 * abs(x):.2f}"),
    ("loss", "authority lost, %", lambda x: f"{100 * x:.2f}"),
    ("loss_closed_form", "  by closed form, %", lambda x: f"{100 * x:.2f}"),
    ("felt_ratio", "felt of specified gradient", lambda x: f"{x:.3f}"),
    ("felt_ratio_closed_form", "  by closed form", lambda x: f"{x:.3f}"),
    ("force_N", "force needed, N", lambda x: f"{x:.1f}"),
    ("force_step_N", "force step, N", lambda x: f"{x:.2f}"),
    ("peak_rate_rad_per_s", "peak {rate} rate, °/s", lambda x: f"{x / DEGREE_rad:.2f}"),
    ("peak_load_factor", "peak load factor", lambda x: f"{x:.3f}"),
    ("time_to_attitude_s", "time to {change:.1f}° of {angle}, s", lambda x: f"{x:.2f}"),
)
_WORDS = {"column": ("pitch", "pitch"), "wheel": ("roll", "bank"), "pedals": ("yaw", "heading")}


def print_comparison(console: Console, flights: Sequence[Flight]) -> None:
    """Print a comparison: its card, and a table a case (one in all for a single configuration)."""
    run = flights[0].manoeuvre
    width = min(92, console.width)
    console.print(Panel(escape(" ".join(run.card.split())), title=escape(run.name), width=width))
    cases = [list(group) for _, group in groupby(flights, key=lambda f: f.outcome.case)]
    if len(cases) > 1 and all(len(case) == 1 for case in cases):
        _print_table(console, "", [(f.outcome.case, f) for f in flights])
    else:
        for case in cases:
            title = case[0].outcome.case if len(cases) > 1 else ""
            _print_table(console, title, [(f.configuration, f) for f in case])
    for flight in flights:
        o = flight.outcome
        if o.ended_early:
            console.print(f"{escape(o.case)}, {o.configuration}: ended early, {o.ended_early}")


def _print_table(console: Console, title: str, columns: Sequence[tuple[str, Flight]]) -> None:
    manoeuvre = columns[0][1].manoeuvre
    rate, angle = _WORDS[manoeuvre.control]
    change = manoeuvre.measure.attitude_change / DEGREE_rad
    table = Table(box=None, title=escape(title) or None, title_justify="left", title_style="bold")
    table.add_column("", no_wrap=True)
    for head, _ in columns:
        table.add_column(escape(_broken(head)), justify="right", vertical="bottom")
    for field, label, form in _ROWS:
        cells = [_cell(flight.outcome, field, form) for _, flight in columns]
        if any(cell != "–" for cell in cells):
            table.add_row(label.format(rate=rate, angle=angle, change=change), *cells)
    console.print(table)
    console.print()


def _broken(head: str) -> str:
    """Return a column's head on two lines where it is long."""
    if head.endswith("compensated"):
        return head.replace("compensated", "compen-\nsated")
    return head.replace(" ", "\n", 1)


def _cell(outcome: Outcome, field: str, form: Callable[[float], str]) -> str:
    value = getattr(outcome, field)
    if value is None or not math.isfinite(value):
        return "–"
    text = form(value)
    return text.lstrip("-") if float(text) == 0.0 else text
