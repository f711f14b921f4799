"""Base classes of results: display in notebooks, figure, report, and tables.

`coupled.api.display` converts results to HTML and figures. It imports all result classes, so it is
loaded when a result is first displayed.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import TYPE_CHECKING, Any, Protocol, cast

from coupled.arguments import public
from coupled.errors import InputError

if TYPE_CHECKING:
    import polars as pl

    from coupled.plots.histories import Figure


class Display(Protocol):
    """The functions that display results."""

    def draw(self, result: Any) -> Figure:
        """Return the figure of a result."""

    def html(self, result: Any) -> str:
        """Return a result as a part of an HTML page."""

    def write_report(self, result: Any, file: str | PathLike[str]) -> None:
        """Write the report of a result."""


class Plain:
    """A dataclass whose JSON has its fields."""

    def as_dict(self) -> dict[str, Any]:
        """Return the fields as JSON data, without those that are None."""
        return {name: value for name, value in vars(self).items() if value is not None}


@public
class Displayed:
    """An object that a notebook displays and that has a report."""

    def report(self, file: str | PathLike[str]) -> None:
        """Write verdict, tables, figures and settings as one HTML file.

        Raises InputError if the name does not end in .html, or if the file cannot be written.
        """
        _display().write_report(self, file)

    def _repr_html_(self) -> str:
        return _display().html(self)


class Result(Displayed):
    """An object that a notebook displays, with a figure."""

    def plot(self) -> Figure:
        """Return the matplotlib Figure of the result; `.savefig(path)` writes it."""
        return _display().draw(self)


class Tabular:
    """An object that can be converted to a table."""

    def to_polars(self) -> pl.DataFrame:
        """Return the table as a polars DataFrame."""
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """Return the table as a pandas DataFrame. Raises InputError if pandas is not installed."""
        return pandas_frame(self.to_polars())


class TableResult(Result, Tabular):
    """A result with a table."""


def _display() -> Display:
    # Imported by name: it depends on all result classes.
    return cast(Display, importlib.import_module("coupled.api.display"))


def frame_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[str] = ()) -> pl.DataFrame:
    """Return rows as a polars DataFrame, null for None; with `columns` if there are no rows."""
    polars: Any = importlib.import_module("polars")
    if rows:
        frame: pl.DataFrame = polars.DataFrame(rows, infer_schema_length=None)
    else:
        frame = polars.DataFrame({name: [] for name in columns})
    return frame


def pandas_frame(frame: pl.DataFrame) -> Any:
    """Return a polars frame as a pandas frame. Raises InputError if pandas is not installed."""
    try:
        pandas: Any = importlib.import_module("pandas")
    except ImportError:
        problem = "is not installed: pip install pandas, or take to_polars()"
        raise InputError("pandas", "", problem) from None
    return pandas.DataFrame({name: frame[name].to_list() for name in frame.columns})
