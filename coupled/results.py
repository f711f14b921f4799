"""What every result has: a display in notebooks, a figure, a report, and tables.

How a result becomes HTML or a figure is known in one place, `coupled.api.display`, which needs all
results. It is loaded when a result is first displayed.
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
    """What knows how a result is displayed."""

    def draw(self, result: Any) -> Figure:
        """Return a result's figure."""

    def html(self, result: Any) -> str:
        """Return a result as a part of a page of HTML."""

    def write_report(self, result: Any, file: str | PathLike[str]) -> None:
        """Write a result's report."""


class Plain:
    """A dataclass whose JSON is its fields."""

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON: the fields, without those that are None."""
        return {name: value for name, value in vars(self).items() if value is not None}


@public
class Displayed:
    """Something that a notebook displays, and that has a report."""

    def report(self, file: str | PathLike[str]) -> None:
        """Write verdict, tables, figures and settings as one HTML file.

        Raises InputError where the name does not end in .html, or it cannot be written.
        """
        _display().write_report(self, file)

    def _repr_html_(self) -> str:
        return _display().html(self)


class Result(Displayed):
    """Something that a notebook displays, with a figure."""

    def plot(self) -> Figure:
        """Return the matplotlib Figure of the result; `.savefig(path)` writes it."""
        return _display().draw(self)


class Tabular:
    """What is a table as well."""

    def to_polars(self) -> pl.DataFrame:
        """Return the table as a polars DataFrame."""
        raise NotImplementedError

    def to_pandas(self) -> Any:
        """Return the table as a pandas DataFrame; raises InputError where pandas lacks."""
        return pandas_frame(self.to_polars())


class TableResult(Result, Tabular):
    """A result that is a table as well."""


def _display() -> Display:
    # By name: what knows all results lies above each of them.
    return cast(Display, importlib.import_module("coupled.api.display"))


def frame_of(rows: Sequence[Mapping[str, Any]], columns: Sequence[str] = ()) -> pl.DataFrame:
    """Return rows of figures as a polars DataFrame, null for None; without rows, of `columns`."""
    polars: Any = importlib.import_module("polars")
    if rows:
        frame: pl.DataFrame = polars.DataFrame(rows, infer_schema_length=None)
    else:
        frame = polars.DataFrame({name: [] for name in columns})
    return frame


def pandas_frame(frame: pl.DataFrame) -> Any:
    """Return a frame of polars as one of pandas; raises InputError where pandas lacks."""
    try:
        pandas: Any = importlib.import_module("pandas")
    except ImportError:
        problem = "is not installed: pip install pandas, or take to_polars()"
        raise InputError("pandas", "", problem) from None
    return pandas.DataFrame({name: frame[name].to_list() for name in frame.columns})
