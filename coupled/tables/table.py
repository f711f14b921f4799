"""A table as data. `cli.tables` prints it on a terminal, `reports.page` writes it as HTML."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

Tone = Literal["good", "bad", "plain"]
NONE = "–"  # for a missing value


@dataclass(frozen=True)
class Mark:
    """A cell that states whether a result is good."""

    text: str
    tone: Tone


Cell = str | Mark
Row = tuple[Cell, ...]


def passed(good: bool) -> Mark:
    """Return the cell of a check."""
    return Mark("pass", "good") if good else Mark("FAIL", "bad")


@dataclass(frozen=True)
class Table:
    """A table with a heading for each column; units are in the headings or in the first cells.

    A row of a single cell is a heading of the rows below it. `align` has an l (text, left) or an r
    (numbers, right) for each column; its last letter applies to all further columns. A narrow
    terminal may omit the columns whose headings are in `spare`, the last first.
    """

    kind: ClassVar[str] = "table"
    heads: tuple[str, ...]
    rows: tuple[Row, ...]
    caption: str = ""
    align: str = "lr"
    spare: tuple[str, ...] = ()

    def has_words(self, column: int) -> bool:
        """Return whether a column, counted from 0, has text and not numbers."""
        return self.align[min(column, len(self.align) - 1)] == "l"

    def without(self, head: str) -> Table:
        """Return the table without the columns of a heading."""
        kept = [i for i, each in enumerate(self.heads) if each != head]
        return replace(
            self,
            heads=tuple(self.heads[i] for i in kept),
            rows=tuple(row if len(row) == 1 else tuple(row[i] for i in kept) for row in self.rows),
            align="".join("l" if self.has_words(i) else "r" for i in kept),
        )


def number(value: float | None, digits: int = 4) -> str:
    """Return a number with `digits` significant digits, or a dash for None."""
    return NONE if value is None else f"{value:.{digits}g}"


def interval(low: float, high: float, form: str) -> str:
    """Return the ends of an interval in a number format: `0.2 to 0.3`."""
    return f"{low:{form}} to {high:{form}}"
