"""Tables on a terminal without cut columns: in a narrow one, each row is printed as lines."""

from __future__ import annotations

import re
from dataclasses import replace

import rich.table
from rich.cells import cell_len
from rich.console import Console
from rich.markup import escape
from rich.text import Text

from coupled.tables.table import Cell, Mark, Table

_COLORS = {"good": "green", "bad": "red", "plain": "default"}


def print_table(console: Console, table: Table, edge: bool = False, gap: int = 2) -> None:
    """Print a table below its caption; if its columns do not fit, one line per cell.

    If it fits without some of its spare columns, these are omitted and named: --wide shows them. In
    lines, a cell without a heading, as a unit or a verdict, follows the cell before it. `edge` puts
    a space before each line, `gap` is the number of spaces between columns.
    """
    if table.caption:
        console.print(escape(table.caption), style="bold", highlight=False)
    room = console.width - (2 if edge else 0)
    shown = table
    for head in reversed(table.spare):
        if _width(shown, gap) <= room:
            break
        shown = shown.without(head)
    if _width(shown, gap) > room:
        _print_lines(console, table)
        return
    console.print(_laid_out(shown, edge, gap), highlight=False)
    left_out = [head for head in table.spare if head not in shown.heads]
    if left_out:
        console.print(f"[dim]--wide shows also: {', '.join(left_out)}[/]", highlight=False)


def broken_heads(table: Table) -> Table:
    """Return a table whose long headings are on several lines, a remark in () on the last."""
    return replace(table, heads=tuple(map(_broken, table.heads)))


def _broken(head: str) -> str:
    head, bracket, remark = head.partition(" (")
    last = f"\n{remark.rstrip(')')}" if bracket else ""
    if head.endswith("compensated"):
        return head.replace("compensated", "compen-\nsated") + last
    return head.replace(" ", "\n", 1) + last


def _markup(cell: Cell) -> str:
    if isinstance(cell, Mark):
        return f"[{_COLORS[cell.tone]}]{escape(cell.text)}[/]"
    return escape(cell)


def _columns(table: Table) -> list[list[str]]:
    """Return the cells of each column as rich's markup; those below a heading are indented."""
    empty, grouped = [""] * (len(table.heads) - 1), False
    rows = []
    for first, *others in table.rows:
        if not others and empty:
            grouped = True
            rows.append([f"[bold]{_markup(first)}[/]", *empty])
        else:
            rows.append([(" " if grouped else "") + _markup(first), *map(_markup, others)])
    return [list(column) for column in zip(*rows, strict=True)] or [[] for _ in table.heads]


def _laid_out(table: Table, edge: bool, gap: int) -> rich.table.Table:
    """Return a table as rich prints it; numbers and single words are never wrapped."""
    padding = (0, gap - gap // 2, 0, gap // 2)
    laid = rich.table.Table(box=None, pad_edge=edge, padding=padding)
    columns = _columns(table)
    for i, (head, cells) in enumerate(zip(table.heads, columns, strict=True)):
        words = table.has_words(i)
        laid.add_column(
            escape(head),
            justify="left" if words else "right",
            vertical="bottom" if any("\n" in each for each in table.heads) else "top",
            no_wrap=not words or not any(re.search(r"\S\s", cell) for cell in (head, *cells)),
        )
    for row in zip(*columns, strict=True):
        laid.add_row(*row)
    return laid


def _width(table: Table, gap: int) -> int:
    """Return the terminal width that a table needs without breaking words and numbers."""
    width = gap * (len(table.heads) - 1)
    for i, (head, cells) in enumerate(zip(table.heads, _columns(table), strict=True)):
        texts = [head, *(Text.from_markup(cell).plain for cell in cells)]
        words = table.has_words(i)
        parts = [part for text in texts for part in (text.split() if words else text.splitlines())]
        width += max((cell_len(part) for part in parts), default=0)
    return width


def _print_lines(console: Console, table: Table) -> None:
    """Print one line per cell, below the name of the row."""
    first, *heads = [" ".join(head.split()).replace("- ", "") for head in table.heads]
    for row in zip(*_columns(table), strict=True):
        name, *cells = (Text.from_markup(cell) for cell in row)
        if first and not table.has_words(0):  # a number has no meaning alone
            name = Text(f"{first}: ") + name
        if name.plain:
            console.print(name, style="bold")
        lines: list[Text] = []
        for head, cell in zip(heads, cells, strict=True):
            if head or not lines:
                lines.append(Text(f"  {head}: " if head else "  ") + cell if cell.plain else Text())
            elif cell.plain:
                lines[-1] = lines[-1] + (" " if lines[-1].plain else "  ") + cell
        for line in lines:
            if line.plain:
                console.print(line)
