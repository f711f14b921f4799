"""A table that no terminal cuts: where it is too narrow, each row is written downwards."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table
from rich.text import Text


def print_whole(console: Console, table: Table) -> None:
    """Print a table; where its columns do not fit, a line a cell under the row's name."""
    if _needs(console, table) <= console.width:
        console.print(table, highlight=False)
        return
    heads = [" ".join(str(column.header).split()).replace("- ", "") for column in table.columns]
    if table.title is not None:
        console.print(Text.from_markup(str(table.title), style="bold"))
    for row in zip(*(column.cells for column in table.columns), strict=True):
        name, *cells = (Text.from_markup(str(cell)) for cell in row)
        console.print(name, style="bold")
        for head, cell in zip(heads[1:], cells, strict=True):
            if cell.plain:
                console.print(Text(f"  {head}: ") + cell if head else Text("  ") + cell)


def _needs(console: Console, table: Table) -> int:
    """Return the columns of a terminal that a table needs for its words and numbers whole."""
    width = 0
    for column in table.columns:
        texts = [Text.from_markup(str(cell)) for cell in (column.header, *column.cells)]
        whole = column.no_wrap or column.justify == "right"
        sizes = [
            max(
                (len(word) for word in (text.plain.splitlines() if whole else text.plain.split())),
                default=0,
            )
            for text in texts
        ]
        width += max(sizes, default=0)
    return width + 2 * len(table.columns)
