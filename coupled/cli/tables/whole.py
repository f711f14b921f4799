"""A table that fits any terminal: on a narrow one, each row is written as lines."""

from __future__ import annotations

from collections.abc import Sequence

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text


def print_whole(console: Console, table: Table, spare: Sequence[str] = ()) -> None:
    """Print a table; if its columns do not fit, a line for each cell under the row's name.

    Where it fits without some of the columns whose heads are in `spare`, those are left out, the
    last one first, and named: --wide shows them. A cell without a head, as a unit or a verdict,
    stands behind the one before it.
    """
    every = table.columns
    left_out = _narrow(table, console.width, spare)
    if _needs(table) <= console.width:
        console.print(table, highlight=False)
        if left_out:
            console.print(f"[dim]--wide shows also: {', '.join(left_out)}[/]", highlight=False)
        return
    table.columns = every
    first, *heads = [" ".join(str(one.header).split()).replace("- ", "") for one in table.columns]
    if table.title is not None:
        console.print(Text.from_markup(str(table.title), style="bold"))
    for row in zip(*(column.cells for column in table.columns), strict=True):
        name, *cells = (Text.from_markup(str(cell)) for cell in row)
        if first and table.columns[0].justify == "right":  # a number, which has no meaning alone
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


def _narrow(table: Table, width: int, spare: Sequence[str]) -> list[str]:
    """Take spare columns off a table until it fits a width; return their heads.

    None if it does not fit without them either: the list then has all columns.
    """
    left_out, every = list[str](), table.columns
    for head in reversed(spare):
        if _needs(table) <= width:
            break
        table.columns = [column for column in table.columns if column.header != head]
        left_out.insert(0, head)
    if _needs(table) > width:
        table.columns = every
        return []
    return left_out


def _needs(table: Table) -> int:
    """Return the width that a table needs without breaking words and numbers."""
    _, right, _, left = table.padding
    width = len(table.columns) * (left + right) - (0 if table.pad_edge else left + right)
    for column in table.columns:
        texts = [Text.from_markup(str(cell)).plain for cell in (column.header, *column.cells)]
        whole = column.no_wrap or column.justify == "right"
        parts = [part for text in texts for part in (text.splitlines() if whole else text.split())]
        width += max((cell_len(part) for part in parts), default=0)
    return width
