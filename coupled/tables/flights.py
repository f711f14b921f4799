"""The tables of a comparison of flights, of a record, and of a rig exported to JSBSim."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from coupled.authority.figures import named, rows
from coupled.display import System
from coupled.tables.table import NONE, Row, Table

if TYPE_CHECKING:
    from coupled.authority.compare import Flight
    from coupled.exporting.write import Export
    from coupled.record.record import Record


def comparison_table(flights: Sequence[Flight], system: System = "si") -> Table:
    """Return the figures of flights, a column for each configuration.

    Where each flight is of a case of its own, a column for each case.
    """
    cases = {flight.outcome.case for flight in flights}
    by_case = len(cases) == len(flights) > 1
    heads = [flight.outcome.case if by_case else named(flight) for flight in flights]
    cells = tuple((label, *texts) for label, texts in rows(flights, system))
    return Table(("", *heads), cells)


def record_table(record: Record) -> Table:
    """Return the range and the mean of each channel."""
    columns = zip(record.channels, record.data.T, strict=True)
    cells = tuple((name, *_range(values)) for name, values in columns)
    return Table(("channel", "least", "mean", "greatest"), cells)


def _range(values: np.ndarray) -> Row:
    there = values[np.isfinite(values)]
    if not there.size:
        return (NONE,) * 3
    return tuple(f"{float(each):.4g}" for each in (there.min(), there.mean(), there.max()))


def export_table(found: Export) -> Table:
    """Return the difference of each flight by JSBSim alone from the flight of the package."""
    cells = tuple(
        (
            *(one.run, f"{one.case}, {one.configuration}"),
            *(f"{100 * x:.3f} %" for x in (one.deflection, one.force, one.modifying_force)),
            NONE if one.loss is None else f"{100 * one.loss:+.3f}",
        )
        for one in found.beside
    )
    heads = ("run", "case", "deflection", "force", "F_mod", "lost")
    caption = "Flight by JSBSim alone less the same flight by coupled: deflection in % of travel,"
    caption += " forces in % of the greatest, authority lost in points"
    return Table(heads, cells, caption, "llr")
